"""Helpers of the scripts: a friction FMU driven along a path or carrying a mass, and the style of the figures."""

from __future__ import annotations

import argparse
import io
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from friction_fmus import build
from harness import CallablePart, FmuPart, Part, Port, Result, SeriesPart, System

Array = NDArray[np.float64]

#: Colours that differ in lightness as well (after M. Okabe, K. Ito, 2008).
BLUE, RED, GREEN, BLACK, GREY = "#0072B2", "#D55E00", "#009E73", "#222222", "#999999"


def along(
    model: str,
    path: ArrayLike,
    step: float,
    parameters: Mapping[str, float] | None = None,
    record: Iterable[str] = (),
) -> Result:
    """Drive a friction FMU along a path, at constant velocity from point to point.

    Parameters
    ----------
    model : str
        Name of the friction model.
    path : array_like, shape (n,)
        Positions [m] at the times 0, step, 2 step, ...
    step : float
        Communication step [s].
    parameters : mapping of str to float, optional
        Start values of the FMU.
    record : iterable of str
        What to record of the FMU beside its outputs.

    Returns
    -------
    xarray.Dataset
        ``path.x``, ``path.v`` (the velocity of the step that ends there), ``friction.F`` and what else was asked for.
    """
    x = np.asarray(path, dtype=np.float64)
    v = np.diff(x, prepend=x[0]) / step
    times = step * np.arange(x.size)
    motion = SeriesPart("path", times, {"x": x, "v": v}, {"x": "m", "v": "m/s"}, interpolation="previous")
    return _run(model, [motion], ["path.v -> friction.v"], times[-1], step, record, parameters or {})


def with_mass(
    model: str,
    stop: float,
    step: float,
    parameters: Mapping[str, float] | None = None,
    *,
    push: Callable[[float], float] | None = None,
    mass: Mapping[str, float] | None = None,
) -> Result:
    """Couple a friction FMU with the Mass FMU.

    Parameters
    ----------
    model : str
        Name of the friction model.
    stop, step : float
        End of the run and communication step [s].
    parameters : mapping of str to float, optional
        Start values of the friction FMU.
    push : callable or None
        Driving force [N] of the time [s].
    mass : mapping of str to float, optional
        Start values of the Mass FMU.

    Returns
    -------
    xarray.Dataset
        The outputs ``mass.x``, ``mass.v``, ``mass.x_support``, ``friction.F``, ...
    """
    drive = CallablePart("drive", lambda t, u, x: push(t) if push else 0.0, outputs=[Port("F", "N")])
    wires = ["drive.F -> mass.F_drive", "mass.v -> friction.v", "friction.F -> mass.F_friction"]
    with TemporaryDirectory() as folder:
        parts = [drive, FmuPart("mass", build("Mass", Path(folder)))]
        start = {f"mass.{name}": value for name, value in (mass or {}).items()}
        return _run(model, parts, wires, stop, step, (), parameters or {}, start)


def _run(
    model: str,
    others: list[Part],
    wires: list[str],
    stop: float,
    step: float,
    record: Iterable[str],
    parameters: Mapping[str, float],
    start: Mapping[str, float] | None = None,
) -> Result:
    values = {**(start or {}), **{f"friction.{name}": value for name, value in parameters.items()}}
    with (
        TemporaryDirectory() as folder,
        System([*others, FmuPart("friction", build(model, Path(folder)))], wires, values) as system,
    ):
        recorded = ["*", *(f"friction.{name}" for name in record)]
        # motion first, also for a model whose force does not depend on the velocity at once
        return system.run(stop=stop, step=step, record=recorded, order=list(system.parts))


def polyline(corners: ArrayLike, speed: float, step: float) -> Array:
    """Positions [m] at every step [s] on the way from corner to corner at constant speed [m/s].

    The legs must be whole numbers of steps, so that each reversal is a point of the path.
    """
    corners = np.asarray(corners, dtype=np.float64)
    legs = np.abs(np.diff(corners)) / (speed * step)
    assert np.allclose(legs, np.round(legs), atol=1e-6), "a corner would be cut"
    at = np.concatenate([[0.0], np.cumsum(np.round(legs))])
    return np.asarray(np.interp(np.arange(at[-1] + 1.0), at, corners))


def panels(title: str, rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """A figure under a title that states the claim, and its axes."""
    figure = Figure(figsize=size, dpi=110, layout="constrained")
    figure.suptitle(title, fontsize=12, fontweight="bold")
    axes = list(figure.subplots(rows, columns, squeeze=False).flat)
    for each in axes:
        each.grid(True, color="#dddddd", lw=0.6)
        each.set_axisbelow(True)
        each.tick_params(labelsize=9)
        for side in ("top", "right"):
            each.spines[side].set_visible(False)
    return figure, axes


def save(figure: Figure, script: str, folder: Path) -> None:
    """Write the figure of a script, NAME.png, into a folder."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    few_colours = Image.open(buffer).convert("RGB").quantize(64)
    folder.mkdir(parents=True, exist_ok=True)
    few_colours.save(folder / f"{Path(script).stem}.png", optimize=True)


def command_line(main: Callable[[Path], str]) -> None:
    """Run a claim from the command line: the figure goes to the folder that is given, the numbers are printed."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", nargs="?", type=Path, default=Path(), help="where the figure is written")
    print(main(parser.parse_args().folder))
