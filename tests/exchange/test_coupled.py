"""A mass and its friction in one integration by fmpy's CVode: stick-slip, whose closed forms the solver has to meet."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from math import atan, pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from exchange.reference import MASS, SPRING, Leuven, Slip, pulled, turns
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Model
from fmpy.simulation import instantiate_fmu
from fmpy.sundials import CVodeSolver
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from thorough import nightly, some

from friction_fmus import build
from harness import FmuPart, System

MOST_AT_A_TIME = 3


class Loop:
    """A composite FMU in model exchange, integrated by CVODE."""

    def __init__(self, fmu: Path, tolerance: float) -> None:
        self.description = read_model_description(str(fmu))
        folder = extract(str(fmu), str(fmu.with_suffix("")))
        self.fmu: FMU2Model = instantiate_fmu(folder, self.description, fmi_type="ModelExchange")
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.types = {v.name: v.type for v in self.description.modelVariables}
        self.t = 0.0
        self.events: list[float] = []
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self._iterate()
        self.solver = CVodeSolver(
            nx=self.description.numberOfContinuousStates,
            nz=self.description.numberOfEventIndicators,
            get_x=self.fmu.getContinuousStates,
            set_x=self.fmu.setContinuousStates,
            get_dx=self.fmu.getDerivatives,
            get_z=self.fmu.getEventIndicators,
            get_nominals=self.fmu.getNominalsOfContinuousStates,
            set_time=self.fmu.setTime,
            input=self,
            startTime=0.0,
            relativeTolerance=tolerance,
            maxNumSteps=100_000,
        )

    def apply(self, _: float) -> None:
        """What fmpy's solver calls before it sets states: nothing to do."""

    def get(self, name: str) -> float:
        read = self.fmu.getReal if self.types[name] == "Real" else self.fmu.getBoolean
        return float(read([self.references[name]])[0])

    def _iterate(self) -> None:
        again, terminate, *_, defined, at = self.fmu.newDiscreteStates()
        assert not again, "one iteration is enough"
        assert not terminate
        self.next_event = float(at) if defined else float("inf")
        self.fmu.enterContinuousTimeMode()

    def run(self, until: float, see: Callable[[], None] | None = None, step: float = 0.01) -> None:
        """Integrate to a time; `see` is called at each step and event."""
        repeated = 0
        while self.t < until - 1e-12:
            found, _, reached = self.solver.step(self.t, min(until, self.t + step, self.next_event))
            repeated = repeated + 1 if found and reached - self.t < 1e-12 else 0
            assert repeated < MOST_AT_A_TIME, f"events repeat at {self.t} s"
            self.t = reached
            self.fmu.setTime(self.t)
            if found or self.t >= self.next_event:
                self.events.append(self.t)
                self.fmu.enterEventMode()
                self._iterate()
                self.solver.reset(self.t)
            if see:
                see()


LINES = {"v": "mass.v -> friction.v", "v_rel": "mass.v_rel -> friction.v", "F_ext": "mass.F_ext -> friction.F_ext"}


@pytest.fixture
def couple(build_fmu: Callable[..., Path], tmp_path: Path) -> Callable[..., Loop]:
    """A mass and its friction, in one FMU."""

    def make(
        friction: str | Path,
        mass: Mapping[str, float],
        contact: Mapping[str, float],
        tolerance: float = 1e-11,
        plant: str = "Mass",
    ) -> Loop:
        parts = {
            "mass": FmuPart("mass", build_fmu(plant)),
            "friction": FmuPart("friction", build_fmu(friction) if isinstance(friction, str) else friction),
        }
        needed = {port.name for port in parts["friction"].inputs}
        wires = [LINES["v_rel" if plant == "Belt" else "v"], "friction.F -> mass.F_friction"]
        wires += [LINES["F_ext"]] * ("F_ext" in needed)
        start = {"mass.F_drive": 0.0} if plant == "Mass" else {}
        start |= {f"mass.{key}": value for key, value in mass.items()}
        start |= {f"friction.{key}": value for key, value in contact.items()}
        path = tmp_path / "Pair.fmu"
        with System(parts.values(), wires, start=start) as system:
            system.to_fmu(path, step=1e-3)
        return Loop(path, tolerance)

    return make


def crossings(pair: Loop, until: float, level: float) -> list[float]:
    """The times at which v rises through `level`, by a cubic through the ends of each step of 1 ms."""
    seen: list[tuple[float, float, float]] = []
    pair.run(until, lambda: seen.append((pair.t, pair.get("mass.v"), pair.get("mass.a"))), step=1e-3)
    times = []
    for (t0, v0, a0), (t1, v1, a1) in pairwise(seen):
        if v0 < level <= v1 and t1 > t0:
            h = t1 - t0
            cubic = np.polynomial.Polynomial(
                [v0 - level, a0 * h, 3 * (v1 - v0) - h * (2 * a0 + a1), 2 * (v0 - v1) + h * (a0 + a1)]
            )
            (root,) = [r.real for r in cubic.roots() if abs(r.imag) < 1e-9 and -1e-9 <= r.real <= 1 + 1e-9]
            times.append(t0 + h * root)
    return times


