"""An axis of 1 kg with friction under any controller: what the effects of complete control laws share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType

from _loop import TS, rms
from friction_fmus import build
from harness import FmuPart, Part, Result, System, Wire

NOTHING: Mapping[str, float] = MappingProxyType({})


def sines(*of: tuple[float, float, float]) -> dict[str, float]:
    """Parameters of the reference: amplitude [m], frequency [Hz] and phase [rad] of up to four sines."""
    names = ("amplitude", "frequency", "phase")
    return {f"{name}[{i}]": value for i, each in enumerate(of, 1) for name, value in zip(names, each, strict=True)}


def follow(
    controller: str | Part,
    settings: Mapping[str, float],
    reference: Mapping[str, float],
    stop: float,
    *,
    source: str = "Sine",
    addition: tuple[str, Mapping[str, float]] | None = None,
    friction: str | None = "LuGre",
    start: Mapping[str, float] = NOTHING,
    others: Sequence[Part] = (),
    wires: Sequence[str] = (),
    Ts: float = TS,
    inner: int = 1,
    record: Sequence[str] = ("*",),
) -> Result:
    """Run a controller, a mass of 1 kg and its friction along a reference.

    Parameters
    ----------
    controller : str or Part
        The part ``servo``: name of a block, or a part of that name. Of its inputs r, rd and rdd come from the
        reference, x and v from the mass, u_prev is the force of the sample before.
    settings : mapping of str to float
        Parameters of the controller.
    reference : mapping of str to float
        Parameters of the reference.
    stop : float
        End of the run [s], rounded to samples.
    source : str
        Name of the block that gives the reference.
    addition : tuple or None
        Name and parameters of a block, the part ``addition``, whose u goes to the input f of the controller.
    friction : str or None
        Name of the friction model.
    start : mapping of str to float
        Start values of mass and friction, ``{"mass.x0": 0.01}``.
    others, wires : sequences
        Further parts and wires.
    Ts : float
        Sample time [s].
    inner : int
        Communication steps in a sample.
    record : sequence of str
        What to record, ``"*"`` for all outputs.

    Returns
    -------
    xarray.Dataset
        ``reference.*``, ``servo.*``, ``addition.*``, ``mass.*``, ``friction.F`` at the samples.
    """
    values = {f"reference.{name}": value for name, value in reference.items()} | dict(start)
    lines: list[str | Wire] = ["servo.u -> mass.F_drive", *wires]
    with TemporaryDirectory() as folder:

        def block(name: str, model: str, parameters: Mapping[str, float], every: int = 1) -> FmuPart:
            values.update({f"{name}.{parameter}": value for parameter, value in parameters.items()})
            return FmuPart(name, build(model, Path(folder)), every=every)

        sampled: list[Part] = []
        if addition:
            sampled.append(block("addition", *addition, every=inner))
            lines.append("addition.u -> servo.f")
        sampled.append(block("servo", controller, settings, inner) if isinstance(controller, str) else controller)
        for part in sampled:
            known = {"x": "mass.x", "v": "mass.v", **{name: f"reference.{name}" for name in ("r", "rd", "rdd")}}
            taken = {port.name for port in part.inputs}
            lines += [f"{source} -> {part.name}.{name}" for name, source in known.items() if name in taken]
            lines += [Wire("servo.u", f"{part.name}.u_prev", delay=inner)] if "u_prev" in taken else []
            if isinstance(part, FmuPart):
                values[f"{part.name}.Ts"] = Ts
        parts = [block("reference", source, {}), *sampled, *others, block("mass", "Mass", {})]
        if friction:
            parts.append(block("friction", friction, {}))
            lines += ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
        else:
            values["mass.F_friction"] = 0.0
        with System(parts, lines, values) as system:
            return system.run(
                stop=round(stop / Ts) * Ts, step=Ts / inner, decimate=inner, master="newton", record=list(record)
            )


def error(result: Result, since: float, until: float = inf) -> float:
    """Root mean square of reference minus position from a time until before another one [m]."""
    t = result["time"].to_numpy() + 1e-9
    return rms((result["reference.r"] - result["mass.x"]).to_numpy()[(t >= since) & (t < until)])
