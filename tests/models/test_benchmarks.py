"""Reference cases of a mass with friction: B5, B9 to B13. The others are in the file of their model, as test_bNN_...;
B14 to B20, B23, B35 and B38 are of a contact alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from ctypes import c_double, c_int, c_uint
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shell.instance import OK, Instance, Library, load
from thorough import some

GetLibrary = Callable[[str], Library]
P95 = {"sigma0": 1e5, "sigma1": math.sqrt(1e5), "sigma2": 0.4, "Fc": 1.0, "Fs": 1.5, "vs": 1e-3}


@pytest.fixture(scope="module")
def block(build_fmu: Callable[..., Path]) -> GetLibrary:
    return lambda name: load(build_fmu(name))


# ---- a mass with LuGre friction, as one system

Solution = Callable[[np.ndarray], np.ndarray]


def bristles(v: float, u: float) -> tuple[float, float]:
    """The rate of z, and F, of LuGre's equations with the set P95; u = sigma0 z."""
    p = P95
    z_dot = v - abs(v) * u / (p["Fc"] + (p["Fs"] - p["Fc"]) * math.exp(-((v / p["vs"]) ** 2)))
    return z_dot, u + p["sigma1"] * z_dot + p["sigma2"] * v


def monolithic(drive: Callable[[float, float], float], y: np.ndarray, span: tuple[float, float], **options: object):
    """x, v and sigma0 z of 1 kg under drive(t, x), by scipy."""

    def rate(t: float, y: np.ndarray) -> list[float]:
        z_dot, F = bristles(y[1], y[2])
        return [y[1], drive(t, y[0]) - F, P95["sigma0"] * z_dot]

    accuracy = {"rtol": 1e-12, "atol": [1e-16, 1e-14, 1e-13]}
    solution = solve_ivp(rate, span, y, "LSODA", dense_output=True, **accuracy, **options)
    assert solution.success
    return solution


def balance(lugre: Library, t: np.ndarray, y: np.ndarray) -> float:
    """Largest difference between the force of the block and that of the reference y at the times t.

    The block gets the reference's velocity, linear between these times by its derivative, such that it goes the same
    way. A block whose z or F were another one would move the mass elsewhere.
    """
    x, v, u = y
    h = np.diff(t)
    slopes = 2.0 * (np.diff(x) / h - v[:-1]) / h
    worst, F, rate, velocity = 0.0, c_double(), c_double(), c_double()
    with Instance(lugre) as run:
        run.initialise()
        call, me, order = run.library.handle, run.pointer, (c_int * 1)(1)
        at_v, at_F = (c_uint * 1)(run.reference("v")), (c_uint * 1)(run.reference("F"))
        for k in range(len(h)):
            velocity.value, rate.value = v[k], slopes[k]
            failed = call.fmi2SetReal(me, at_v, 1, velocity) or call.fmi2GetReal(me, at_F, 1, F)
            worst = max(worst, abs(F.value - bristles(v[k], u[k])[1]))
            failed = failed or call.fmi2SetRealInputDerivatives(me, at_v, 1, order, rate)
            assert not (failed or call.fmi2DoStep(me, t[k], h[k], 1)), run.messages
    return worst


def test_b05_the_reference_of_stick_slip_has_the_published_numbers_and_the_block_agrees(block: GetLibrary) -> None:
    """The co-simulated case, in steps of the master, is in the tests of LuGre."""

    def slips(_: float, y: np.ndarray) -> float:
        return float(y[1] - 0.05)

    slips.direction = 1.0  # type: ignore[attr-defined]
    solution = monolithic(lambda t, x: 2.0 * (0.1 * t - x), np.zeros(3), (0.0, 34.0), events=slips)
    t = solution.t
    fine = np.unique(np.concatenate([t[:-1] + np.diff(t) * part for part in (0.0, 0.5)] + [t[-1:]]))
    fine = fine[np.append(True, np.diff(fine) > 1e-9)]
    x, v, _ = y = solution.sol(fine)
    spring = 2.0 * (0.1 * fine - x)
    starts = solution.t_events[0]
    assert np.diff(starts) == pytest.approx(6.36271982, rel=1e-8)
    assert starts[0] == pytest.approx(7.540397, abs=1e-6)
    assert v.max() == pytest.approx(0.369816, abs=1e-6)
    assert [spring.max(), spring[fine > 8.0].min()] == pytest.approx([1.507988, 0.741239], abs=1e-6)
    assert solution.sol(20.0)[0] == pytest.approx(1.272596, abs=1e-6)
    assert balance(block("LuGre"), fine, y) < 1e-6 * P95["Fs"]


