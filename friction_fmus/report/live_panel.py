"""The what-if panel of the page: its scripts, its data, and its picture without scripts."""

import base64
import json
import math
import re
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from friction_fmus.fmi.drawing import plain_style, svg_of
from friction_fmus.identification import Array
from friction_fmus.live import SCRIPTS, assets
from friction_fmus.report.figures import thinned
from friction_fmus.report.formatting import NO_COMPENSATION, NONE, multiple, reversal
from friction_fmus.study.study_result import StudyResult
from friction_fmus.study.what_if import Knob, WhatIf

POINTS: Final = 1000  # largest number of points of a curve of the picture

DIGITS: Final = 5  # number of digits of a slider's initial value


def live_panel(study: StudyResult, axis: WhatIf) -> Mapping[str, Any]:
    """Return what the template needs: texts, the report's errors of each run, SVG, JSON, JavaScript and CSS."""
    files = assets()
    own = Path(__file__).with_name("what_if.js").read_text(encoding="utf-8")
    models = [run.model.script() for run in axis.runs]
    names = [knob.name for knob in axis.knobs]
    unit = study.units.position
    compensated = next((run.name for run in axis.runs if run.name != NONE), "")
    seconds = axis.Ts * (len(axis.r) - axis.run_up)
    end = math.inf if axis.whole else seconds
    data = {
        "Ts": axis.Ts,
        "r": _packed(axis.r, "<f8"),
        "noise": _packed(axis.noise, "<f4"),
        "runUp": axis.run_up,
        "units": {"position": unit, "force": study.units.force},
        "forceName": study.units.words.force,
        "runs": [{"model": run.model.name, "label": _shown(run.name)} for run in axis.runs],
        "knobs": [_slider(knob) for knob in axis.knobs],
        "delayMargin": _delay_margin(study, axis.runs[0].name),
        "recorded": _recorded(study, end),
        "largest": max(run.metrics.largest for run in axis.runs),
        "views": {} if (turn := reversal(study.record, end=end)) is None else {"around a reversal": turn},
    }  # fmt: skip
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True)
    return {
        "compensated": compensated,
        "names": f"{', '.join(names[:-1])} and {names[-1]}",
        "runs": [(_shown(run.name), run.metrics.rms, run.metrics.largest) for run in axis.runs],
        "picture": _picture(study, axis),
        "data": text.replace("<", "\\u003c").replace("&", "\\u0026"),
        "script": "\n".join([*(files[name] for name in SCRIPTS), *models, own]),
        "style": "\n".join(files[name] for name in ("uplot.css", "live.css")),
        "whole": axis.whole,
        "seconds": seconds,
    }


def _delay_margin(study: StudyResult, name: str) -> float | None:
    """Return the delay margin of a loop [samples]; None if it is not known."""
    margins = study.compensator(name).margins
    return None if margins is None or margins.delay is None else float(f"{margins.delay:.2g}")


def _shown(name: str) -> str:
    """Return the short name of a run."""
    return NO_COMPENSATION if name == NONE else "recommended"


def _slider(knob: Knob) -> Mapping[str, Any]:
    """Return a slider in the displayed unit, and what a model's parameter is divided by its value."""
    shown, factor = multiple(knob.unit, knob.start or 0.01 * knob.most)
    start = float(f"{factor * knob.start:.{DIGITS}g}")
    scale = knob.start / start if start else 1.0 / factor
    return {
        "name": knob.name,
        "text": knob.text,
        "unit": shown or "×",
        "start": start,
        "min": float(f"{factor * knob.least:.2g}"),
        "max": float(f"{factor * knob.most:.2g}"),
        "zero": knob.zero,
        "integer": bool(knob.taps),
        "settings": [{name: scale * value for name, value in each.items()} for each in knob.settings],
        "taps": list(knob.taps),
    }


def _recorded(study: StudyResult, end: float) -> Mapping[str, Mapping[str, list[float]]]:
    """Return the recorded tracking error and force over time, until an end [s]."""
    found = {}
    names = {"position error": "error", f"drive {study.units.words.force}": "force"}
    for picture in study.record:
        name = names.get(picture.y_label)
        if name and picture.data:
            curve = next(iter(picture.data.values()))
            count = bisect_right(curve.x, end)
            x, y = thinned(replace(curve, x=curve.x[:count], y=curve.y[:count]), points=2 * POINTS)
            found[name] = {"t": [float(f"{t:.6g}") for t in x], "y": [float(f"{value:.4g}") for value in y]}
    return found


def _packed(values: Array, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


def _picture(study: StudyResult, axis: WhatIf) -> str:
    """Return the tracking errors of the study over time as SVG."""
    found = {run.name: study.compensator(run.name).error for run in reversed(axis.runs)}
    errors = {name: error for name, error in found.items() if error is not None}
    if not errors:
        return ""
    unit, factor = multiple(study.units.position, np.concatenate([np.asarray(each.y) for each in errors.values()]))
    with plain_style(**{"svg.fonttype": "none"}):  # texts stay texts, for search and screen readers
        figure = Figure(figsize=(4.2, 3.0))
        axes = figure.add_axes((0.16, 0.16, 0.8, 0.71), xlabel="time [s]", ylabel=f"reference − position [{unit}]")
        for name, error in errors.items():
            colour = "#9aa3ad" if name == NONE and len(errors) > 1 else "#1f4e79"
            axes.plot(*thinned(error, (1.0, factor), POINTS), color=colour, lw=1.6, label=_shown(name))
        axes.grid(color="#e3e7ea", lw=0.8)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
        text = svg_of(figure, "Tracking error").decode()
    text = re.sub(r"<\?xml.*?\?>\s*|<metadata>.*?</metadata>\s*|<style.*?</style>", "", text, flags=re.DOTALL)
    return re.sub(r'\bstyle="([^"]*)"', lambda match: _as_attributes(match[1]), text)


def _as_attributes(style: str) -> str:
    """Return a style of SVG as attributes, which the policy of the page allows."""
    pairs = (pair.split(":", 1) for pair in style.split(";") if pair.strip())
    return " ".join(f'{name.strip()}="{value.strip()}"' for name, value in pairs)
