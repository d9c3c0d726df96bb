"""Systems with known answers: closed forms, tight solutions by scipy, and references with steps 100 times as short."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from foreign_fmus import in_c
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from friction_fmus import catalogue, fmu
from friction_fmus.cli.inputs import open_system
from harness import FmuPart, Result, SeriesPart, System, Wire
from harness.compiling.toolchain import compiler

EXAMPLES = Path(__file__).parents[2] / "examples"
T = np.linspace(0.0, 2.0, 20001)
FINE = 128
MASSES = ("mass.x", "mass.v", "friction.F")

Exact = Callable[[np.ndarray], Mapping[str, np.ndarray]]


@dataclass(frozen=True)
class Known:
    """A run whose answer is known.

    Parameters
    ----------
    name : str
        Name of the system.
    make : callable
        Returns it.
    stop, step : float
        Of the run [s].
    master : str
        Its master.
    record : tuple of str
        The compared variables.
    fine : int
        Step over that of the reference, which has the master newton.
    exact : callable or None
        The answer over time, instead of the reference.
    """

    name: str
    make: Callable[[], System]
    stop: float
    step: float
    master: str
    record: tuple[str, ...] = MASSES
    fine: int = FINE
    exact: Exact | None = None

    def __str__(self) -> str:
        return f"{self.name}, {self.master}, {self.step:g} s"


def driven(friction: str, size: float = 3.0, delay: int = 0, **start: float) -> System:
    """A mass on friction under a force of two sines."""
    force = size * (np.sin(2.0 * np.pi * 1.5 * T) + 0.3 * np.sin(2.0 * np.pi * 4.1 * T))
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu(friction)), SeriesPart("drive", T, {"F": force})]
    inputs = {port.name for port in parts[1].inputs}
    wires = ["mass.v -> friction.v", Wire("friction.F", "mass.F_friction", delay=delay), "drive.F -> mass.F_drive"]
    wires += ["drive.F -> friction.F_ext"] if "F_ext" in inputs else []
    values = {"friction.Fn": 10.0} if "Fn" in inputs else {}
    return System(parts, wires, values | {name.replace("_", ".", 1): value for name, value in start.items()})


def frictions() -> list[str]:
    """The friction models that turn a velocity into a force."""
    found = []
    for name in catalogue():
        part = FmuPart("one", fmu(name))
        inputs, outputs = ({port.name for port in ports} for ports in (part.inputs, part.outputs))
        if "v" in inputs and "F" in outputs and not part.sampled and inputs <= {"v", "Fn", "F_ext"}:
            found.append(name)
    return found


def sampled(every: int) -> System:
    """An axis under a sampled law, with so many steps for each sample."""
    with open_system(EXAMPLES / "compensated_axis.toml") as system:
        parts = [
            FmuPart(part.name, part.path, every=every if part.sampled else 1)
            for part in system.parts.values()
            if isinstance(part, FmuPart)
        ]
        return System(parts, system.wires, system.start)


def stick_slip() -> System:
    """The stick-slip of the examples."""
    with open_system(EXAMPLES / "stick_slip.toml") as system:
        return System(system.parts.values(), system.wires, system.start)


def free(friction: str, start: Mapping[str, float]) -> System:
    """A mass on friction without a drive force, with the start values of both."""
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu(friction))]
    return System(parts, ["mass.v -> friction.v", "friction.F -> mass.F_friction"], {"mass.F_drive": 0.0} | {**start})


def decay() -> System:
    """Mass on viscous friction."""
    return free("Viscous", {"mass.v0": 1.0, "friction.Fv": 2.0})


def exact_decay(t: np.ndarray) -> Mapping[str, np.ndarray]:
    """With v' = -2 v."""
    v = np.exp(-2.0 * t)
    return {"mass.x": 0.5 * (1.0 - v), "mass.v": v, "friction.F": 2.0 * v}


def damped() -> System:
    """Mass on a spring and on viscous friction."""
    return free("Viscous", {"mass.k": 100.0, "mass.v_support": 0.0, "mass.v0": 1.0, "friction.Fv": 2.0})


def exact_damped(t: np.ndarray) -> Mapping[str, np.ndarray]:
    """With x'' = -2 x' - 100 x."""
    w = np.sqrt(99.0)
    x = np.exp(-t) * np.sin(w * t) / w
    v = np.exp(-t) * (np.cos(w * t) - np.sin(w * t) / w)
    return {"mass.x": x, "mass.v": v, "friction.F": 2.0 * v}


