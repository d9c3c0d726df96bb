"""Models that run in a page: scripts, styles, and the figures of a block as experiments to repeat."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

from friction_fmus.export.targets.wasm.npm_package import WasmModel, class_script
from friction_fmus.live.recorded_figures import RecordedBench, opened, recorded_figures

__all__ = ["about_block", "assets", "model_script", "opened"]

_FOLDER: Final = Path(__file__).parent
_SCRIPTS: Final = ("uplot.js", "core.js", "sliders.js", "chart.js")
SCRIPTS: Final = ("fmu.js", *_SCRIPTS)
"""The scripts of a page with models, in the order in which it loads them."""


def assets() -> dict[str, str]:
    """Return the scripts and styles that pages with models share, by file name."""
    names = (*_SCRIPTS, "uplot.css", "uplot.LICENSE", "live.css", "page.css")
    return {"fmu.js": class_script()} | {name: (_FOLDER / name).read_text(encoding="utf-8") for name in names}


def model_script(model: WasmModel, about: dict[str, Any]) -> str:
    """Return the script that registers a model, with what the page says about it."""
    name, told = json.dumps(model.name), json.dumps(about, separators=(",", ":"))
    return f"{model.script()}FrictionLive.about[{name}] = {told};\n"


def about_block(bench: RecordedBench) -> dict[str, Any]:
    """Return what a page says of a block beside its variables: texts, and experiments to repeat."""
    block = bench.block
    return {
        "summary": block.summary,
        "source": block.origin,
        "bibtex": "\n\n".join(block.bibtex),
        "features": list(block.features),
        **recorded_figures(bench),
    }
