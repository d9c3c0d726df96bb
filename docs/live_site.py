"""The lab and the pages of the blocks: files that follow from the blocks, for the site and for the lab's own folder.

``python docs/live_site.py FOLDER`` writes the lab alone, as a folder that can be opened as a file or served.
"""

from __future__ import annotations

import inspect
import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from friction_fmus import conditions, fmu
from friction_fmus.blocks.block_declarations import FILE
from friction_fmus.blocks.catalogue import Block, catalogue
from friction_fmus.blocks.macros import Paragraph, paragraphs
from friction_fmus.blocks.probe import VariableRow, variable_groups
from friction_fmus.export.block_fmu import block_source
from friction_fmus.export.composite.composite_archive import composite_source
from friction_fmus.export.targets import SourceFmu
from friction_fmus.export.targets.wasm.npm_package import WasmModel, wasm_model
from friction_fmus.harness import System
from friction_fmus.live import SCRIPTS, assets

DOCS = Path(__file__).parent
sys.path.append(str(DOCS))
from equations import equations as typeset  # noqa: E402
from markdown.extensions.toc import slugify  # noqa: E402
from needs import CONDITIONS  # noqa: E402
from portraits import about_block, opened, pictures  # noqa: E402
from tables import markdown  # noqa: E402

LAB = DOCS / "lab"
ON_A_MASS = ("LuGre", "ElastoPlastic", "Dahl", "GMS", "ModifiedLeuven", "Leuven", "MaxwellSlip", "BlimanSorine")
"""Friction models that the lab also puts under a mass: their force follows from the velocity alone, continuously."""
MOST_EFFECTS = 6
"""Effects on the page of a block that none of them names in its title."""
SYSTEMS = ("mass", "axis")
"""System files of the lab, see `ON_A_MASS`."""
KINDS = {
    "friction": "Friction models",
    "plant": "Plants",
    "compensator": "Compensators",
    "signal": "Signals",
}


def models() -> list[str]:
    """Return the models of the lab: friction that opposes a given velocity."""
    return [
        name for name, block in catalogue().items() if block.kind == "friction" and "speed" in described(name)["about"]
    ]


@cache
def described(name: str) -> dict[str, Any]:
    """Return what the page of a block shows: the variables, the picture, and what its script tells."""
    block = catalogue()[name]
    with opened(block, fmu(name)) as bench:
        groups = variable_groups(bench.description)
        return {
            "about": about_block(bench) | {"equations": equations(block, groups)},
            "groups": groups,
            "pictures": pictures(bench),
        }


def prepare(threads: Executor, chosen: Sequence[str] | None = None) -> list[Future[str]]:
    """Describe all or some blocks, and begin to compile them and the systems of the lab; the results are kept.

    The working directory changes while an FMU is loaded, so all are loaded before the threads begin.
    """
    names = list(catalogue()) if chosen is None else list(chosen)
    systems = [(name, system) for name in ON_A_MASS if name in names for system in SYSTEMS]
    for name in names:
        described(name)
    for each in systems:
        system_fmu(*each)
    return [
        *(threads.submit(block_script, name) for name in names),
        *(threads.submit(system_script, *s) for s in systems),
    ]


def equations(block: Block, groups: Mapping[str, Sequence[VariableRow]]) -> str:
    """Return the equations of a block as HTML."""
    names = {entry.name for entries in groups.values() for entry in entries}
    return "".join(typeset(each.lines, names) for each in paragraphs(block.notes) if each.equations)


def lab_files(chosen: Sequence[str] | None = None) -> Iterator[tuple[str, str]]:
    """Return the files of the lab that are made, by path in its folder, with all or some friction models."""
    known = models() if chosen is None else chosen
    on_mass = [name for name in ON_A_MASS if name in known]
    for name, text in assets().items():
        yield f"live/{name}", text
    for name in known:
        yield f"models/{name}.js", block_script(name)
    for name in on_mass:
        for system in SYSTEMS:
            yield f"models/{name}-{system}.js", system_script(name, system)
    names = json.dumps({"models": known, "onMass": on_mass})
    yield "models/names.js", f"FrictionLive.catalogue = {names};\n"


def model_script(model: WasmModel, about: dict[str, Any]) -> str:
    """Return the script that registers a model, with what the page says about it."""
    name, told = json.dumps(model.name), json.dumps(about, separators=(",", ":"))
    return f"{model.script()}FrictionLive.about[{name}] = {told};\n"


@cache
def block_script(name: str) -> str:
    """Return the script of a block."""
    return model_script(wasm_model(block_source(name)), described(name)["about"])


@cache
def system_script(friction: str, name: str) -> str:
    """Return the script of the system in ``NAME.toml`` with a friction model.

    A system has the same name with each model while it compiles, so that the code of its other parts is compiled once.
    """
    text, source = system_fmu(friction, name)
    model = wasm_model(source)
    named = replace(model, description={**model.description, "name": f"{friction}-{name}"})
    return model_script(named, {"toml": text})