def braked() -> System:
    """Mass on Coulomb friction of 1 N, which stops it after 1 s."""
    return free("Coulomb", {"mass.v0": 1.0, "friction.Fc": 1.0, "friction.F_ext": 0.0})


def exact_braked(t: np.ndarray) -> Mapping[str, np.ndarray]:
    """With v' = -1 until it rests."""
    moving = np.minimum(t, 1.0)
    return {"mass.x": moving - 0.5 * moving**2, "mass.v": 1.0 - moving}


def rock(mass: float) -> System:
    """A light mass on rate-and-state friction, its spring pulled at 10 um/s; it swings many times in a step."""
    start = {"mass.m": mass, "mass.k": 5e3, "mass.v_support": 1e-5, "mass.x_support0": 0.6 / 5e3, "mass.v0": 1e-6}
    names = {"a": 0.005, "b": 0.01, "Dc": 1e-5, "V0": 1e-6, "mu0": 0.6, "theta": 10.0}
    return free("RateAndState", start | {f"friction.{name}": value for name, value in names.items()})


def exact_rock(t: np.ndarray) -> Mapping[str, np.ndarray]:
    """Without the mass: V0 exp((F - mu0 - b ln(V0 theta/Dc))/a) is the velocity."""

    def force(time: np.ndarray | float, x: np.ndarray | float) -> np.ndarray:
        return np.asarray(0.6 + 5e3 * (1e-5 * time - x))

    def rates(time: float, y: np.ndarray) -> list[float]:
        v = 1e-6 * np.exp((force(time, y[0]) - 0.6 - 0.01 * y[1]) / 0.005)
        return [v, 0.1 * np.exp(-y[1]) - v / 1e-5]  # of x and of ln(V0 theta/Dc)

    found = solve_ivp(rates, (0.0, t[-1]), [0.0, 0.0], "LSODA", t, rtol=1e-10, atol=1e-14)
    return {"friction.F": force(t, found.y[0])}


@cache
def foreign() -> Callable[..., Path]:
    """FMUs as other tools export them."""
    return in_c(Path(tempfile.mkdtemp()), compiler())


def prey(states: bool) -> System:
    """The equations of Lotka and Volterra in two FMUs."""
    parts = [FmuPart(name, foreign()(name.upper(), states=states)) for name in ("prey", "predator")]
    return System(parts, ["prey.x -> predator.x", "predator.y -> prey.y"])


def exact_prey(t: np.ndarray) -> Mapping[str, np.ndarray]:
    """By scipy."""

    def rates(_: float, z: np.ndarray) -> list[float]:
        return [z[0] * (1.1 - 0.4 * z[1]), z[1] * (0.1 * z[0] - 0.4)]

    found = solve_ivp(rates, (0.0, t[-1]), (2.0, 1.0), "DOP853", t, rtol=1e-12, atol=1e-12)
    return {"prey.x": found.y[0], "predator.y": found.y[1]}


def control(states: bool) -> System:
    """A PI controller, a lag of first order and a sensor that gives 0.8 of it, each in an FMU."""
    kinds = {"controller": "CONTROLLER", "plant": "PLANT", "sensor": "GAIN"}
    parts = [FmuPart(name, foreign()(kind, states=states)) for name, kind in kinds.items()]
    wires = ["sensor.y -> controller.m", "controller.u -> plant.u", "plant.x -> sensor.u"]
    return System(parts, wires, {"sensor.k": 0.8, "controller.reference": 1.0})


def exact_control(t: np.ndarray) -> Mapping[str, np.ndarray]:
    """With x' = (2 (1 - 0.8 x) + I - x) / 0.5 and I' = 1 - 0.8 x."""
    A = np.array([[-5.2, 2.0, 4.0], [-0.8, 0.0, 1.0], [0.0, 0.0, 0.0]])
    step = expm(A * (t[1] - t[0]))
    rows = [np.array([0.0, 0.0, 1.0])]
    for _ in t[1:]:
        rows.append(step @ rows[-1])
    return {"plant.x": np.array(rows)[:, 0]}