@nightly
def test_stick_slip_over_lugre(couple: Callable[..., Loop]) -> None:
    """Benchmark B5: Canudas de Wit and others 1995, figure 6, reference confirmed with MuJoCo."""
    pair = couple("LuGre", {"m": 1.0, "k": 2.0, "v_support": 0.1}, {})
    slips = crossings(pair, 20.5, 0.05)
    assert slips[0] == pytest.approx(7.540397, abs=1e-6)
    assert slips[2] - slips[1] == pytest.approx(6.36271982, rel=1e-7)
    assert pair.events == []


PULLED = {"m": MASS, "k": SPRING, "v_support": 0.01}
CONTACTS = {
    "GMS": (
        Slip(k=(6e4, 4e4), alpha=(0.6, 0.4), C=100.0, sigma=60.0),
        {"N": 2, "k[1]": 6e4, "k[2]": 4e4, "alpha[1]": 0.6, "alpha[2]": 0.4, "C": 100.0, "sigma": 60.0, "sigma2": 0.0},
    ),
    "Leuven": (
        Leuven(A=4.0, zc=4e-5, n=2.0, sigma1=316.0),
        {"A": 4.0, "zc": 4e-5, "n": 2.0, "sigma1": 316.0, "sigma2": 0.0},
    ),
}


@nightly
@pytest.mark.parametrize("friction", some([*CONTACTS], ["GMS"]))
def test_stick_slip_is_that_of_the_equations_in_scipy(friction: str, couple: Callable[..., Loop]) -> None:
    contact, parameters = CONTACTS[friction]
    expected = pulled(contact, speed=0.01, until=1.65, v_up=0.01)
    pair = couple(friction, PULLED, parameters)
    slips = crossings(pair, 1.65, 0.01)
    assert len(slips) == len(expected) == 2
    assert slips == pytest.approx(expected, rel=1e-7)
    assert slips[1] - slips[0] == pytest.approx(expected[1] - expected[0], rel=1e-7)


@nightly
def test_stick_slip_with_a_drop_of_friction(couple: Callable[..., Loop]) -> None:
    """Benchmark B13, closed form: m = 1 kg, k = 2 N/m, Fs = 1.5 N, Fc = 1 N, pulled at 0.1 m/s."""
    m, k, V, drop = 1.0, 2.0, 0.1, 0.5
    w = sqrt(k / m)
    period = 2 * drop / (k * V) + (2 * pi - 2 * atan(drop * w / (k * V))) / w
    pair = couple("Stiction", {"m": m, "k": k, "v_support": V}, {"Fs": 1.5, "Fc": 1.0, "Fv": 0.0})
    slips = crossings(pair, 31.0, 0.05)
    assert np.diff(slips) == pytest.approx(period, rel=1e-9)
    assert len(pair.events) <= 4 * len(slips)  # it sticks, breaks away, leaves rest, and the flag changes


def changes(loop: Loop, until: float) -> list[tuple[float, float, bool]]:
    """Time and position where the mass comes to rest on the belt or breaks away, and whether it rests then."""
    found: list[tuple[float, float, bool]] = []

    def see() -> None:
        stuck = bool(loop.get("friction.stuck"))
        if not found or found[-1][2] != stuck:
            found.append((loop.t, loop.get("mass.x"), stuck))

    loop.run(until, see)
    return found


BELT = {"m": 1.0, "k": 1.0, "v_belt": 0.2, "v0": 0.2}


@nightly
def test_stick_slip_on_a_belt(couple: Callable[..., Loop]) -> None:
    """Benchmark B11, closed form: m = 1 kg, k = 1 N/m, Fs = 1 N, Fc = 0.6 N, belt at 0.2 m/s."""
    V, drop = 0.2, 0.4
    period = 2 * drop / V + 2 * pi - 2 * atan(drop / V)
    assert period == pytest.approx(8.068887872, abs=1e-9)
    loop = couple("Stiction", BELT, {"Fs": 1.0, "Fc": 0.6, "Fv": 0.0}, 1e-12, plant="Belt")
    _, *found = changes(loop, 30.0)
    away, at_rest = [c for c in found if not c[2]], [c for c in found if c[2]]
    assert len(away) == 4
    assert np.diff([t for t, *_ in away]) == pytest.approx(period, rel=1e-9)
    assert [x for _, x, _ in away] == pytest.approx([1.0] * 4, abs=1e-9)
    assert [x for _, x, _ in at_rest] == pytest.approx([0.2] * len(at_rest), abs=1e-9)


