"""Random masses, stiffnesses, loads and steps on every friction model: is a run ever wrong without a word?

    python tests/robustness/coupling_search.py 500
    python tests/robustness/coupling_search.py 60 --accuracy
    python tests/robustness/coupling_search.py 60 --load drive

A mass on a spring and a damper, on rigid friction (one half) or on a contact with states, is moved by its support and
by steps of a force, on and off the communication grid. The references are not from the library: event-driven closed
forms for rigid friction, solvers of SciPy with the equations of the papers for the others. A run may be early or late
by two steps and one per cent of the time so far. It is right if x is then off by less than 2 % of its range in all
rows (1 % with --accuracy, as required there), and v and F in 97 % of them. The range of v includes its means between
the points of the reference. A step of a force between two communication points may act at either of them. A system is
not counted if its answer changes by as much where friction is 0.3 % lower, or if its reference takes too long; if it
does so where forces act at communication points, both answers count. Before a run is called wrong, two more
references with smaller tolerances confirm the first one. With --load drive, friction reads the applied force only, and
not those of the spring and the damper.
"""

from __future__ import annotations

import argparse
import logging
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from math import exp, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from accuracy import state_models as states
from accuracy.event_driven import Band, Contact, Phase, Pulled, TooLongError
from exchange.reference import Leuven, Slip

from friction_fmus import fmu
from harness import FmuPart, HarnessError, SeriesPart, System

RIGID = ("Coulomb", "Stiction", "Stribeck", "Tustin", "Karnopp", "DeadZoneTorque", "Viscous")
SMOOTH = ("LuGre", "ElastoPlastic", "Dahl", "BlimanSorine", "LoadDependentDahl", "RateAndState")
MODAL = ("GMS", "MaxwellSlip", "ResetIntegrator", "SevenParameter", "Leuven", "Bristle")
MASTERS = ("newton", "adaptive", "gauss-seidel", "jacobi")
STEPS = (1e-4, 1e-3, 1e-2)
RATIOS = (1.0, 0.79, 3.7, 0.31, 2.5)
"""Of the communication step of a composite to its inner step."""
OFF, REQUIRED, ROWS, DRIFT = 0.02, 0.01, 0.03, 0.01
FINER, FINEST, PERIOD = 20, 400, 8  # points of a reference in each step, and in each period of the mass on its spring
VARIABLES = {"x": "mass.x", "v": "mass.v", "F": "friction.F"}
SENSITIVE = 0.003
FAILURES = (TooLongError, OverflowError, ValueError, RuntimeError)
Answer = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Case:
    """A system, how it is run, and its reference."""

    model: str
    mass: Mapping[str, float]
    contact: Mapping[str, float]
    phases: Sequence[Phase]
    step: float
    ticks: int
    ratio: float
    through_sum: bool
    solve: Callable[[Sequence[Phase], float, np.ndarray, int], dict[str, np.ndarray]]
    """The answer for loads and a factor of all friction, at these times, with tolerances as of `Carried`."""
    load: str = "mass"
    """Where F_ext comes from: all other forces from the mass, or the applied one from the drive."""

    @property
    def stop(self) -> float:
        """The end of the run [s]."""
        return self.ticks * self.step

    @cached_property
    def finer(self) -> int:
        """The points of the reference in each step."""
        turns = self.step * sqrt(self.mass["k"] / self.mass["m"]) / (2.0 * pi)
        return min(FINEST, max(FINER, int(PERIOD * turns) + 1))

    @cached_property
    def fine(self) -> np.ndarray:
        """The times of the reference, beyond the end as far as a run may be early."""
        beyond = 1 + int(2.0 * max(1.0, self.ratio) + DRIFT * self.ticks)
        return np.arange(self.finer * (self.ticks + beyond) + 1) * (self.step / self.finer)

    @property
    def start(self) -> dict[str, float]:
        """The start values."""
        parts = {"mass": self.mass, "friction": self.contact}
        return {f"{part}.{name}": value for part, values in parts.items() for name, value in values.items()}

    def drive(self) -> SeriesPart:
        """The applied force."""
        times = [phase.begin for phase in self.phases]
        force = [phase.force for phase in self.phases]
        return SeriesPart("drive", times, {"F": force}, {"F": "N"}, interpolation="previous", beyond="hold")

    def parts(self) -> tuple[list[FmuPart], list[str]]:
        """The mass on its contact, without the applied force and, if the load is that, without F_ext."""
        parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu(self.model))]
        wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
        if self.reads_load and self.load == "mass":
            if self.through_sum:
                parts.append(FmuPart("sum", fmu("Sum")))
                wires += ["mass.F_ext -> sum.u1", "sum.y -> friction.F_ext"]
            else:
                wires.append("mass.F_ext -> friction.F_ext")
        return parts, wires

    @property
    def reads_load(self) -> bool:
        """Whether the friction model has an input for the other forces."""
        return self.model in RIGID and self.model != "Viscous"

    @property
    def driven(self) -> list[str]:
        """The inputs that the applied force is connected to."""
        return ["mass.F_drive", *(["friction.F_ext"] if self.reads_load and self.load == "drive" else [])]

    def coupled(self) -> System:
        """The system for the masters."""
        parts, wires = self.parts()
        wires += [f"drive.F -> {name}" for name in self.driven]
        return System([*parts, self.drive()], wires, self.start)

    def composed(self, made: Composites) -> System:
        """The system as one FMU under its applied force."""
        start = {f"one.{name}": value for name, value in self.start.items()}
        wires = [f"drive.F -> one.{name}" for name in self.driven]
        return System([FmuPart("one", made.of(self)), self.drive()], wires, start)