def push(t: float) -> float:
    """Bias with vibration of case B9."""
    return 0.6 * t if t < 1.0 else 0.6 + 0.3 * math.sin(2.0 * math.pi * (t - 1.0))


def test_b09_bias_and_vibration_make_lugre_drift(block: GetLibrary) -> None:
    """1e-6 Fs in the balance is 1.5e-11 m in z: 2.5e-6 of the drift in one cycle."""
    rise = monolithic(lambda t, _: push(t), np.zeros(3), (0.0, 1.0))
    cycles = monolithic(lambda t, _: push(t), rise.y[:, -1], (1.0, 21.0), max_step=0.01)
    drift = (cycles.sol(21.0)[0] - cycles.sol(11.0)[0]) / 10.0
    assert drift == pytest.approx(6.088742e-6, rel=1e-6)
    early, late = np.linspace(0.0, 1.0, 1000, endpoint=False), np.linspace(1.0, 21.0, 20001)
    y = np.concatenate([rise.sol(early), cycles.sol(late)], axis=1)
    assert balance(block("LuGre"), np.concatenate([early, late]), y) < 1e-6 * P95["Fs"]


def test_b09_bias_and_vibration_do_not_move_elastic_bristles(block: GetLibrary) -> None:
    """Co-simulated; the steps of the master change the vibration but not that it is one."""
    h, F, v, both, positions = 1e-3, c_double(), c_double(), (c_double * 2)(), {}
    with Instance(block("ElastoPlastic")) as friction, Instance(block("Mass")) as mass:
        friction.initialise(z_ba=0.95e-5)
        mass.initialise()
        at_F, at_v, of_v = friction.reference("F"), friction.reference("v"), mass.reference("v")
        drives = (c_uint * 2)(mass.reference("F_drive"), mass.reference("F_friction"))
        one, two = friction.library.handle, mass.library.handle
        for k in range(21001):
            t = k * h
            if k in (11000, 21000):
                positions[k] = mass.get1("x")
            one.fmi2SetReal(friction.pointer, (c_uint * 1)(at_v), 1, v)
            failed = one.fmi2DoStep(friction.pointer, t, h, 1)
            one.fmi2GetReal(friction.pointer, (c_uint * 1)(at_F), 1, F)
            both[:] = push(t + h / 2), F.value
            two.fmi2SetReal(mass.pointer, drives, 2, both)
            failed = failed or two.fmi2DoStep(mass.pointer, t, h, 1)
            two.fmi2GetReal(mass.pointer, (c_uint * 1)(of_v), 1, v)
            assert not failed
    assert abs(positions[21000] - positions[11000]) / 10.0 < 1e-18


# ---- stick-slip on a belt


class Cycle:
    """One cycle of SwitchMass after the first: its switches, located by bisection of the step, and its extremes."""

    def __init__(self, library: Library, **values: float) -> None:
        starts: list[float] = []
        samples: list[list[float]] = []
        t, h = 0.0, 0.02
        with Instance(library) as run:
            run.initialise(**values)
            stuck = run.get1("stuck")
            while len(starts) < 3:
                assert t < 100.0
                step = self._step_to_switch(run, t, h, stuck)
                t += step
                samples.append([t, *run.get("x", "v")])
                if run.get1("stuck") != stuck:
                    stuck = run.get1("stuck")
                    if stuck:
                        self.end, self.x_end = samples[-1][:2]
                    else:
                        starts.append(t)
                        self.x_start = samples[-1][1]
        self.period, self.slip = starts[2] - starts[1], self.end - starts[1]
        self.stick = self.period - self.slip
        late = np.array([sample for sample in samples if sample[0] > starts[1]])
        self.x_max, self.x_min, self.v_min = late[:, 1].max(), late[:, 1].min(), late[:, 2].min()

    @staticmethod
    def _step_to_switch(run: Instance, t: float, h: float, stuck: float) -> float:
        """The step that was taken: h, or up to just behind the switch."""
        with run.saved() as state:
            run.step(t, h)
            if run.get1("stuck") == stuck:
                return h
            low, high = 0.0, h
            while low < (middle := (low + high) / 2.0) < high and high - low > 1e-15:
                run.must("SetFMUstate", state)
                run.step(t, middle)
                low, high = (middle, high) if run.get1("stuck") == stuck else (low, middle)
            run.must("SetFMUstate", state)
            run.step(t, high)
            return high