def cases() -> list[Known]:
    """All of them."""
    found = []
    for friction in frictions():
        for master, step in (("newton", 2e-3), ("newton", 5e-4), ("adaptive", 2e-3), ("gauss-seidel", 2e-4)):
            found.append(Known(friction, lambda name=friction: driven(name), 1.0, step, master))
        found.append(Known(f"{friction}, 9 N", lambda name=friction: driven(name, 9.0), 1.0, 1e-3, "newton"))
        found.append(Known(friction, lambda name=friction: driven(name), 0.5, 1e-4, "jacobi"))
    for step in (2e-3, 5e-4, 1e-4):
        found.append(Known("stick-slip", stick_slip, 20.0, step, "newton", fine=100))
    axis = ("axis.x", "axis.v", "friction.F")
    for every in (1, 2, 4, 8):
        for master in ("newton", "gauss-seidel"):
            step = 0.5e-3 / every
            found.append(Known(f"sampled in {every}", lambda n=every: sampled(n), 1.0, step, master, axis))
    for delay in (1, 4):
        for master in ("newton", "gauss-seidel", "jacobi"):
            make = lambda n=delay: driven("LuGre", 9.0, delay=n, friction_sigma0=1e3, friction_sigma1=10.0)  # noqa: E731
            found.append(Known(f"delayed by {delay}", make, 1.0, 4e-4, master))
    closed: list[tuple[str, Callable[[], System], Exact, tuple[str, ...]]] = [
        ("decay", decay, exact_decay, MASSES),
        ("damped", damped, exact_damped, MASSES),
        ("braked", braked, exact_braked, MASSES[:2]),
    ]
    for name, make, exact, record in closed:
        for master in ("newton", "adaptive", "gauss-seidel", "jacobi"):
            for step in (2e-2, 1e-3):
                found.append(Known(name, make, 2.0, step, master, record, exact=exact))
    for mass in (1e-6, 1e-3):
        for master in ("newton", "adaptive"):
            make = lambda m=mass: rock(m)  # noqa: E731
            found.append(Known(f"rock of {mass:g} kg", make, 2.0, 2e-3, master, ("friction.F",), exact=exact_rock))
    for master in ("newton", "adaptive", "gauss-seidel", "jacobi"):
        states = master in ("newton", "adaptive")
        for step in (0.05, 0.01):
            names = ("prey.x", "predator.y")
            make = lambda s=states: prey(s)  # noqa: E731
            found.append(Known("prey", make, 10.0, step, master, names, exact=exact_prey))
            make = lambda s=states: control(s)  # noqa: E731
            found.append(Known("control", make, 8.0, step, master, ("plant.x",), exact=exact_control))
    return found


def reference(case: Known) -> Result:
    """The answer, or the same run with a much shorter step."""
    if case.exact is not None:
        t = np.arange(round(case.stop / case.step) * 20 + 1) * (case.step / 20)
        return xr.Dataset({name: ("time", values) for name, values in case.exact(t).items()}, {"time": t})
    with case.make() as system:
        finer = divided(system, case.fine)
        return finer.run(
            stop=case.stop,
            step=case.step / case.fine,
            master="newton",
            record=case.record,
            loop_tolerance=1e-11,
            step_tolerance=1e-4,
        )


def again(case: Known, factor: int, suggested: Mapping[Hashable, Any]) -> Result:
    """Run the case with its step over `factor`, and with the tolerances that are suggested with it."""
    with case.make() as system:
        return divided(system, factor).run(
            stop=case.stop,
            step=case.step / factor,
            master=case.master,
            record=case.record,
            coupling_tolerance=suggested.get("suggested_coupling_tolerance"),
            step_tolerance=suggested.get("suggested_step_tolerance"),
            accuracy=True,
        )


def divided(system: System, factor: int) -> System:
    """The system for steps so many times as short."""
    for part in system.parts.values():
        part.every *= factor if part.sampled and not isinstance(part, SeriesPart) else 1
    wires = [replace(wire, delay=factor * wire.delay) for wire in system.wires]
    return System(system.parts.values(), wires, system.start)


def true_error(found: Result, right: Result, name: str, late: float) -> np.ndarray:
    """How far each row is from what the reference has within so many seconds."""
    y, expected = (result[name].to_numpy().astype(float) for result in (found, right))
    t, fine = found["time"].to_numpy(), right["time"].to_numpy()
    reach = int(np.ceil(late / (fine[1] - fine[0])))
    rows = np.searchsorted(fine, t - 1e-9 * fine[-1]).clip(max=len(fine) - 1)
    high = maximum_filter1d(expected, 2 * reach + 1, mode="nearest")[rows]
    low = minimum_filter1d(expected, 2 * reach + 1, mode="nearest")[rows]
    return np.maximum(0.0, np.maximum(y - high, low - y))