@cache
def system_fmu(friction: str, name: str) -> tuple[str, SourceFmu]:
    """Return the system file ``NAME.toml`` with a friction model, and the system as an FMU of sources."""
    text = (LAB / f"{name}.toml").read_text(encoding="utf-8").replace('"LuGre"', f'"{friction}"')
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.toml"
        file.write_text(text, encoding="utf-8")
        with System.from_toml(file, resolve=fmu, open_inputs=True) as system:
            return text, composite_source(system, name, ())


def block_pages() -> Iterator[tuple[str, str | bytes]]:
    """Return the pages of the blocks with their pictures, by path in the documentation."""
    yield "blocks/index.md", index_page()
    for name, block in catalogue().items():
        found = described(name)
        yield f"blocks/{name}.md", block_page(block, found)
        for number, picture in enumerate(found["pictures"], start=1):
            yield f"blocks/{name}-{number}.svg", picture
        if name not in models():
            yield f"lab/models/{name}.js", block_script(name)


def blocks_by_kind() -> list[dict[str, list[dict[str, str]]]]:
    """Return the pages of the blocks as sections of the navigation."""
    blocks = catalogue().values()
    return [
        {f"{kind.capitalize()} blocks": [{each.name: f"blocks/{each.name}.md"} for each in blocks if each.kind == kind]}
        for kind in KINDS
    ]


def index_page() -> str:
    """Return the list of all blocks."""
    lines = [
        "# All blocks",
        "",
        "Each page has the equations, the variables and a figure that moves with the parameters. The last column says "
        "what the equations were checked against.",
    ]
    for kind, heading in KINDS.items():
        lines += ["", f"## {heading}", "", "| block | what it is | checked against |", "|---|---|---|"]
        blocks = [block for block in catalogue().values() if block.kind == kind]
        lines += [
            f"| [{block.name}]({block.name}.md) | {block.summary.replace('|', chr(92) + '|')} | {checked(block)} |"
            for block in blocks
        ]
    return "\n".join(lines) + "\n"


def checked(block: Block) -> str:
    """Return what the equations of a block were checked against, by its file or by the papers that it cites."""
    read = set(re.findall(r"^% checked against the paper\n@\w+\{(\w+),", FILE.read_text(encoding="utf-8"), re.M))
    cites = set(block.about.cites) - {"FrictionFmus2026"}
    if block.status or not cites:
        return re.sub(r"^(not )?checked against ", lambda m: "not " * bool(m[1]), block.status) or "derived here"
    return "the paper" if cites <= read else "some of the papers" if cites & read else "not the papers"


def block_page(block: Block, found: dict[str, Any]) -> str:
    """Return the page of a block: what it is, the live figure with its fallback, its use, variables, source, notes."""
    names = {entry.name for entries in found["groups"].values() for entry in entries}
    about, notes = split_notes(block)
    first, *rest = [typeset(each.lines, names) if each.equations else markdown(each) for each in about]
    live = "speed" in found["about"] or found["about"].get("figures")
    parts = ["---", "hide: [toc]", "---", "", f"# {block.name}", "", first, ""]
    parts += [live_figure(block.name, len(found["pictures"]))] if live or found["pictures"] else []
    parts += ["\n\n".join(rest), "", *use(block), *relatives(block), "## Variables", ""]
    for title, entries in found["groups"].items():
        parts += [f"### {title}", "", "| name | unit | start | range | meaning |", "|---|---|---|---|---|"]
        for e in entries:
            cells = (f"`{e.name}`", e.unit, ", ".join(e.starts), e.limits, e.text)
            parts.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
        parts.append("")
    parts += conditions_of(block)
    parts += ["## Source", "", f"{block.origin}.", "", "```bibtex", *block.bibtex, "```", ""]
    if notes:
        shown = [typeset(each.lines, names) if each.equations else markdown(each) for each in notes]
        parts += ["## Notes on source and computation", "", "\n\n".join(shown), ""]
    return "\n".join(parts)


def conditions_of(block: Block) -> list[str]:
    """Return the conditions on the use of a block in a loop, each by the first sentence of its function."""
    named = {name: inspect.getdoc(getattr(conditions, name)) or "" for name in CONDITIONS.get(block.name, ())}
    items = [f"- {' '.join(text.partition(chr(10) * 2)[0].split())} (`{name}`)" for name, text in named.items()]
    last = (
        "A [study](../study-of-an-axis.md) evaluates them for the loop of an axis, see [conditions](../conditions.md)."
    )
    return ["## Conditions", "", *items, "", last, ""] if items else []