@nightly
def test_friction_that_falls_with_velocity_on_a_belt(couple: Callable[..., Loop], tmp_path: Path) -> None:
    """Benchmark B10 (Leine and others 1998): F = Fs / (1 + 3 |v_rel|), by a block of one's own."""
    stiction = (Path(__file__).parents[2] / "fmu_src" / "friction" / "Stiction.c").read_text(encoding="utf-8")
    law = "direction * load_of(Fn, Fn0) * Fc + Fv * v"
    assert law in stiction
    own = stiction.replace(law, "direction * load_of(Fn, Fn0) * Fc / (1.0 + Fv * fabs(v))").replace(
        "MODEL    Stiction", "MODEL    Leine"
    )
    (tmp_path / "Leine.c").write_text(own, encoding="utf-8")
    friction = build(tmp_path / "Leine.c", tmp_path)
    loop = couple(friction, BELT, {"Fs": 1.0, "Fc": 1.0, "Fv": 3.0}, 1e-12, plant="Belt")
    _, *found = changes(loop, 40.0)
    away, at_rest = [c for c in found if not c[2]], [c for c in found if c[2]]
    period, slip, stop = leine()
    assert (period, slip, stop) == pytest.approx((12.0010313, 4.2959995, -0.5410064), abs=1e-7)
    assert np.diff([t for t, *_ in away]) == pytest.approx(period, rel=1e-9)
    for begin, end in zip(away, at_rest, strict=False):
        assert end[0] - begin[0] == pytest.approx(slip, rel=1e-9)
        assert begin[1] == pytest.approx(1.0, abs=1e-9)
        assert end[1] == pytest.approx(stop, abs=1e-9)


def leine() -> tuple[float, float, float]:
    """Return period, duration of the slip, and position at its end, from the equations of B10 by SciPy."""
    V = BELT["v_belt"]
    slip = solve_ivp(
        lambda _, y: [y[1], -y[0] + 1.0 / (1.0 + 3.0 * (V - y[1]))],
        (0.0, 6.0),
        [1.0, V],
        "DOP853",
        rtol=1e-13,
        atol=1e-15,
        dense_output=True,
    )
    end = brentq(lambda t: slip.sol(t)[1] - V, 3.0, 6.0, xtol=1e-14)
    x = float(slip.sol(end)[0])
    return end + (1.0 - x) / V, end, x


@nightly
def test_decay_of_an_oscillator(couple: Callable[..., Loop]) -> None:
    """Benchmark B12, closed form: 4 Fc / k a cycle, at rest at 0.05 m after 7 half cycles."""
    pair = couple("Coulomb", {"m": 1.0, "k": 4.0, "x0": 1.0}, {"Fc": 0.3}, 1e-12)
    pair.run(pi)
    assert pair.get("mass.x") == pytest.approx(0.7, abs=1e-9)
    pair.run(12.0)
    assert pair.get("mass.x") == pytest.approx(0.05, abs=1e-9)
    at_rest = len(pair.events)
    pair.run(1e6, step=1e5)
    assert len(pair.events) == at_rest
    # the solver stops the mass to 1e-14 m/s, and nothing but friction could stop the rest
    assert pair.get("mass.x") == pytest.approx(0.05, abs=1e-7)


@nightly
def test_an_oscillator_turns_in_one_event_each_and_comes_to_rest(couple: Callable[..., Loop]) -> None:
    """Over friction that differs between the directions (the Lorentzian curve), with an offset."""
    forward = {"Fc": 0.8, "Fs": 1.5, "Fv": 0.6, "vs": 0.05, "delta": 1.6}
    backward = {"Fc": 1.1, "Fs": 1.2, "Fv": 0.9, "vs": 0.11, "delta": 2.5}
    offset = 0.13

    def sliding(v: float, way: float) -> float:
        p = forward if way > 0.0 else backward
        curve = p["Fc"] + (p["Fs"] - p["Fc"]) / (1.0 + abs(v / p["vs"]) ** p["delta"])
        return way * curve + p["Fv"] * v + offset

    mass = {"m": 0.8, "k": 40.0, "d": 0.25, "x0": 0.35}
    expected = turns(sliding, (offset - backward["Fs"], offset + forward["Fs"]), mass)
    contact = {"shape": 1, "offset": offset, "asymmetric": 1.0, **forward}
    pair = couple("Stribeck", mass, contact | {f"{key}_neg": value for key, value in backward.items()}, 1e-12)
    pair.run(8.0)
    assert len(expected) == 4
    start, *events = pair.events
    assert start < 1e-9
    assert events == pytest.approx([t for t, _ in expected], abs=1e-9)
    assert pair.get("mass.x") == pytest.approx(expected[-1][1], abs=1e-9)


@pytest.mark.parametrize(
    "friction", some(["GMS", "Leuven", "ModifiedLeuven", "ElastoPlastic", "MaxwellSlip"], ["ElastoPlastic"])
)
def test_a_pulled_mass_comes_to_rest(friction: str, couple: Callable[..., Loop]) -> None:
    """At rest in presliding, its oscillation decays or goes on, with two events a cycle at most for each element."""
    pair = couple(friction, {"m": 1.0, "k": 2.0, "d": 2.0, "F_drive": 0.4}, {}, 1e-9)
    pair.run(0.5, step=1e-3)
    assert len(pair.events) < 20 * 0.5 * sqrt(1e5) / pi
    assert 0.0 < pair.get("mass.x") < 1e-4