@dataclass
class Composites:
    """FMUs of systems, each built once for all parameters."""

    folder: Path
    made: dict[tuple[object, ...], Path] = field(default_factory=dict)

    def of(self, case: Case) -> Path:
        """Return the FMU of a case."""
        parts, wires = case.parts()
        key = (case.model, case.step, len(parts), len(wires))
        if key not in self.made:
            path = self.folder / f"Composite{len(self.made)}.fmu"
            with System(parts, wires, dict.fromkeys(case.driven, 0.0)) as system:
                system.to_fmu(path, step=case.step, inputs=case.driven)
            self.made[key] = path
        return self.made[key]


class Warned(logging.Handler):
    """Keeps the warnings of the harness."""

    def __init__(self) -> None:
        """Begin with none."""
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep one."""
        self.texts.append(record.getMessage())

    def __enter__(self) -> Warned:
        """Listen."""
        logging.getLogger("harness").addHandler(self)
        return self

    def __exit__(self, *_: object) -> None:
        """Listen no more."""
        logging.getLogger("harness").removeHandler(self)


# ---- systems ---------------------------------------------------------------------------------------------------


def draw(seed: int) -> Case:
    """Make the system of a seed: even ones have rigid friction."""
    rng = np.random.default_rng(seed)
    others = SMOOTH + MODAL
    model = RIGID[seed // 2 % len(RIGID)] if seed % 2 == 0 else others[seed // 2 % len(others)]
    step, ticks = float(rng.choice(STEPS)), int(rng.integers(100, 300))
    T, level = step * ticks, log(rng, -1, 1)
    m = log(rng, -6, 3)
    stiffness = log(rng, 0, 9)
    k = 0.0 if rng.random() < 0.15 else min(1e9, level * log(rng, -0.7, 1.0) / (T * log(rng, -6, 0)))
    k = stiffness if k > 0.0 and rng.random() < 0.3 else k
    d = log(rng, -2, 0.7) * sqrt(k * m) if rng.random() < 0.4 else 0.0
    speed = level * log(rng, -0.7, 1.0) / (k * T) if k > 0.0 else 0.0
    begins = sorted(rng.uniform(0.05, 0.9, rng.integers(1, 4)) * ticks) if k == 0.0 or rng.random() < 0.6 else []
    on_grid = rng.random() < 0.5
    begins = [float(round(begin) if on_grid else begin) * step for begin in begins]
    phases = [Phase(0.0, 0.0, speed)]
    phases += [Phase(begin, float(rng.uniform(-3, 3)) * level, speed) for begin in begins]
    v0 = level / sqrt(k * m) * log(rng, -1, 0.5) if k > 0.0 else level * T / m * log(rng, -1, 0.0)
    v0 = v0 if rng.random() < 0.25 else 0.0
    mass = {"m": m, "k": k, "d": d, "v_support": speed, "v0": v0}
    make = rigid if seed % 2 == 0 else stateful
    contact, solve = make(rng, model, level, mass, T)
    return Case(model, mass, contact, phases, step, ticks, float(rng.choice(RATIOS)), rng.random() < 0.2, solve)


def log(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform."""
    return float(10.0 ** rng.uniform(low, high))


