"""Verdicts of tools as JUnit and as a page with all tools that were run on a set."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

from lxml import etree

from friction_fmus.fmi.html_page import STYLE
from friction_fmus.reference.case import ReferenceCase
from friction_fmus.reference.tool_runs import FAILED, INACCURATE, PASSED, UNSUPPORTED, Verdict, as_records
from harness.storage.files import atomic_path

_COLOURS: Final = {PASSED: "#d9f2d9", INACCURATE: "#fff0c2", FAILED: "#f9d5d5", UNSUPPORTED: "#eeeeee"}
_JSON: Final = "verdicts.json"


def write_verdicts(verdicts: Sequence[Verdict], tool: str, folder: Path) -> None:
    """Write the verdicts of a tool as JSON and JUnit to the folder of its results."""
    suite = etree.Element("testsuite", name=f"reference set in {tool}")
    for verdict in verdicts:
        test = etree.SubElement(suite, "testcase", classname=tool, name=verdict.case, time=f"{verdict.seconds:.3f}")
        kind = {UNSUPPORTED: "skipped", PASSED: "system-out"}.get(verdict.state, "failure")
        element = etree.SubElement(test, kind)
        if kind == "system-out":
            element.text = _clean(verdict.detail)
        else:
            element.set("message", _clean(f"{verdict.state}: {verdict.detail}"))
    count = Counter(verdict.state for verdict in verdicts)
    suite.set("tests", str(len(verdicts)))
    suite.set("failures", str(count[FAILED] + count[INACCURATE]))
    suite.set("skipped", str(count[UNSUPPORTED]))
    content = etree.tostring(suite, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    text = json.dumps([{**each, "ratio": _finite(each["ratio"])} for each in as_records(verdicts)], indent=1)
    for name, data in (("junit.xml", content), (_JSON, text.encode())):
        with atomic_path(folder / name) as temporary:
            temporary.write_bytes(data)


def _clean(text: str) -> str:
    """Return a text without characters that XML forbids."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def _finite(ratio: float) -> float | None:
    return ratio if math.isfinite(ratio) else None


def write_page(cases: Sequence[ReferenceCase], folder: Path) -> Path:
    """Write the table of all cases and all tools with results in a set."""
    tools = {path.parent.name: _read(path) for path in sorted((folder / "results").glob(f"*/{_JSON}"))}
    head = "".join(f'<th scope="col">{escape(tool)}</th>' for tool in tools)
    rows = []
    for case in cases:
        link = f'<a href="../{escape(case.name)}/README.md">{escape(case.title)}</a>'
        cells = "".join(_cell(found.get(case.name)) for found in tools.values())
        rows.append(f'<tr><th scope="row">{link}</th>{cells}</tr>')
    title = "Reference set for tools that import FMUs"
    path = folder / "results" / "index.html"
    with atomic_path(path) as temporary:
        temporary.write_text(
            f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{title}</title>\n'
            f"<style>{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n<table>\n<thead>\n"
            f'<tr><th scope="col">case</th>{head}</tr>\n</thead>\n<tbody>\n'
            + "\n".join(rows)
            + "\n</tbody>\n</table>\n"
            "</body>\n</html>\n",
            encoding="utf-8",
        )
    return path


def _read(path: Path) -> dict[str, dict[str, Any]]:
    return {each["case"]: each for each in json.loads(path.read_text(encoding="utf-8"))}


def _cell(verdict: dict[str, Any] | None) -> str:
    if verdict is None:
        return "<td></td>"
    detail = f"<br><small>{escape(verdict['detail'])}</small>"
    return f'<td style="background:{_COLOURS[verdict["state"]]}">{escape(verdict["state"])}{detail}</td>'