def leine_slip(V: float) -> tuple[float, float, list[float]]:
    """Duration of slip, x at its end, and [x_max, x_min, v_min], from x = 1 at v = V, for F = 1/(1 + 3 (V - v))."""

    def rate(_: float, y: np.ndarray) -> list[float]:
        return [y[1], -y[0] + 1.0 / (1.0 + 3.0 * (V - y[1]))]

    events = [lambda t, y: y[1] - V + 0.0 * t, lambda t, y: y[1], lambda t, y: rate(t, y)[1]]
    events[0].terminal, events[0].direction = True, 1.0  # type: ignore[attr-defined]
    solution = solve_ivp(rate, (0.0, 10.0), [1.0, V * (1.0 - 1e-14)], "DOP853", rtol=1e-12, atol=1e-14, events=events)
    turning, fastest = solution.y_events[1], solution.y_events[2]
    extremes = [turning[:, 0].max(), turning[:, 0].min(), fastest[:, 1].min()]
    return solution.t[-1], solution.y[0, -1], extremes


def test_b10_an_oscillator_on_a_belt_switches_where_the_event_driven_one_does(block: GetLibrary) -> None:
    V = 0.2
    slip, x_end, extremes = leine_slip(V)
    expected = [slip + (1.0 - x_end) / V, slip, 1.0, x_end]
    published = [12.0010313, 4.2959995, 1.0, -0.5410064, 1.1339447, -0.5554327, -0.8399020]
    assert [*expected, *extremes] == pytest.approx(published, abs=1e-7)
    cycle = Cycle(block("SwitchMass"), eta=1e-10)
    assert [cycle.period, cycle.slip, cycle.x_start, cycle.x_end] == pytest.approx(expected, abs=1e-8)
    assert [cycle.x_max, cycle.x_min, cycle.v_min] == pytest.approx(extremes, abs=2e-4)  # at multiples of 20 ms


@pytest.mark.parametrize("unit", [1.0, 2.0**-19])
def test_b10_in_another_unit_of_time(block: GetLibrary, unit: float) -> None:
    """From break-away into the next stick in twelve steps, also of an oscillator whose period is 23 us."""
    V = 0.2
    slip, x_end, _ = leine_slip(V)
    with Instance(block("SwitchMass")) as run:
        run.initialise(m=unit**2, v_belt=V / unit, v0=V / unit, x0=1.0, eta=1e-10 / unit, delta=3.0 * unit)
        for i in range(12):
            run.step(0.5 * i * unit, 0.5 * unit)
        assert run.get1("stuck")
        assert run.get1("x") == pytest.approx(x_end + V * (6.0 - slip), abs=1e-10)


def constant_kinetic_friction(library: Library, k: float, V: float, Fs: float, Fc: float) -> dict[str, float]:
    """A cycle of 1 kg on a belt whose friction falls from Fs to Fc at once.

    Break-away takes the time in which the force that grows by k V a second pushes the mass through the band of eta,
    which goes with sqrt(eta): extrapolated to no band.
    """
    p = {"k": k, "Fs": Fs, "ratio": Fc / Fs, "delta": 1e30, "v_belt": V, "v0": V}
    wide, narrow = (Cycle(library, eta=eta, **p) for eta in (4e-11, 1e-11))
    names = ("period", "stick", "x_start", "x_end", "v_min")
    return {name: 2.0 * getattr(narrow, name) - getattr(wide, name) for name in names}