Made = tuple[dict[str, float], Callable[[Sequence[Phase], float, np.ndarray, int], dict[str, np.ndarray]]]


def rigid(rng: np.random.Generator, model: str, level: float, mass: Mapping[str, float], T: float) -> Made:
    """Parameters and reference of a model that jumps at v = 0."""
    Fc, Fs = level, level * (1.0 if rng.random() < 0.2 else rng.uniform(1.0, 2.0))
    moved = max(mass["v_support"], mass["v0"], level * T / mass["m"] * 1e-3, 1e-9)
    Fv = 0.0 if rng.random() < 0.5 else level * log(rng, -2, 1) / moved
    vs = log(rng, -5, -1)
    curve = None
    contact = {"Fc": Fc, "Fs": Fs, "Fv": Fv}
    if model == "Viscous":
        Fc, Fs, Fv = 0.0, 0.0, level * log(rng, -2, 1) / moved
        contact = {"Fv": Fv}
    elif model == "Coulomb":
        Fs, Fv, contact = Fc, 0.0, {"Fc": Fc}
    elif model == "Karnopp":
        contact["DV"] = 0.0
    elif model == "DeadZoneTorque":
        contact = {"Fc": Fc, "T_dz": Fs, "Fv": Fv, "DV": 0.0}
    elif model in ("Stribeck", "Tustin") and Fs > Fc:
        contact["vs"] = vs
        delta = 1.0 if model == "Tustin" else float(rng.choice([1.0, 2.0]))
        curve = lambda v: Fc + (Fs - Fc) * exp(-min((v / vs) ** delta, 700.0))  # noqa: E731
        if model == "Stribeck":
            contact["delta"] = delta

    def solve(phases: Sequence[Phase], factor: float, t: np.ndarray, _strict: int) -> dict[str, np.ndarray]:
        law = Contact(Fc, Fs, Fv, curve).scaled(factor)
        found = Pulled(law, mass["m"], mass["k"], mass["d"], v0=mass["v0"], phases=phases).run(t)
        rows = np.searchsorted(t, found["away"]).clip(0, len(t) - 1)
        found["F"][rows] = found["F_away"]  # at v = 0, before the force falls along the Stribeck curve
        return found

    return contact, solve


