"""Hooks for MkDocs: notebooks and blocks as pages, the lab, the rules of `check`, and links out of this folder."""

from __future__ import annotations

import re
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zlib import crc32

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from nbconvert import MarkdownExporter
from nbconvert.preprocessors import ExecutePreprocessor

from friction_fmus.check.findings import RULES

DOCS = Path(__file__).parent
sys.path.append(str(DOCS))
from live_site import block_pages, blocks_by_kind, lab_files, lab_page, prepare  # noqa: E402
from tables import filled  # noqa: E402

NOTEBOOKS = DOCS.parent / "examples" / "notebooks"


def on_files(files: Files, config: MkDocsConfig, **_: Any) -> Files:
    """Add the lab, the pages of the blocks, and a page and the figures of each notebook."""
    paths = sorted(NOTEBOOKS.glob("*.ipynb"))
    with ThreadPoolExecutor() as threads:
        scripts = prepare(threads)
        notebooks = [notebook_page(path.stem, path.read_text(encoding="utf-8")) for path in paths]  # meanwhile
        for script in scripts:
            script.result()
    files.append(File.generated(config, "lab.md", content=lab_page()))
    for name, content in (*((f"lab/{name}", text) for name, text in lab_files()), *block_pages()):
        files.append(File.generated(config, name, content=content))
    for notebook in notebooks:
        for name, content in notebook.items():
            files.append(File.generated(config, f"notebooks/{name}", content=content))
    return files


def on_config(config: MkDocsConfig, **_: Any) -> MkDocsConfig:
    """Put the pages of the blocks behind that of all blocks, by kind."""
    assert config.nav
    config.nav = with_blocks(config.nav)
    return config


def with_blocks(entries: list[Any]) -> list[Any]:
    """Return entries of the navigation in which the page of all blocks is a section."""
    found = []
    for entry in entries:
        [(heading, inside)] = entry.items() if isinstance(entry, dict) else [("", entry)]
        if isinstance(inside, list):
            found.append({heading: with_blocks(inside)})
        elif inside == "blocks/index.md":
            found += [entry, *blocks_by_kind()]
        else:
            found.append(entry)
    return found


def on_post_build(config: MkDocsConfig, **_: Any) -> None:
    """Move scripts inside of pages to files, for a policy without them, and correct what Material leaves to do.

    Its search has no name, each button at a listing is a landmark without a name, and tables and listings that scroll
    sideways cannot be reached by key.
    """
    site = Path(config.site_dir)
    folder = site / "assets" / "inside"
    folder.mkdir(parents=True, exist_ok=True)
    for path in site.rglob("*.html"):

        def moved(match: re.Match[str], up: str = "../" * (len(path.relative_to(site).parts) - 1)) -> str:
            name = f"{crc32(match[1].encode()):08x}.js"
            (folder / name).write_text(match[1], encoding="utf-8")
            return f'<script src="{up}assets/inside/{name}"></script>'

        text = re.sub(r"<script>(.*?)</script>", moved, path.read_text(encoding="utf-8"), flags=re.DOTALL)
        text = text.replace(
            'data-md-component="search" role="dialog"', 'data-md-component="search" role="dialog" aria-label="Search"'
        )
        text = text.replace("<th></th>", "<td></td>").replace("<table>", '<table tabindex="0">')
        path.write_text(text, encoding="utf-8")
    for path in site.glob("assets/javascripts/bundle.*.js"):
        text = path.read_text(encoding="utf-8").replace('"nav",{class:"md-code__nav"}', '"div",{class:"md-code__nav"}')
        text = re.sub(r"(\{scrollable:(\w+)\}\)=>\{\2)&&\w+\?", r"\1?", text)  # not only where a pointer can hover
        path.write_text(text, encoding="utf-8")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Add tables and the rules of `check`, replace links out of this folder by names, and names of pages by titles."""
    markdown = filled(markdown.replace("<!-- rules -->", rules_page()))
    folders = "benchmarks|examples|fmu_src|friction_fmus|harness|tests"
    inside = re.sub(rf"\[([^\]]+)\]\(\.\./(?:{folders})/[^)]*\)", r"`\1`", markdown)
    return re.sub(r"\[([\w-]+\.md)\]\(", lambda match: f"[{title(match[1])}](", inside)


def rules_page() -> str:
    """Return the rules of `check` as tables."""
    titles = {
        "archive": "The archive",
        "description": "modelDescription.xml of FMI 2.0",
        "both": "modelDescription.xml of both versions",
        "binary": "The binary",
        "fmi3": "FMI 3.0",
        "ssp": "SSP",
    }
    lines = []
    for kind, heading in titles.items():
        lines += [
            f"### {heading}",
            "",
            f"| rule | severity | { {'fmi3': 'FMI 3.0', 'ssp': 'SSP 1.0'}.get(kind, 'FMI 2.0.5') } | error |",
            "|---|---|---|---|",
        ]
        for rule in RULES.values():
            if rule.kind == kind:
                lines.append(f"| `{rule.id}` | {rule.severity} | {rule.section} | {rule.summary} |")
        lines.append("")
    return "\n".join(lines)


def title(page: str) -> str:
    """Return the first heading of a page of this folder."""
    text = (DOCS / page).read_text(encoding="utf-8")
    return next(line.removeprefix("# ") for line in text.splitlines() if line.startswith("# "))


@cache  # `mkdocs serve` builds again after each change
def notebook_page(name: str, content: str) -> dict[str, str | bytes]:
    """Run a notebook and return its page and its figures, file name -> content.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        If a cell fails.
    """
    notebook = nbformat.reads(content, as_version=4)
    with TemporaryDirectory() as folder:
        ExecutePreprocessor(timeout=300, startup_timeout=180).preprocess(notebook, {"metadata": {"path": folder}})
    resources = {"unique_key": name, "output_files_dir": f"{name}_files"}
    text, made = MarkdownExporter().from_notebook_node(notebook, resources)
    return {f"{name}.md": text, **made["outputs"]}