def split_notes(block: Block) -> tuple[list[Paragraph], list[Paragraph]]:
    """Return what the block is, its equations and when to use it; and notes on the source and the computation."""
    first, *others = paragraphs(block.notes)
    main = [each for each in others if each.equations or each.lead]
    return [first, *main], [each for each in others if each not in main]


def use(block: Block) -> list[str]:
    """Return how to use a block on the command line, in Python and in the lab."""
    # as HTML, since a link in Markdown would need a heading of this name
    address = f"../lab.html#view=contact&amp;models={block.name}"
    lab = [f'<a href="{address}">Move its parameters in the lab</a>', ""] if block.name in models() else []
    code = [f"$ friction-fmus codegen {block.name} -o c"] if block.is_law else []
    return [
        *("## Use it", "", *lab, f"`friction-fmus show {block.name}` lists its variables on the command line.", ""),
        *("```console", f"$ friction-fmus build {block.name} -o fmus", *code, "```", ""),
        *("```python", "from friction_fmus import fmu", f'path = fmu("{block.name}")', "```", ""),
        "The FMU runs in Simulink, Dymola, OpenModelica, OMSimulator and FMPy: see [first FMU](../first-fmu.md).",
        "",
    ]


def relatives(block: Block) -> list[str]:
    """Return links to blocks for the same friction, and to effects whose scripts use the block."""
    blocks = catalogue()
    laws = [name for name, each in blocks.items() if each.kind == "compensator"]
    frictions = sorted((n for n, each in blocks.items() if each.kind == "friction"), key=len, reverse=True)
    based = {law: next((name for name in frictions if name in law), "") for law in laws}
    link = "[{0}]({0}.md)".format
    lines = []
    if block.kind == "friction":
        own = [law for law, name in based.items() if name == block.name]
        named = f"Made for this model: {', '.join(map(link, own))}. " if own else ""
        lines += [f"{named}[Which compensator](../which-compensator.md) compares all of them.", ""]
    elif based.get(block.name):
        others = [law for law, name in based.items() if name == based[block.name] and law != block.name]
        also = f" Other compensators for it: {', '.join(map(link, others))}." if others else ""
        lines += [f"Made for the friction model {link(based[block.name])}.{also}", ""]
    headings = [title for title, _ in effects() if re.search(rf"\b{block.name}\b", title)]
    titles = headings or [title for title, text in effects() if block.name in text][:MOST_EFFECTS]
    shown = [f"- [{title}](../effects.md#{slugify(title, '-')})" for title in titles]
    return ["## Related", "", *lines, *shown, ""] if lines or shown else []


@cache
def effects() -> list[tuple[str, frozenset[str]]]:
    """Return the effects of docs/effects.md in their order, with the words about them."""
    sections = re.split(r"^##+ ", (DOCS / "effects.md").read_text(encoding="utf-8"), flags=re.M)
    return [(each.splitlines()[0], frozenset(re.findall(r"\w+", each))) for each in sections if "![Figure]" in each]


def live_figure(name: str, pictures: int) -> str:
    """Return the live figure of a block as HTML; its content is what is seen without JavaScript."""
    images = "".join(
        f'<img src="{name}-{number}.svg" alt="Behaviour of {name} with its start values" width="403" height="288">'
        for number in range(1, pictures + 1)
    )
    scripts = "".join(
        f'<script src="../lab/{file}" defer></script>'
        for file in (*(f"live/{s}" for s in SCRIPTS), "models.js", "views.js", "block.js")
    )
    styles = "".join(f'<link rel="stylesheet" href="../lab/{file}.css">' for file in ("live/uplot", "live/live", "lab"))
    return f'<div class="live-block" data-block="{name}">{images}</div>\n{styles}{scripts}\n'


def lab_page() -> str:
    """Return the page of the lab in the site, from its own page."""
    text = (LAB / "index.html").read_text(encoding="utf-8")
    body = re.search(r"<!-- lab -->\n(.*)<!-- /lab -->", text, re.S)
    assert body, "docs/lab/index.html marks the lab"
    inside = re.sub(r'(src|href)="(?!https?:|#|\.\./)', r'\1="lab/', body[1]).replace('"../', '"')
    inside = inside.replace('<div id="lab">', '<div id="lab" data-pages="./">')
    return f"---\nhide: [navigation, toc]\ntitle: Lab\n---\n\n{inside}"


def write_lab(folder: Path, chosen: Sequence[str] | None = None) -> None:
    """Write the lab as a folder of its own, with all or some friction models."""
    folder.mkdir(parents=True, exist_ok=True)
    for source in LAB.iterdir():
        if source.suffix != ".toml":
            (folder / source.name).write_bytes(source.read_bytes())
    with ThreadPoolExecutor() as threads:
        for script in prepare(threads, models() if chosen is None else chosen):
            script.result()
    for name, text in lab_files(chosen):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write_lab(Path(sys.argv[1]))
