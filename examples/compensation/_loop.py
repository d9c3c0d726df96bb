"""What the effects share: an axis under position control, 1 kg with LuGre friction, and the look of the figures."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType

from friction_fmus import build
from harness import FmuPart, Part, Result, System

sys.path.append(str(Path(__file__).resolve().parents[1] / "models"))
from _common import BLACK, BLUE, GREEN, GREY, RED, Array, command_line, panels, save

__all__ = ["BLACK", "BLUE", "FC", "FS", "GREEN", "GREY", "OMEGA", "RED", "TS", "VS"]
__all__ += ["Array", "command_line", "panels", "run", "save"]

TS = 0.5e-3
"""Sample time of the controllers, and communication step [s]."""
OMEGA = 2.0 * pi * 15.0
"""Each of the three poles of the loop without friction [rad/s]."""
FC, FS, VS = 1.0, 1.5, 1e-3
"""Coulomb and static friction [N] and Stribeck velocity [m/s] of the start values of LuGre, those of the 1995 paper."""

GAINS: Mapping[str, float] = MappingProxyType({"Kp": 3.0 * OMEGA**2, "Kd": 3.0 * OMEGA, "Ki": OMEGA**3, "m": 1.0})
"""Of the PID: three poles at OMEGA for 1 kg, and feedforward of the inertia."""


def run(
    reference: str,
    axes: Mapping[str, Sequence[str]],
    stop: float,
    start: Mapping[str, float],
    *,
    friction: str | None = "LuGre",
    gains: Mapping[str, float] = GAINS,
    feedforward: bool = False,
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
    feedforward : bool
        Whether the friction of the reference, by StaticFeedforward, is added to the force.

    Returns
    -------
    xarray.Dataset
        ``reference.*``, and for each axis ``mass_x.x``, ``mass_x.v``, ``pid_x.u``, ``friction_x.F``.
    """
    values: dict[str, float] = dict(start)
    wires: list[str] = []
    with TemporaryDirectory() as folder:

        def part(name: str, model: str) -> Part:
            return FmuPart(name, build(model, Path(folder)))

        parts = [part("reference", reference)]
        for axis, (r, rd, rdd) in axes.items():
            mass, pid, static, contact = f"mass_{axis}", f"pid_{axis}", f"static_{axis}", f"friction_{axis}"
            parts += [part(pid, "PID"), part(mass, "Mass")]
            values |= {f"{pid}.{name}": value for name, value in gains.items()} | {f"{pid}.Ts": TS}
            wires += [f"reference.{r} -> {pid}.r", f"reference.{rd} -> {pid}.rd", f"reference.{rdd} -> {pid}.rdd"]
            wires += [f"{mass}.x -> {pid}.x", f"{mass}.v -> {pid}.v", f"{pid}.u -> {mass}.F_drive"]
            if friction:
                parts.append(part(contact, friction))
                wires += [f"{mass}.v -> {contact}.v", f"{contact}.F -> {mass}.F_friction"]
            else:
                values[f"{mass}.F_friction"] = 0.0
            if feedforward:  # it has the force of the inertia, too
                parts.append(part(static, "StaticFeedforward"))
                values |= {f"{static}.Ts": TS, f"{static}.m": gains["m"], f"{pid}.m": 0.0}
                wires += [f"reference.{rd} -> {static}.rd", f"reference.{rdd} -> {static}.rdd"]
                wires.append(f"{static}.u -> {pid}.f")
        with System(parts, wires, values) as system:
            return system.run(stop=round(stop / TS) * TS, step=TS, master="newton")
