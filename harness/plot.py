"""Plots of results."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from harness.errors import OutputError, UnknownNameError, nearest
from harness.storage.files import atomic_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from harness.result import Result


def label_of(name: str) -> str:
    """Return a name as matplotlib shows it literally: a dollar sign would begin a formula."""
    return name.replace("$", r"\$")


def plot(result: Result, path: str | Path | None = None, names: Sequence[str] = ()) -> Figure:
    """Plot a result over time, with one panel per unit.

    A variable whose error bound is known gets a band of this width.

    Parameters
    ----------
    result : xarray.Dataset
        Result of a run.
    path : path-like, optional
        File for the figure; its suffix selects the format (png, svg, pdf).
    names : sequence of str
        Variables to plot; all if empty.

    Returns
    -------
    matplotlib.figure.Figure
        The figure, which a notebook shows.

    Raises
    ------
    UnknownNameError
        If a variable was not recorded.
    OutputError
        If there is nothing to plot, the format is unknown, or the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    known = [str(name) for name in result.data_vars]
    for name in names:
        if name not in known:
            raise UnknownNameError(f"'{name}' was not recorded: {nearest(name, known)}")
    panels: dict[str, list[str]] = {}
    bounds = {str(result[name].attrs.get("ancillary_variables", "")) for name in known}
    for name in names or [name for name in known if name not in bounds]:
        panels.setdefault(str(result[name].attrs.get("units", "1")), []).append(name)
    if not panels:
        raise OutputError(f"there is nothing to plot{f' in {path}' if path else ''}: record at least one variable")

    class Shown(Figure):
        def _repr_png_(self) -> bytes:
            self.savefig(content := io.BytesIO())
            return content.getvalue()

    figure = Shown(figsize=(8.0, 1.0 + 2.0 * len(panels)), dpi=120, layout="constrained")
    formats = sorted(FigureCanvasAgg(figure).get_supported_filetypes())
    if path is not None and Path(path).suffix[1:].lower() not in formats:
        raise OutputError(f"cannot plot to {path}: the suffix must be one of {', '.join(formats)}")
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    time = result["time"].to_numpy()
    for axis, (unit, members) in zip(axes, panels.items(), strict=True):
        lines: list[Line2D] = []
        for name in members:
            values = result[name].to_numpy()
            lines += axis.plot(time, values, label=label_of(name), linewidth=1.0)
            bound = result[name].attrs.get("ancillary_variables")
            if bound in known:
                error = result[bound].where(result[bound] < math.inf).to_numpy()
                band = {"color": lines[-1].get_color(), "alpha": 0.25, "linewidth": 0.0}
                axis.fill_between(time, values - error, values + error, **band)
        axis.set_ylabel(label_of(f"{members[0]} [{unit}]" if len(members) == 1 else f"[{unit}]"))
        axis.grid(alpha=0.3)
        if len(members) > 1:
            axis.legend(handles=lines, loc="upper right", fontsize="small")  # also of names that begin with _
    axes[-1].set_xlabel("time [s]")
    if path is not None:
        with atomic_path(Path(path)) as temporary:
            figure.savefig(temporary, dpi=120)
    return figure