def stateful(rng: np.random.Generator, model: str, level: float, mass: dict[str, float], T: float) -> Made:
    """Parameters and reference of a model with states."""
    Fc, Fs, vs = level, level * rng.uniform(1.0, 2.0), log(rng, -4, -1)
    reach = log(rng, -7, -3.5)  # m, of the deflections
    stiffness = min(level / reach, 1e9)
    reach, m = level / stiffness, mass["m"]
    sigma1 = 2.0 * sqrt(stiffness * m) * log(rng, -1.5, 0.5)
    if model in ("Dahl", "GMS", "MaxwellSlip", "Bristle", "SevenParameter") and rng.random() < 0.8:
        mass["d"] = 2.0 * sqrt((stiffness + mass["k"]) * m) * log(rng, -1, 0)  # these let a mass on them swing
    moved = max(mass["v_support"], mass["v0"], level * T / m * 1e-3, 1e-9)
    sigma2 = 0.0 if rng.random() < 0.4 else level * log(rng, -2, 0.5) / moved
    mean = dict(zip(("k", "share"), _elements(rng, 3), strict=True))
    curve = states.stribeck(Fc, Fs, vs)
    slopes = {"sigma0": stiffness, "sigma1": sigma1, "sigma2": sigma2, "Fc": Fc, "Fs": Fs, "vs": vs}
    q0: list[float] = [0.0]
    sizes = [reach]
    scaled = Callable[[float], Any]
    contact: dict[str, float]
    make: scaled
    if model == "LuGre":
        contact = slopes
        make = lambda f: states.lugre(f * stiffness, f * sigma1, f * sigma2, lambda v: f * curve(v))  # noqa: E731
    elif model == "ElastoPlastic":
        z_ba = reach * rng.uniform(0.3, 0.9)
        contact = slopes | {"z_ba": z_ba}
        make = lambda f: states.elasto_plastic(  # noqa: E731
            f * stiffness, f * sigma1, f * sigma2, z_ba, lambda v: f * curve(v)
        )
    elif model == "Dahl":
        n = float(rng.choice([1.0, 1.5, 2.0]))
        contact = {"sigma": stiffness, "Fc": Fc, "n": n}
        make = lambda f: states.dahl(f * stiffness, f * Fc, n)  # noqa: E731
    elif model == "BlimanSorine":
        eta = log(rng, -1.3, -0.3)
        contact = {"f1": 1.8 * Fc, "f2": 0.8 * Fc, "eta": eta, "eps": reach}
        q0, sizes = [0.0, 0.0], [level, level]
        make = lambda f: states.bliman_sorine(1.8 * f * Fc, 0.8 * f * Fc, eta, reach)  # noqa: E731
    elif model == "LoadDependentDahl":
        mu, part = log(rng, -1.3, -0.3), float(rng.uniform(-1, 1))
        load = level / mu
        contact = {"mu_avg": mu, "mu_dif": part * mu, "eps": reach, "Fv": sigma2, "F_t": load}
        sizes = [1.0]
        make = lambda f: states.load_dependent(f * mu, f * part * mu, reach, f * sigma2, load)  # noqa: E731
    elif model == "RateAndState":
        a = log(rng, -2.3, -1.3)
        b, V0 = a * rng.uniform(0.5, 2.0), log(rng, -6, -4)
        contact = {"mu0": level, "a": a * level, "b": b * level, "Dc": 10 * reach, "V0": V0, "theta": 10 * reach / V0}
        sizes = [1.0]
        make = lambda f: states.rate_and_state(  # noqa: E731
            f * level, f * a * level, f * b * level, 10 * reach, V0
        )
    elif model == "GMS":
        C = level * log(rng, 0, 3)
        k = [stiffness * one for one in mean["k"]]
        contact = {"N": 3.0, "C": C, "sigma2": sigma2, "sigma": 0.0, "Fc": Fc, "Fs": Fs, "vs": vs}
        contact |= {f"k[{i + 1}]": one for i, one in enumerate(k)}
        contact |= {f"alpha[{i + 1}]": one for i, one in enumerate(mean["share"])}
        q0, sizes = [0.0] * 3, [level] * 3
        make = lambda f: _viscous(  # noqa: E731
            Slip([f * one for one in k], mean["share"], f * C, 0.0, curve=lambda v: f * curve(v)), f * sigma2
        )
    elif model == "MaxwellSlip":
        k = [stiffness * one for one in mean["k"]]
        contact = {"N": 3.0} | {f"k[{i + 1}]": one for i, one in enumerate(k)}
        contact |= {f"W[{i + 1}]": level * one for i, one in enumerate(mean["share"])}
        q0, sizes = [0.0] * 3, [level] * 3
        make = lambda f: Slip([f * one for one in k], mean["share"], 0.0, 0.0, curve=lambda _: f * level)  # noqa: E731
    elif model == "Bristle":
        contact = {"N": 4.0, "sigma0": stiffness / 4.0, "delta_s": reach, "Delta": 0.0}
        sizes = [level]
        make = lambda f: Slip([f * stiffness], [1.0], 0.0, 0.0, curve=lambda _: f * level)  # noqa: E731
    elif model == "ResetIntegrator":
        a = float(rng.uniform(0.0, 1.0))
        contact = {"sigma0": stiffness, "z0": reach, "a": a, "beta": sigma1}
        make = lambda f: states.Reset(f * stiffness, reach, a, f * sigma1)  # noqa: E731
    elif model == "SevenParameter":
        gamma, first, longest = T * log(rng, -1, 1), level * rng.uniform(0, 0.5), level * rng.uniform(0.5, 1.0)
        contact = {"kt": stiffness, "Fc": Fc, "Fv": sigma2, "Fs_a": first, "Fs_inf": longest, "vs": vs}
        contact |= {"tauL": 0.0, "gamma": gamma}
        q0, sizes = [0.0, 0.0], [reach, T]
        make = lambda f: states.Seven(  # noqa: E731
            f * stiffness, f * Fc, f * sigma2, f * first, f * longest, vs, gamma
        )
    else:
        A, n = 2.5 * Fs, float(rng.choice([1.0, 2.0]))
        contact = {name: slopes[name] for name in ("sigma1", "sigma2", "Fc", "Fs", "vs")}
        contact |= {"A": A, "zc": A / stiffness, "n": n}
        make = lambda f: _viscous(  # noqa: E731
            Leuven(f * A, A / stiffness, n, f * sigma1, level=lambda v: f * curve(v)), f * sigma2
        )
    speed = max(mass["v_support"], mass["v0"], level / sqrt(stiffness * m))
    way = 1.0 if mass["v_support"] > 0.0 or mass["v0"] > 0.0 else -1.0

    def solve(phases: Sequence[Phase], factor: float, t: np.ndarray, strict: int) -> dict[str, np.ndarray]:
        def fresh() -> Any:
            one = make(factor)
            if hasattr(one, "side") and model in ("GMS", "MaxwellSlip", "Bristle", "Leuven"):
                first = next((phase.force for phase in phases if phase.force), way)
                one.side = 1.0 if (mass["v_support"] or mass["v0"] or first) > 0.0 else -1.0
            return one

        sizes_of = [speed * T, speed, *sizes]
        return states.Carried(fresh, q0, m, mass["k"], mass["d"], mass["v0"], phases, sizes_of, strict).run(t)

    return contact, solve


