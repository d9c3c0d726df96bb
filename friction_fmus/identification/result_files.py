"""Files of an identification: parameters, FMUs, figures, and all numbers as JSON."""

from __future__ import annotations

import json
import logging
import math
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w

from friction_fmus.axis.position_map import PositionMap, gravity_map
from friction_fmus.errors import IdentificationError
from friction_fmus.export.identified_axis import IdentifiedAxis
from friction_fmus.identification.data.reading import Measurement
from friction_fmus.identification.data.record import Record, RecordFinding
from friction_fmus.identification.fit.axis_terms import VALUES
from friction_fmus.identification.fit.contact_model import contact_model
from friction_fmus.identification.fit.estimate import Estimate
from friction_fmus.identification.fit.idim import filtered_motion
from friction_fmus.identification.fit.position import PositionFit
from friction_fmus.identification.identification_result import Identification, name_of, viscous_beside, write_viscous
from friction_fmus.identification.model_comparison import ModelComparison
from friction_fmus.listings import plain
from harness.compiling import toolchain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOG = logging.getLogger("friction_fmus")

COLOURS = ("#0072B2", "#D55E00", "#009E73")  # colours that also differ in lightness (after M. Okabe, K. Ito, 2008)
DASHES = ("solid", "dashed", "dotted")


def write_results(
    found: ModelComparison,
    measurement: Measurement,
    findings: Sequence[RecordFinding],
    windows: Mapping[str, Any],
    out: Path,
    *,
    fmus: bool = True,
) -> list[Path]:
    """Write all files of a comparison, without FMUs where no compiler is installed; if that fails, change nothing."""
    new = not out.exists()
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise IdentificationError(f"Cannot create the folder {out} ({error.strerror}); choose another one.") from error
    try:
        # on the same file system, so that the files can be moved into place
        with tempfile.TemporaryDirectory(prefix=".identify-", dir=out) as scratch:
            stage = Path(scratch)
            lacking = toolchain.lacking()
            if fmus and lacking is not None:
                _LOG.warning("the results are written without FMUs: %s", lacking)
            for result in found.results:
                if fmus and lacking is None:
                    result.to_fmu(stage)
                    if result.position is not None:
                        rotary = result.records[0].units.rotary
                        result.position.table.to_fmu(stage, f"{result.model}PositionMap", rotary)
                si = result.records[0].units.known
                if si:
                    result.to_ssv(stage / f"{result.model}.ssv")
                if si and (beside := viscous_beside(result)):
                    write_viscous(result, beside, stage / f"{result.model}Viscous.ssv")
                result.plot(stage / f"{result.model}.png")
            (stage / "parameters.toml").write_text(toml_text(found, measurement), encoding="utf-8")
            content = _json(found, measurement, findings, windows)
            (stage / "identification.json").write_text(json.dumps(plain(content), indent=2) + "\n", encoding="utf-8")
            comparison(found).savefig(stage / "comparison.png", dpi=130, metadata={"Software": None})
            files = sorted(file.name for file in stage.iterdir())
            for name in files:
                (stage / name).replace(out / name)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise IdentificationError(f"Cannot write to {out} ({reason}); free space or choose another folder.") from error
    finally:
        if new and not any(out.iterdir()):
            out.rmdir()
    return [out / name for name in files]