@pytest.mark.parametrize(
    ("k", "V", "Fs", "Fc", "tabulated"), [(1.0, 0.2, 1.0, 0.6, 8.068887872), (2.0, 0.1, 1.5, 1.0, 7.611259254)]
)
def test_b11_and_b13_constant_kinetic_friction_has_the_period_of_the_closed_form(
    block: GetLibrary, k: float, V: float, Fs: float, Fc: float, tabulated: float
) -> None:
    """A mass on a moving belt (B11), or pulled over the ground, seen from the puller (B13)."""
    w, gap = math.sqrt(k), Fs - Fc
    stick, slip = 2.0 * gap / (k * V), (2.0 * math.pi - 2.0 * math.atan(gap * w / (k * V))) / w
    found = constant_kinetic_friction(block("SwitchMass"), k, V, Fs, Fc)
    assert stick + slip == pytest.approx(tabulated, abs=1e-9)
    assert found["period"] == pytest.approx(stick + slip, rel=1e-9)
    assert found["stick"] == pytest.approx(stick, rel=1e-9)
    assert found["x_start"] == pytest.approx(Fs / k, rel=1e-12)
    assert found["x_end"] == pytest.approx((Fs - 2.0 * gap) / k, rel=1e-9)
    assert found["v_min"] == pytest.approx(-math.hypot(V, gap / w), rel=1e-4)  # at multiples of 20 ms
    if k == 1.0:
        assert [(Fs - 2.0 * gap) / k, -math.hypot(V, gap / w)] == pytest.approx([0.2, -0.4472136], abs=5e-8)


@pytest.mark.parametrize(("DV", "tabulated"), some([(1e-7, 7.611259254), (1e-3, 7.61290)], [(1e-3, 7.61290)]))
def test_b13_karnopps_mass_has_the_period_of_the_closed_form_with_v_less_dv(
    block: GetLibrary, DV: float, tabulated: float
) -> None:
    """Between break-away and rest v goes from DV to DV: the closed form of the ideal case with V - DV for V.

    The tabulated 7.61290 s for DV = 1e-3 m/s is that of fixed steps, which fall into the band a little below its edge;
    it has a tolerance of 1e-3. The period is the way from rest to rest over V. The pull is a straight line in each
    step: of 0.2 ms in slip, one up to break-away in stick."""
    w, V, h, t, x, v = math.sqrt(2.0), 0.1, 2e-4, 0.0, 0.0, 0.0
    places = []
    with Instance(block("KarnoppMass")) as run:
        run.initialise(Fs=1.5, Fc=1.0, Fv=0.0, DV=DV)
        while len(places) < 3:
            wait = (1.5 / 2.0 + x) / V - t  # until the pull is static friction
            step = wait if v == 0.0 and wait > h else h
            run.set({"F_ext": 2.0 * (V * t - x)})
            assert run.input_derivatives({"F_ext": 2.0 * (V - v)}) == OK
            run.step(t, step)
            t, before = t + step, v
            x, v = run.get("x", "v")
            if before > 0.0 == v:
                places.append(x)
    expected = 0.5 / V + (2.0 * math.pi - 2.0 * math.atan(0.25 * w / (V - DV))) / w
    assert (places[2] - places[1]) / V == pytest.approx(expected, rel=2e-8)
    assert expected == pytest.approx(tabulated, rel=1e-6 if DV == 1e-7 else 1e-3)


# ---- an oscillator with Coulomb friction


@pytest.mark.parametrize("name", ["Coulomb", "Stiction", "Stribeck"])
def test_b12_a_coulomb_oscillator_loses_the_same_amplitude_each_cycle(block: GetLibrary, name: str) -> None:
    """From turn to turn, where v = 0 and the force of the spring decides, friction is constant and the mass exact."""
    m, k, Fc, x0 = 1.0, 4.0, 0.3, 1.0
    half, found = math.pi * math.sqrt(m / k), [x0]
    levels = {"Fc": Fc} if name == "Coulomb" else {"Fc": Fc, "Fs": Fc, "Fv": 0.0}
    with Instance(block(name)) as friction, Instance(block("Mass")) as mass:
        friction.initialise(**levels)
        mass.initialise(m=m, k=k, x0=x0, v0=0.0)
        for turn in range(9):
            friction.set({"v": 0.0, "F_ext": -k * found[-1]})
            mass.set({"F_friction": friction.get1("F")})
            for quarter in range(4):  # on the way v has its sign, and F stays
                mass.step(half * (turn + quarter / 4.0), half / 4.0)
                x, v = mass.get("x", "v")
                if quarter < 3 and turn < 7:
                    friction.set({"v": v})
                    assert friction.get1("F") == mass.get1("F_friction")
            assert abs(v) < 1e-12
            found.append(x)
    drop = 2.0 * Fc / k  # each half cycle
    assert found[:8] == pytest.approx([(-1.0) ** n * (x0 - n * drop) for n in range(8)], abs=1e-12)
    assert [found[2], *found[7:]] == pytest.approx([0.7, 0.05, 0.05, 0.05], abs=1e-12)
