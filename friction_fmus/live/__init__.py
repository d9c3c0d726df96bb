"""Scripts and styles of pages in which models run."""

from pathlib import Path
from typing import Final

from friction_fmus.export.targets.wasm.npm_package import class_script

__all__ = ["SCRIPTS", "assets"]

_SCRIPTS: Final = ("uplot.js", "core.js", "sliders.js", "chart.js")
SCRIPTS: Final = ("fmu.js", *_SCRIPTS)
"""The scripts of a page with models, in the order in which it loads them."""


def assets() -> dict[str, str]:
    """Return the scripts and styles that pages with models share, by file name."""
    names, folder = (*_SCRIPTS, "uplot.css", "uplot.LICENSE", "live.css"), Path(__file__).parent
    return {"fmu.js": class_script()} | {name: (folder / name).read_text(encoding="utf-8") for name in names}