def comparison(found: ModelComparison) -> Figure:
    """Draw the errors of all models as bars, and signal and residual of the three best models."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    results = found.results
    height = 0.6 + 0.28 * len(results)
    figure = Figure(figsize=(9.0, 5.2 + height), layout="constrained")
    FigureCanvasAgg(figure)
    bars, signals, errors = figure.subplots(3, 1, height_ratios=(height, 2.6, 1.6))
    _bars(bars, found)
    best = results[0]
    part = _part(best)
    signals.plot(best.t[part], best.measured[part], color="#222222", lw=2.6, label="measured")
    for result, colour, dashes in zip(results, COLOURS, DASHES, strict=False):
        inside = (result.t >= best.t[part][0]) & (result.t <= best.t[part][-1])
        style: dict[str, Any] = {"color": colour, "linestyle": dashes, "lw": 1.3}
        signals.plot(result.t[inside], result.predicted[inside], label=result.model, **style)
        errors.plot(result.t[inside], result.residuals[inside], **style)
    unit = "" if best.unit == "1" else f" [{best.unit}]"
    signals.set(ylabel=f"{name_of(best)}{unit}", title="The best models in a part of the training data")
    signals.tick_params(labelbottom=False)
    errors.set(xlabel=best.records[0].clock, ylabel=f"predicted −\nmeasured{unit}")
    signals.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    for axes in (bars, signals, errors):
        axes.grid(True, color="#dddddd", lw=0.6)
        axes.set_axisbelow(True)
    return figure


def _bars(axes: Axes, found: ModelComparison) -> None:
    """Draw a pair of bars for each model; much longer bars are truncated and labelled with their value."""
    train = [result.train.relative_percent for result in found.results]
    pairs = [(train, "#999999", "training")]
    if found.ranked_by != "BIC":
        scores = (result.validation for result in found.results)
        pairs.append(([score.relative_percent if score else math.nan for score in scores], COLOURS[0], "validation"))
    every = np.concatenate([values for values, _, _ in pairs])
    limit = 1.15 * min(float(np.max(every)), 4.0 * float(np.median(every)))
    rows = np.arange(len(train))
    for (values, colour, label), side in zip(pairs, (-1, 1) if len(pairs) > 1 else (0,), strict=True):
        axes.barh(rows + 0.2 * side, values, 0.36, color=colour, label=label)
        for row, value in zip(rows, values, strict=True):
            where = (min(value, 0.93 * limit), row + 0.2 * side)
            box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6} if value > 0.93 * limit else None
            axes.text(*where, f" {value:.2f}", va="center", fontsize="x-small", bbox=box)
    axes.set_xlim(0.0, limit)
    axes.set_yticks(rows, [result.model for result in found.results])
    axes.invert_yaxis()
    axes.set_xlabel("rms error [% of the rms of the signal]")
    axes.set_title(f"Models by {found.ranked_by}, best at the top")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)


def _part(result: Identification) -> slice:
    """Return a tenth of the samples, around the largest change of the measured signal."""
    count = len(result.t)
    half = max(30, count // 20)
    width = max(1, count // 200)
    change = np.abs(result.measured[width:] - result.measured[:-width])
    centre = int(np.argmax(change[half:-half]) + half) if len(change) > 2 * half else count // 2
    return slice(max(0, centre - half), centre + half)


def toml_text(found: ModelComparison, measurement: Measurement) -> str:
    """Return the parameters of all models as TOML."""
    mapping = measurement.mapping
    document: dict[str, Any] = {"title": f"Parameters of friction models identified from {mapping.name}"}
    document |= {"citation": mapping.citation} if mapping.citation else {}
    for result in found.results:
        axis = result.records[0].units
        known = contact_model(result.block, axis).parameters
        units = {**{name: each.unit for name, each in known.items()}, "M": axis.inertia, "OF": axis.force}
        weak = {name: f"poorly identifiable: {why}" for name, why in result.weak.items()}
        document[result.model] = {
            name: toml_entry(e.value, e.unit, weak.get(name, ""), e.standard_error)
            for name, e in result.parameters.items()
        } | {name: toml_entry(value, units[name], "not identified") for name, value in result.fixed.items()}
    return tomli_w.dumps(document)


def toml_entry(value: float, unit: str, description: str, error: float = math.nan) -> dict[str, Any]:
    """Return a parameter for TOML, without what is not known."""
    found: dict[str, Any] = {"value": value, "unit": unit}
    found |= {"standard_error": error} if math.isfinite(error) else {}
    return found | ({"description": description} if description else {})


def _json(
    found: ModelComparison, measurement: Measurement, findings: Sequence[RecordFinding], windows: Mapping[str, Any]
) -> dict[str, Any]:
    mapping = measurement.mapping
    return {
        "data": {
            "file": mapping.file.name if mapping.file else "",
            "name": mapping.name,
            "citation": mapping.citation,
            "columns": {role: asdict(column) for role, column in mapping.columns.items()},
            "windows": {name: list(pair) for name, pair in windows.items()},
            "pieces": [
                {"name": r.name, "samples": len(r), "begin": float(r.t[0]), "end": float(r.t[-1]), "Ts": r.Ts}
                for r in measurement.records
            ],
        },
        "findings": [asdict(finding) for finding in findings],
        "ranked_by": found.ranked_by,
        "models": [_result(result) for result in found.results],
        "failed": found.failed,
        "axes": [axis_of(each, mapping.citation) for each in found.results if each.records[0].units.known],
    }


def axis_of(result: Identification, citation: str) -> IdentifiedAxis:
    """Return the axis with an identified model, for the targets of `export`."""
    table, values = None if result.position is None else result.position.table, result.values()
    both = values.get("M", 0.0), values.get("OF", 0.0)
    return identified_axis(result.records, citation, result.model, str(result.block), values, *both, table)


def identified_axis(
    records: Sequence[Record],
    citation: str,
    label: str,
    block: str,
    values: Mapping[str, float],
    mass: float,
    offset: float,
    table: PositionMap | None,
) -> IdentifiedAxis:
    """Return an axis; among the values, Fv may be that of a viscous friction beside the block."""
    units, speed = records[0].units, largest_speed(max(records, key=len))
    known = contact_model(block, units).parameters
    own = {name: value for name, value in values.items() if name in known}
    beside = 0.0 if "Fv" in known else values.get("Fv", 0.0)
    name, rotary = records[0].name, units.rotary
    terms = {name: value for name, value in values.items() if name in VALUES - known.keys()}
    if table is None and "G_sin" in terms:
        table = gravity_map(terms["G_sin"], terms["G_cos"])
    return IdentifiedAxis(name, citation, rotary, label, block, own, beside, mass, offset, table, speed, terms=terms)


def largest_speed(record: Record) -> float:
    """Return the largest speed of a record [m/s]; 0 if it has neither velocity nor position."""
    v = record.v if record.q is None else filtered_motion(record).v
    return 0.0 if v is None else float(np.max(np.abs(v)))


def _result(result: Identification) -> dict[str, Any]:
    return {
        "model": result.model,
        "method": result.method,
        "signal": result.signal,
        "unit": result.unit,
        "parameters": {name: _estimate(e) for name, e in result.parameters.items()},
        "initial": {name: _estimate(e) for name, e in result.initial.items()},
        "fixed": result.fixed,
        "correlation": {"names": [*result.parameters, *result.initial], "matrix": result.correlation.tolist()},
        "weak": result.weak,
        "train": asdict(result.train),
        "validation": result.validation and asdict(result.validation),
        "aic": result.aic,
        "bic": result.bic,
        "standard_errors": result.errors,
        "position": _position(result.position) if result.position else None,
        "warnings": result.warnings,
        "seconds": result.seconds,
        "simulations": result.simulations,
    }


def _position(found: PositionFit) -> dict[str, Any]:
    return {
        **asdict(found.table),
        "cross_validation": found.crossed,
        "cross_validation_without": found.crossed_without,
        "train_without": found.train_without and asdict(found.train_without),
        "validation_without": found.validation_without and asdict(found.validation_without),
    }


def _estimate(estimate: Estimate) -> dict[str, Any]:
    return {"value": estimate.value, "standard_error": estimate.standard_error, "unit": estimate.unit}
