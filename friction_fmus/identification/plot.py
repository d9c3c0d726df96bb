"""Figure of the measured and the predicted signal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from friction_fmus.identification.data.record import Array
from harness.storage.files import atomic_path

if TYPE_CHECKING:
    from friction_fmus.identification.result import Identification

MEASURED, PREDICTED = "#7f8c8d", "#c0392b"

NAMES = {"mu": "friction coefficient", "friction": "friction {force}", "force": "drive {force}", "q": "position"}


def name_of(result: Identification) -> str:
    """Return the name of the fitted signal, such as ``drive force``."""
    return result.records[0].units.words.fill(NAMES.get(result.signal, result.signal))


def draw(result: Identification, path: Path) -> Path:
    """Draw an identification; see `Identification.plot`."""
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 2, height_ratios=(2.0, 1.0), width_ratios=(1.6, 1.0))
    over_time, over_motion = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[:, 1])
    error = figure.add_subplot(grid[1, 0], sharex=over_time)
    unit = "" if result.unit == "1" else f" [{result.unit}]"
    label = f"{name_of(result)}{unit}"
    x, x_label = _abscissa(result)
    for axes, at in ((over_time, result.t), (over_motion, x)):
        axes.plot(at, result.measured, color=MEASURED, lw=1.4, label="measured")
        axes.plot(at, result.predicted, color=PREDICTED, lw=0.8, label=result.model)
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
    over_motion.set_xlabel(x_label)
    over_motion.locator_params(axis="x", nbins=4)
    # some positions differ only in the fourth digit
    over_motion.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4), useOffset=True)
    over_time.legend(loc="upper right", fontsize="small")
    over_time.tick_params(labelbottom=False)
    error.plot(result.t, result.residuals, color=PREDICTED, lw=0.6)
    error.set_ylabel("predicted − measured")
    error.set_xlabel("time [s]")
    error.grid(alpha=0.3)
    figure.suptitle(
        f"{result.model}: rms error {result.train.rms:.3g}{unit}, {result.train.relative_percent:.2f} % of the signal",
        fontsize="medium",
    )
    with atomic_path(path) as temporary, mpl.rc_context({"svg.hashsalt": "friction-fmus"}):
        figure.savefig(temporary, dpi=130, metadata={"Date": None} if path.suffix == ".svg" else None)
    return path


def _abscissa(result: Identification) -> tuple[Array, str]:
    """Return position, or velocity if no position was measured, at the samples of the signal."""
    columns = []
    position = all(record.q is not None for record in result.records)
    for record in result.records:
        columns.append((record.t, record.column("q" if position else "v")))
    times = np.concatenate([t for t, _ in columns])
    values = np.concatenate([values for _, values in columns])
    units = result.records[0].units
    label = f"position [{units.position}]" if position else f"velocity [{units.velocity}]"
    order = np.argsort(times, kind="stable")
    return np.interp(result.t, times[order], values[order]), label