def _elements(rng: np.random.Generator, n: int) -> tuple[list[float], list[float]]:
    k, share = rng.uniform(0.2, 1.0, n), rng.uniform(0.2, 1.0, n)
    return list(map(float, k / k.sum())), list(map(float, share / share.sum()))


def _viscous(contact: Any, Fv: float) -> Any:
    """Add viscous friction to a contact."""
    plain = contact.rates

    def rates(v: float, q: Any) -> tuple[Sequence[float], float]:
        found, F = plain(v, q)
        return found, F + Fv * v

    contact.rates = rates
    return contact


# ---- verdicts --------------------------------------------------------------------------------------------------


class References:
    """The answers that count as right; none if the system is not fit to judge by."""

    def __init__(self, case: Case, most: float = OFF) -> None:
        """Solve for the load as it is, and with friction a little lower; `most`: how far values may be off."""
        self.case, self.most, self.found = case, most, []
        self._shifted: dict[float, list[Answer]] = {}
        self._strict, self._confirmed = 0, False
        try:
            right, other = (case.solve(case.phases, factor, case.fine, 0) for factor in (1.0, 1.0 - SENSITIVE))
        except FAILURES:
            return
        run = slice(case.finer * case.ticks + 1)
        if fits(case, case.fine[run], {name: other[name][run] for name in VARIABLES}, right, 2.0 * case.step, most):
            self.found = [right]

    def have(self, t: np.ndarray, values: Answer, step: float) -> bool:
        """Return whether the values are those of an answer; before they are wrong, the answer is confirmed."""
        if self._has(t, values, step) or self._confirmed:
            return self._has(t, values, step)
        self._confirm()
        return bool(self.found) and self._has(t, values, step)

    def _confirm(self) -> None:
        """Solve twice more, with smaller tolerances: answers that agree replace the first one if it differs.

        In long vibrations errors add up, and the end of a mode may be missed.
        """
        case, self._confirmed = self.case, True
        run = slice(case.finer * case.ticks + 1)

        def agree(one: Answer, other: Answer) -> bool:
            pairs = ((one, other), (other, one))
            return all(
                fits(case, case.fine[run], {name: a[name][run] for name in VARIABLES}, b, 2.0 * case.step, self.most)
                for a, b in pairs
            )

        try:
            finer, finest = (case.solve(case.phases, 1.0, case.fine, strict) for strict in (1, 2))
        except FAILURES:
            self.found = []
            return
        if not agree(finer, finest):
            self.found = []
        elif not agree(self.found[0], finest):
            self.found, self._strict, self._shifted = [finest], 2, {}

    def _has(self, t: np.ndarray, values: Answer, step: float) -> bool:
        """Return whether the values are those of an answer, also one with its load at communication points."""
        reach = 2.0 * max(step, self.case.step)
        if fits(self.case, t, values, self.found[0], reach, self.most):
            return True
        if step not in self._shifted:
            self._shifted[step] = list(self._at_communication_points(step))
        return any(fits(self.case, t, values, right, reach, self.most) for right in self._shifted[step])

    def _at_communication_points(self, step: float) -> Iterator[Answer]:
        case = self.case
        for side in (np.floor, np.ceil):
            phases = [replace(p, begin=step * float(side(round(p.begin / step, 6)))) for p in case.phases]
            moves = any(abs(a.begin - b.begin) > 1e-3 * step for a, b in zip(phases, case.phases, strict=True))
            for factor in (1.0, 1.0 - SENSITIVE) if moves else ():
                if all(a.begin < b.begin for a, b in pairwise(phases)):
                    with suppress(*FAILURES):
                        yield case.solve(phases, factor, case.fine, self._strict)


