"""The documentation of a composite FMU: a page with the diagram and the sources of its parts, and their licences."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path

from lxml import html

from harness.composite.code import PartCode
from harness.composite.diagram import diagram
from harness.composite.interface import Variable
from harness.html import STYLE, row, table
from harness.parts.fmu import FmuPart
from harness.storage.zip_file import open_zip, read_zip
from harness.system.assembly import Assembly
from harness.system.wire import Wire

PAGE = "documentation/index.html"


def documentation(
    system: Assembly,
    identifier: str,
    summary: str,
    codes: Mapping[str, PartCode],
    variables: Sequence[Variable],
) -> dict[str, bytes]:
    """Return the files by their place in the FMU."""
    found: dict[str, bytes] = {}
    for name, code in {code.folder: (name, code) for name, code in codes.items()}.values():
        part = system.parts[name]
        assert isinstance(part, FmuPart)
        with open_zip(part.path) as archive:
            for member in sorted(archive.namelist()):
                if member.startswith("documentation/licenses/") and not member.endswith("/"):
                    found[f"documentation/licenses/{code.folder}-{Path(member).name}"] = read_zip(archive, member)
    texts = dict.fromkeys(found.values())
    found["documentation/licenses/license.txt"] = b"\n".join(texts) or b"The parts of this FMU state no licence.\n"
    drawing = diagram(system, identifier)
    found["documentation/diagram.svg"] = drawing
    found[PAGE] = _page(system, identifier, summary, variables, drawing).encode()
    return found


def _page(system: Assembly, identifier: str, summary: str, variables: Sequence[Variable], drawing: bytes) -> str:
    width, height = (
        round(float(size) * 4.0 / 3.0) for size in re.findall(rb'(?:width|height)="([\d.]+)pt"', drawing)[:2]
    )
    ways = dict.fromkeys(f"{wire.ends[0][0]} to {wire.ends[1][0]}" for wire in system.wires)
    alternative = escape(f"Block diagram with connections from {', '.join(ways)}" if ways else f"Parts of {identifier}")
    parts = "".join(
        row(name, part.archive.description.modelName, part.archive.description.description or "")
        for name, part in system.parts.items()
        if isinstance(part, FmuPart)
    )
    connections = "".join(row(wire.source, wire.target, _map(wire)) for wire in system.wires)
    listed = "".join(
        row(v.name, v.causality, v.port.unit or "", "" if v.start is None else f"{v.start:g}", v.port.description)
        for v in variables
    )
    tables = [
        ("Parts", "FMUs whose sources this FMU contains", ("name", "model", "description"), parts),
        ("Connections", "Values that parts exchange", ("source", "target", "conversion"), connections),
        ("Variables", "Variables and their start values", ("name", "causality", "unit", "start", "meaning"), listed),
    ]
    shown = "".join(
        f"<h2>{title}</h2>\n{table(caption, heads, f'<tbody>{body}</tbody>')}"
        for title, caption, heads, body in tables
        if body
    )
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{identifier}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<style>{STYLE}</style>\n</head>\n<body>\n<main>\n<h1>{identifier} <small>composite</small></h1>\n"
        f'<img class="icon" src="../model.png" alt="Icon of {identifier}" width="200" height="200">\n'
        f"<p><strong>{escape(summary)}.</strong></p>\n<p>The FMU solves the loops of its parts.</p>\n"
        f'<div class="wide figures">\n<img src="diagram.svg" alt="{alternative}" width="{width}" height="{height}">\n'
        f"</div>\n{shown}<h2>Source</h2>\n{''.join(_sources(system))}</main>\n"
        '<footer>\n<p><a href="licenses/license.txt">Licences</a> of the parts.</p>\n</footer>\n</body>\n</html>\n'
    )


def _sources(system: Assembly) -> Iterator[str]:
    """Yield the sources of the models, from the pages of their FMUs; a page of another tool is not quoted."""
    seen = set()
    for part in {part.path: part for part in system.parts.values() if isinstance(part, FmuPart)}.values():
        if not part.strict:
            continue
        with open_zip(part.path) as archive:
            page = html.fromstring(read_zip(archive, PAGE)) if PAGE in archive.namelist() else None
        heads = [] if page is None else [head for head in page.iter("h2") if head.text == "Source"]
        for element in heads[0].itersiblings() if heads else ():
            if element.tag not in ("p", "pre"):
                break
            text = escape("".join(map(str, element.itertext())))
            if (element.tag, text) not in seen:
                seen.add((element.tag, text))
                lead = f"<b>{escape(part.archive.description.modelName)}:</b> " if element.tag == "p" else ""
                yield f"<{element.tag}>{lead}{text}</{element.tag}>\n"


def _map(wire: Wire) -> str:
    texts = [f"gain {wire.gain:g}"] if wire.gain != 1.0 else []
    texts += [f"offset {wire.offset:g}"] if wire.offset != 0.0 else []
    texts += [f"delay of {wire.delay} steps"] if wire.delay else []
    texts += [] if wire.initial is None else [f"{wire.initial:g} until then"]
    return ", ".join(texts)
