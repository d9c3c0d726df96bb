"""Closed loops of laws and friction FMUs: a mass that follows a reference against friction."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np

from friction_fmus.lawkit.law import Kind, Law
from harness import FmuPart, Part, Result, System

BuildFmu = Callable[..., Path]

#: Of LuGre in the 1995 paper, as the blocks and laws have it.
P95 = {"sigma0": 1e5, "sigma1": 316.22776601683796, "sigma2": 0.4, "Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "delta": 2.0}


def follow(
    build_fmu: BuildFmu,
    controller: str,
    settings: Mapping[str, float],
    *,
    friction: str | None = "LuGre",
    addition: tuple[str, Mapping[str, float]] | None = None,
    reference: Mapping[str, float] | None = None,
    start: Mapping[str, float] | None = None,
    stop: float = 2.0,
    Ts: float = 1e-3,
    inner: int = 10,
    record: Iterable[str] = (),
    others: Iterable[Part] = (),
    wires: Iterable[str] = (),
) -> Result:
    """Run sine reference, controller, an addition to its force, mass and friction.

    ``settings`` and the addition's mapping are the parameters of the laws, ``start`` those of mass and friction; the
    plant is stepped ``inner`` times a sample.
    """
    servo = FmuPart("servo", build_fmu(controller, Ts=Ts), every=inner)
    parts: list[Part] = [
        *(FmuPart("reference", build_fmu("Sine")),),
        servo,
        FmuPart("mass", build_fmu("Mass")),
        *others,
    ]
    values = {f"reference.{name}": value for name, value in (reference or {}).items()}
    values |= {f"servo.{name}": value for name, value in settings.items()} | dict(start or {})
    inputs = {f"servo.{port.name}" for port in servo.inputs}
    lines = ["servo.u -> mass.F_drive"]
    sources = {"r": "reference.r", "rd": "reference.rd", "rdd": "reference.rdd", "x": "mass.x", "v": "mass.v"}
    sources["u_prev"] = "mass.F_ext"
    if addition is not None:
        law, parameters = addition
        extra = FmuPart("addition", build_fmu(law, Ts=Ts), every=inner)
        parts.insert(1, extra)
        inputs |= {f"addition.{port.name}" for port in extra.inputs}
        values |= {f"addition.{name}": value for name, value in parameters.items()}
        lines.append("addition.u -> servo.f")
    if friction is None:
        values["mass.F_friction"] = 0.0
    else:
        contact = FmuPart("friction", build_fmu(friction))
        parts.append(contact)
        lines += ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
        if any(port.name == "F_ext" for port in contact.inputs):
            lines.append("mass.F_ext -> friction.F_ext")
    driven = {line.split(" -> ")[1] for line in [*lines, *wires]}
    lines += [
        f"{sources[name.split('.')[1]]} -> {name}"
        for name in sorted(inputs)
        if name not in driven and name not in values and name.split(".")[1] in sources
    ]
    with System(parts, [*lines, *wires], values) as system:
        return system.run(stop=stop, step=Ts / inner, decimate=inner, record=["*", *record])


def rms_error(result: Result, since: float = 0.0) -> float:
    """Root mean square of reference minus position from a time on [m]."""
    late = result["time"].to_numpy() >= since
    error = result["reference.r"].to_numpy() - result["mass.x"].to_numpy()
    return float(np.sqrt(np.mean(error[late] ** 2)))


def run(law: Law, samples: Iterable[Mapping[str, float]], **values: float) -> list[dict[str, float]]:
    """Outputs and next states of consecutive samples, by casadi; ``values`` are parameters and first states."""
    states = {variable.name: values.pop(variable.name, variable.start) for variable in law.select(Kind.STATE)}
    results: list[dict[str, float]] = []
    for sample in samples:
        results.append(law.evaluate({**values, **states, **sample}))
        states = {name: results[-1][name] for name in states}
    return results
