"""Helpers of the effects: an axis of 1 kg with LuGre friction under position control, and the style of the figures."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType

import numpy as np
from fmpy import read_model_description

from friction_fmus import build
from harness import FmuPart, Result, System, Wire

sys.path.append(str(Path(__file__).resolve().parents[1] / "models"))
from _common import BLACK, BLUE, GREEN, GREY, RED, Array, panels, save

__all__ = ["BLACK", "BLUE", "FC", "FS", "GREEN", "GREY", "OMEGA", "RED", "TS", "VS"]
__all__ += ["Array", "panels", "rms", "run", "save", "simulate"]

TS = 0.5e-3
"""Sample time of the controllers, and communication step [s]."""
OMEGA = 2.0 * pi * 15.0
"""Each of the three poles of the loop without friction [rad/s]."""
FC, FS, VS = 1.0, 1.5, 1e-3
"""Coulomb and static friction [N] and Stribeck velocity [m/s] of the start values of LuGre, those of the 1995 paper."""

GAINS: Mapping[str, float] = MappingProxyType({"Kp": 3.0 * OMEGA**2, "Kd": 3.0 * OMEGA, "Ki": OMEGA**3, "m": 1.0})
"""Of the PID: three poles at OMEGA for 1 kg, and feedforward of the inertia."""

LOOP_TOLERANCE = 1e-11
"""Of the solved loops: motions that are compared with each other must not differ by where an iteration ends."""


def simulate(
    models: Mapping[str, str],
    wires: Sequence[str | Wire],
    start: Mapping[str, float],
    stop: float,
    *,
    step: float = TS,
    master: str = "newton",
    record: Sequence[str] = ("*",),
) -> Result:
    """Build FMUs, couple them and run.

    Parameters
    ----------
    models : mapping of str to str
        Name of the part -> name of its model, those that are to step first in front.
    wires : sequence of str or Wire
        The connections.
    start : mapping of str to float
        Start values, ``{"mass.x0": 0.01}``.
    stop : float
        End of the run [s], rounded to steps.
    step : float
        Communication step [s].
    master : str
        Who steps when.
    record : sequence of str
        What to record, ``"*"`` for all outputs.

    Returns
    -------
    xarray.Dataset
        One variable for each recorded one, as ``mass.x``, over ``time``.
    """
    with TemporaryDirectory() as folder:
        parts = [FmuPart(name, build(model, Path(folder))) for name, model in models.items()]
        with System(parts, wires, start) as system:
            return system.run(
                stop=round(stop / step) * step,
                step=step,
                master=master,
                record=list(record),
                loop_tolerance=LOOP_TOLERANCE,
            )


def inputs_of(model: str) -> set[str]:
    """Names of the inputs of a block."""
    with TemporaryDirectory() as folder:
        description = read_model_description(build(model, Path(folder)))
    return {variable.name for variable in description.modelVariables if variable.causality == "input"}


def run(
    reference: str,
    axes: Mapping[str, Sequence[str]],
    stop: float,
    start: Mapping[str, float],
    *,
    friction: str | None = "LuGre",
    gains: Mapping[str, float] = GAINS,
    compensator: str | None = None,
    tuned: Mapping[str, float] = MappingProxyType({}),
) -> Result:
    """Axes of 1 kg under a PID, following one reference.

    Parameters
    ----------
    reference : str
        Name of the block that gives it; it is the part ``reference``.
    axes : mapping of str to sequence of str
        For each axis, as "x", the outputs of the reference that are its position, velocity and acceleration.
    stop : float
        End of the run [s], rounded to samples.
    start : mapping of str to float
        Start values, ``{"reference.radius": 0.01, "mass_x.x0": 0.01}``.
    friction : str or None
        Name of the friction model of each axis.
    gains : mapping of str to float
        Parameters of the PID.
    compensator : str or None
        Name of a block whose u is added to the force of the PID, before its limits. Of its inputs r, rd and rdd come
        from the reference, x and v from the mass, u_prev is the force of the sample before.
    tuned : mapping of str to float
        Parameters of the compensator.

    Returns
    -------
    xarray.Dataset
        ``reference.*``, and for each axis ``mass_x.x``, ``mass_x.v``, ``pid_x.u``, ``friction_x.F``,
        ``compensator_x.u``.
    """
    models = {"reference": reference}
    values: dict[str, float] = dict(start)
    wires: list[str | Wire] = []
    for axis, of_reference in axes.items():
        mass, pid, added, contact = f"mass_{axis}", f"pid_{axis}", f"compensator_{axis}", f"friction_{axis}"
        known = {name: f"reference.{port}" for name, port in zip(("r", "rd", "rdd"), of_reference, strict=True)}
        known |= {"x": f"{mass}.x", "v": f"{mass}.v"}
        if compensator:
            models[added] = compensator
            takes = inputs_of(compensator)
            values |= {f"{added}.{name}": value for name, value in tuned.items()} | {f"{added}.Ts": TS}
            wires += [f"{source} -> {added}.{name}" for name, source in known.items() if name in takes]
            wires += [Wire(f"{pid}.u", f"{added}.u_prev", delay=1)] if "u_prev" in takes else []
            wires.append(f"{added}.u -> {pid}.f")
        models |= {pid: "PID", mass: "Mass"}
        values |= {f"{pid}.{name}": value for name, value in gains.items()} | {f"{pid}.Ts": TS}
        wires += [f"{source} -> {pid}.{name}" for name, source in known.items()] + [f"{pid}.u -> {mass}.F_drive"]
        if friction:
            models[contact] = friction
            wires += [f"{mass}.v -> {contact}.v", f"{contact}.F -> {mass}.F_friction"]
        else:
            values[f"{mass}.F_friction"] = 0.0
    return simulate(models, wires, values, stop)


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
