"""What MkDocs does not do by itself: the notebooks, run and as pages; links to files outside of this folder."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from nbconvert import MarkdownExporter
from nbconvert.preprocessors import ExecutePreprocessor

ROOT = Path(__file__).parent.parent
NOTEBOOKS = ROOT / "examples" / "notebooks"


def on_files(files: Files, config: MkDocsConfig, **_: Any) -> Files:
    """Adds a page and the figures of each notebook."""
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        for name, content in notebook_page(path).items():
            files.append(File.generated(config, f"notebooks/{name}", content=content))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Names files of the repository outside of this folder instead of linking to them."""
    return re.sub(r"\[([^\]]+)\]\((?:\.\./)+(?:examples|friction_fmus|harness|tests)/[^)]*\)", r"`\1`", markdown)


def notebook_page(path: Path) -> dict[str, str | bytes]:
    """File name -> content of the page of a notebook, which is run for it, and of its figures.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        If a cell fails.
    """
    notebook = nbformat.read(path, as_version=4)
    folder = {"metadata": {"path": os.environ.get("NOTEBOOK_FOLDER", str(ROOT / "out"))}}
    ExecutePreprocessor(timeout=300).preprocess(notebook, folder)
    resources = {"unique_key": path.stem, "output_files_dir": f"{path.stem}_files"}
    text, made = MarkdownExporter().from_notebook_node(notebook, resources)
    return {f"{path.stem}.md": text, **made["outputs"]}