def off(case: Case, t: np.ndarray, values: Answer, right: Answer, reach: float) -> dict[str, np.ndarray]:
    """Return how far each row is off over the range of its variable."""
    force = max(abs(phase.force) for phase in case.phases) / case.mass["k"] if case.mass["k"] else 0.0
    free = case.mass["v_support"] * case.stop + force  # motion without friction
    found = {}
    for name in VARIABLES:
        size = max(float(np.ptp(right[name][: case.finer * case.ticks + 1])), 0.05 * free if name == "x" else 0.0)
        size = max(size, 1e-12 * float(np.abs(right[name]).max()), 1e-300)
        if name == "v":
            means = np.diff(right["x"][: case.finer * case.ticks + 1]) * (case.finer / case.step)
            size = max(size, float(np.ptp(means)), 1e-6 * case.mass["v_support"])
        found[name] = Band(case.fine, right[name]).outside(t, values[name], reach + DRIFT * t) / size
    return found


def fits(case: Case, t: np.ndarray, values: Answer, right: Answer, reach: float, most: float) -> bool:
    """Return whether the values are those of the answer."""
    error = off(case, t, values, right, reach)
    rows = {name: float((~(error[name] <= most)).mean()) for name in VARIABLES}
    return rows["x"] == 0.0 and max(rows["v"], rows["F"]) <= ROWS


def judge(case: Case, answers: References, run: str, made: Composites, accuracy: bool = False) -> str:
    """Return the verdict on a master or on the composite."""
    composite = run == "composite"
    step = case.step * case.ratio if composite else case.step
    ticks = int(case.stop / step + 1e-9)
    prefix = "one." if composite else ""
    settings: dict[str, Any] = {"stop": ticks * step, "step": step, "master": "gauss-seidel" if composite else run}
    settings["record"] = [prefix + name for name in VARIABLES.values()]
    with Warned() as warned:
        try:
            with case.composed(made) if composite else case.coupled() as system:
                result = system.run(**settings, accuracy=accuracy)
        except HarnessError:
            return "refused"
    t = np.minimum(result["time"].to_numpy(), case.stop)
    values = {name: result[prefix + full].to_numpy() for name, full in VARIABLES.items()}
    right = answers.have(t, values, step)
    if not answers.found:
        return "no reference"
    if accuracy:
        return f"{'right' if right else 'wrong'}, called {result.attrs['accuracy']}"
    if right:
        return "false alarm" if warned.texts else "right"
    return "warned" if warned.texts else "WRONG"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the search; the status tells whether a run was wrong without a word."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("count", type=int, help="number of systems")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--runs", default=",".join((*MASTERS, "composite")), help="masters and composite, with commas")
    parser.add_argument("--load", choices=("mass", "drive"), default="mass", help="where friction reads other forces")
    parser.add_argument("--accuracy", action="store_true", help="judge what accuracy=True says")
    options = parser.parse_args(arguments)
    logging.getLogger("harness").addHandler(logging.NullHandler())
    counts: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        made = Composites(Path(folder))
        for seed in range(options.first, options.first + options.count):
            case = replace(draw(seed), load=options.load)
            begin = time.process_time()
            answers = References(case, REQUIRED if options.accuracy else OFF)
            spent = time.process_time() - begin
            for run in options.runs.split(","):
                verdict = judge(case, answers, run, made, options.accuracy) if answers.found else "no reference"
                counts[run, verdict] += 1
                if verdict in ("WRONG", "false alarm") or options.accuracy:
                    print(f"{seed:6d} {case.model:18s} {run:13s} {verdict}", flush=True)
            if spent > 5.0:
                print(f"{seed:6d} {case.model:18s} reference took {spent:.1f} s", flush=True)
    for (run, verdict), count in sorted(counts.items()):
        print(f"{run:13s} {verdict:26s} {count:5d}")
    return int(any(verdict in ("WRONG", "wrong, called within tolerance") for _, verdict in counts))


if __name__ == "__main__":
    sys.exit(main())
