"""Single-state presliding laws against closed forms, quadrature and scipy: Dahl, Bliman-Sorine, reset integrator,
elasto-plastic, and what LuGre shares with them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from shell.instance import ERROR, OK, Instance, Library, load
from thorough import few

P95 = {"sigma0": 1e5, "sigma1": math.sqrt(1e5), "sigma2": 0.4, "Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "delta": 2.0}
MODELS = ("LuGre", "Dahl", "BlimanSorine", "ResetIntegrator", "ElastoPlastic")
STEPS = (1e-6, 1e-5, 1e-4, 1e-3, 0.02)

reproducibly = settings(max_examples=few(100), deadline=20_000, derandomize=True, database=None)
few = settings(max_examples=few(40), deadline=20_000, derandomize=True, database=None)
velocities = st.one_of(st.floats(-5e-3, 5e-3), st.floats(-0.5, 0.5), st.sampled_from([0.0, 1e-9, -1e-9, 10.0, -10.0]))
trajectory = st.lists(st.tuples(velocities, st.floats(1e-6, 0.02)), min_size=1, max_size=8)
exponents = st.one_of(st.sampled_from([0.0, 0.5, 1.0, 1.5, 2.0, 3.0]), st.floats(0.0, 5.0))
friction_level = st.floats(0.05, 20.0)
stiffness = st.floats(1e2, 1e7)


@pytest.fixture(scope="module")
def block(build_fmu: Callable[..., Path]) -> Callable[[str], Library]:
    return lambda name: load(build_fmu(name))


@pytest.fixture(scope="module")
def dahl(block: Callable[[str], Library]) -> Library:
    return block("Dahl")


@pytest.fixture(scope="module")
def bliman(block: Callable[[str], Library]) -> Library:
    return block("BlimanSorine")


@pytest.fixture(scope="module")
def bliman_1(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("BlimanSorine", order=1))


@pytest.fixture(scope="module")
def resetting(block: Callable[[str], Library]) -> Library:
    return block("ResetIntegrator")


@pytest.fixture(scope="module")
def plastic(block: Callable[[str], Library]) -> Library:
    return block("ElastoPlastic")


@pytest.fixture(scope="module")
def lugre(block: Callable[[str], Library]) -> Library:
    return block("LuGre")


def forces(library: Library, steps: list[tuple[float, float]], slope: float = 0.0, **values: float) -> list[float]:
    """F after each (v, h), v held or growing by `slope` a second."""
    found = []
    with Instance(library) as run:
        run.initialise(**values)
        t = 0.0
        for v, h in steps:
            run.set({"v": v})
            if slope:
                assert run.input_derivatives({"v": slope}) == OK
            run.step(t, h)
            t += h
            found.append(run.get1("F"))
    return found


def ramp(library: Library, v: float, slope: float, h: float, *names: str, **values: float) -> list[float]:
    """Variables after one step with a linear velocity."""
    with Instance(library) as run:
        run.initialise(v=v, **values)
        assert run.input_derivatives({"v": slope}) == OK
        run.step(0.0, h)
        return run.get(*names)


def paths(v: float, slope: float, h: float) -> list[float]:
    """Signed paths between the reversals of v + slope s."""
    zero = -v / slope if slope else math.inf

    def x(s: float) -> float:
        return v * s + slope * s * s / 2.0

    return [x(zero), slope * (h - zero) ** 2 / 2.0] if 0.0 < zero < h else [x(h)]


# ---- Dahl


def dahl_force(F: float, x: float, n: float, sigma: float, Fc: float) -> float:
    """F after the signed path x, in extended precision: 1 - F/Fc of a direct formula."""
    extended = np.longdouble
    s, p = extended(np.sign(x)), abs(extended(x)) * extended(sigma) / extended(Fc)
    if x == 0.0:
        return F
    w = extended(1.0) - s * extended(F) / extended(Fc)
    size, e = abs(w), extended(1.0) - extended(n)
    if size == 0.0:
        return F
    if n == 1.0:
        size = size * np.exp(-p)
    else:
        base = size**e - e * p
        size = base ** (1 / e) if base > 0.0 else extended(0.0)
    return float(s * extended(Fc) * (extended(1.0) - np.sign(w) * size))


@pytest.mark.parametrize(
    ("n", "at_1", "at_3"),
    [
        (0.0, 1.0, 1.0),
        (0.5, 0.75, 1.0),
        (1.0, 0.632120559, 0.950212932),
        (1.5, 0.5555556, 0.84),
        (2.0, 0.5, 0.75),
        (3.0, 0.42264973, 0.62203553),
    ],
)
def test_b14_dahl_from_rest(dahl: Library, n: float, at_1: float, at_3: float) -> None:
    for direction in (1.0, -1.0):
        for h in STEPS:
            found = forces(dahl, [(direction * 1e-5 / h, h), (direction * 2e-5 / h, h)], n=n)
            assert found == pytest.approx([direction * at_1, direction * at_3], abs=5e-8)
            exact = [direction * dahl_force(0.0, x, n, 1e5, 1.0) for x in (1e-5, 3e-5)]
            assert found == pytest.approx(exact, rel=1e-12)


@reproducibly
@given(steps=trajectory, n=exponents, sigma=stiffness, Fc=friction_level, start=st.floats(-3.0, 3.0))
def test_dahl_is_its_closed_form_over_any_trajectory(
    dahl: Library, steps: list[tuple[float, float]], n: float, sigma: float, Fc: float, start: float
) -> None:
    """Also from a force above the Coulomb level, which the factor sgn(w) brings back. |1 - n| below 1e-3 has
    tests of its own: the direct formula of the reference cancels there."""
    n = 1.0 if abs(n - 1.0) < 1e-3 else n
    F = start * Fc
    with Instance(dahl) as run:
        run.initialise(sigma=sigma, Fc=Fc, n=n, z=F / sigma)
        t = 0.0
        for v, h in steps:
            run.set({"v": v})
            F = run.get1("F")  # of the block: near w = 0 the map for n < 1 magnifies rounding
            run.step(t, h)
            t += h
            F = dahl_force(F, v * h, n, sigma, Fc)
            assert run.get1("F") == pytest.approx(F, rel=1e-12, abs=1e-12 * Fc)


@pytest.mark.parametrize("e", [1e-4, 1e-8, 1e-12, 2.0**-52])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_dahl_is_continuous_in_its_exponent_at_1(dahl: Library, e: float, side: float) -> None:
    """w = exp(-p + (n - 1) p^2/2 + ...) by a series in n - 1."""
    n = 1.0 + side * e
    for p in (1e-3, 0.5, 3.0):
        (F,) = forces(dahl, [(p * 1e-5 / 1e-3, 1e-3)], n=n)
        small = n - 1.0
        exponent = p - small * p**2 / 2 + small**2 * p**3 / 3 - small**3 * p**4 / 4
        assert pytest.approx(-math.expm1(-exponent), rel=1e-12) == F


@pytest.mark.parametrize("n", [0.0, 0.3, 0.5, 0.9])
def test_below_1_dahl_arrives_after_a_finite_path_and_stays(dahl: Library, n: float) -> None:
    path = 1e-5 / (1.0 - n)
    before, after, later, rest = forces(dahl, [(0.9 * path, 1.0), (0.101 * path, 1.0), (1.0, 1.0), (0.0, 1.0)], n=n)
    assert before < 1.0
    assert [after, later, rest] == pytest.approx([1.0, 1.0, 1.0], rel=1e-15)
    with Instance(dahl) as run:
        run.initialise(n=n, v=0.1)
        run.step(0.0, 1.0)
        assert run.get1("der(z)") == 0.0


@pytest.mark.parametrize("n", [0.0, 0.4, 1.0, 1.7, 2.0, 3.0, 100.0])
@pytest.mark.parametrize("start", [1.0, -1.0, 1.0 + 1e-15, 5.0, -5.0, 1e6])
def test_any_initial_force_of_dahl_is_legal(dahl: Library, n: float, start: float) -> None:
    for v in (1e-2, -1e-2):
        found = forces(dahl, [(v, 1e-3)] * 20, n=n, z=start / 1e5)
        assert all(map(math.isfinite, found))
        goal = math.copysign(1.0, v)
        distances = [abs(F - goal) for F in (start, *found)]
        assert all(later <= earlier + 1e-15 * abs(start) for earlier, later in itertools.pairwise(distances))


def test_b15_the_steady_loop_of_dahl(dahl: Library) -> None:
    """Amplitude Fc tanh(sigma A / Fc); area twice the work of one branch, whose force is known."""
    A, T, N = 2e-5, math.tanh(2.0), 2000
    h, found = 1e-3, []
    with Instance(dahl) as run:
        run.initialise(z=-T / 1e5)
        for direction in (1.0, -1.0):
            run.set({"v": direction * 2.0 * A / (N * h)})
            found.append([run.get1("F")])
            for _ in range(N):
                run.step(run.get1("time"), h)
                found[-1].append(run.get1("F"))
    up, down = np.array(found)
    assert up[-1] == pytest.approx(T, rel=1e-12)
    assert pytest.approx(0.964027580, rel=1e-9) == T
    assert down[-1] == pytest.approx(-T, rel=1e-12)
    weights = np.tile([2.0, 4.0], N // 2 + 1)[: N + 1]
    weights[[0, -1]] = 1.0  # Simpson
    area = float((up - down) @ weights) / 3.0 * 2.0 * A / N
    closed = 2.0 * (2.0 * A - (1.0 + T) * 1e-5 * -math.expm1(-4.0))
    assert closed == pytest.approx(4.143889680e-5, rel=1e-9)
    assert area == pytest.approx(closed, rel=1e-9)


@pytest.mark.parametrize("name", ["Dahl", "BlimanSorine"])
def test_b16_the_force_depends_on_the_path_only(block: Callable[[str], Library], name: str) -> None:
    steps = [(1e-3 * math.sin(0.1 * k) + 4e-4 * math.cos(0.37 * k), 1e-3) for k in range(200)]
    slow = forces(block(name), steps)
    for faster in (0.01, 7.0, 1000.0):
        fast = forces(block(name), [(v * faster, h / faster) for v, h in steps])
        assert fast == pytest.approx(slow, rel=1e-12, abs=1e-13)


@reproducibly
@given(v=velocities, slope=st.floats(-50.0, 50.0).filter(bool), h=st.floats(1e-6, 0.02), n=exponents)
def test_dahl_follows_a_ramp_through_its_reversal(dahl: Library, v: float, slope: float, h: float, n: float) -> None:
    n = 1.0 if abs(n - 1.0) < 1e-3 else n
    F = 0.3
    for x in paths(v, slope, h):
        F = dahl_force(F, x, n, 1e5, 1.0)
    assert ramp(dahl, v, slope, h, "F", n=n, z=3e-6)[0] == pytest.approx(F, abs=1e-9)


# ---- Bliman-Sorine


def two_elements(s: float, start: tuple[float, float], f1: float, f2: float, eta: float, eps: float) -> float:
    """Force after the path s in positive direction."""
    return f1 + (start[0] - f1) * math.exp(-s / (eta * eps)) - f2 + (start[1] + f2) * math.exp(-s / eps)


def test_a_slow_element_above_the_fast_one_is_refused(bliman: Library, bliman_1: Library) -> None:
    """Steady sliding has the friction f1 - f2, which would drive; order 1 has no slow element."""
    with Instance(bliman) as run:
        run.setup()
        run.set({"f2": 5.0})
        run.must("EnterInitializationMode")
        assert run.call("ExitInitializationMode") == ERROR
        assert b"must satisfy f2 <= f1" in run.messages[-1][3]
    assert forces(bliman, [(1.0, 1.0)], f2=1.8)[0] == pytest.approx(0.0, abs=1e-15)
    assert forces(bliman_1, [(1.0, 1.0)], f2=5.0)[0] == pytest.approx(1.8, rel=1e-14)


def test_b23_the_peak_from_rest_and_from_reversed_sliding(bliman: Library) -> None:
    f1, f2, eta, eps = 1.8, 0.8, 0.1, 1e-3
    peak_at = eta * eps / (1.0 - eta) * math.log(f1 / (eta * f2))
    assert peak_at == pytest.approx(3.459461e-4, rel=2e-7)
    for start, tabulated in (((0.0, 0.0), 1.509436425), ((-f1, f2), 2.018872851)):
        peak = two_elements(peak_at, start, f1, f2, eta, eps)
        assert peak == pytest.approx(tabulated, rel=1e-9)
        for direction in (1.0, -1.0):
            for h in STEPS:
                values = {"F_fast": direction * start[0], "F_slow": direction * start[1]}
                (F,) = forces(bliman, [(direction * peak_at / h, h)], **values)
                assert pytest.approx(direction * peak, rel=1e-12) == F
                for part in (0.9, 1.1):
                    (beside,) = forces(bliman, [(direction * part * peak_at / h, h)], **values)
                    assert abs(beside) < peak
    assert forces(bliman, [(1.0, 1.0)])[0] == pytest.approx(f1 - f2, rel=1e-14)


@reproducibly
@given(
    steps=trajectory,
    f1=friction_level,
    share=st.floats(0.0, 1.0),
    eta=st.floats(0.01, 1.0),
    eps=st.floats(1e-6, 1e-2),
)
def test_bliman_sorine_is_two_exponentials_in_the_path(
    bliman: Library, steps: list[tuple[float, float]], f1: float, share: float, eta: float, eps: float
) -> None:
    f2, fast, slow = share * f1, 0.0, 0.0
    found = forces(bliman, steps, f1=f1, f2=f2, eta=eta, eps=eps)
    for (v, h), F in zip(steps, found, strict=True):
        s, u = np.sign(v), abs(v) * h
        fast = s * f1 + (fast - s * f1) * math.exp(-u / (eta * eps)) if u else fast
        slow = -s * f2 + (slow + s * f2) * math.exp(-u / eps) if u else slow
        assert pytest.approx(fast + slow, abs=1e-12 * f1) == F


@reproducibly
@given(v=velocities, slope=st.floats(-50.0, 50.0).filter(bool), h=st.floats(1e-6, 0.02))
def test_bliman_sorine_follows_a_ramp_through_its_reversal(bliman: Library, v: float, slope: float, h: float) -> None:
    fast, slow = 0.2, -0.1
    for x in paths(v, slope, h):
        s = np.sign(x)
        fast = s * 1.8 + (fast - s * 1.8) * math.exp(-abs(x) / 1e-4) if x else fast
        slow = -s * 0.8 + (slow + s * 0.8) * math.exp(-abs(x) / 1e-3) if x else slow
    assert ramp(bliman, v, slope, h, "F", F_fast=0.2, F_slow=-0.1)[0] == pytest.approx(fast + slow, abs=1e-9)


@reproducibly
@given(
    steps=trajectory,
    slope=st.sampled_from([0.0, 0.3, -5.0]),
    f1=friction_level,
    share=st.floats(0.0, 1.0),
    eta=st.floats(0.01, 1.0),
    eps=st.floats(1e-6, 1e-2),
)
def test_bliman_sorine_takes_energy_out_from_rest(
    bliman: Library, steps: list[tuple[float, float]], slope: float, f1: float, share: float, eta: float, eps: float
) -> None:
    """Over the path, F is the answer of f1/(1 + i eta eps w) - f2/(1 + i eps w) to sgn v, whose real part is positive
    for f1 >= f2 and eta <= 1. By their equations the work of the elements is s f u - path constant times change."""
    f2, work, scale = share * f1, 0.0, 0.0
    with Instance(bliman) as run:
        run.initialise(f1=f1, f2=f2, eta=eta, eps=eps)
        t = 0.0
        for v, h in steps:
            zero = -v / slope if slope else math.inf
            for begin, span in [(v, zero), (0.0, h - zero)] if 0.0 < zero < h else [(v, h)]:
                before = run.get("F_fast", "F_slow")
                run.set({"v": begin})
                assert run.input_derivatives({"v": slope}) == OK
                run.step(t, span)
                t += span
                fast, slow = (b - a for a, b in zip(before, run.get("F_fast", "F_slow"), strict=True))
                (x,) = paths(begin, slope, span) if begin else (slope * span * span / 2.0,)
                s = float(np.sign(x))
                work += (f1 - f2) * abs(x) - s * eps * (eta * fast + slow)
                scale += (f1 + f2) * (abs(x) + eps)
            assert work >= -1e-12 * scale


# ---- reset integrator


def test_b35_the_reset_integrator_sticks_stiffer_than_it_slides(resetting: Library) -> None:
    sigma0, z0, a, beta = 1e5, 1e-5, 0.5, 774.6
    for v in (1e-3, -1e-3):
        for h in STEPS:
            with Instance(resetting) as run:
                run.initialise(v=0.4 * math.copysign(z0, v) / h)
                run.step(0.0, h)
                run.set({"v": v})
                s = math.copysign(1.0, v)
                stuck = s * (1.0 + a) * sigma0 * 0.4 * z0 + beta * v
                assert run.get("F", "stuck", "der(z)") == pytest.approx([stuck, 1.0, v], rel=1e-12)
                run.set({"v": s * z0 / h})
                run.step(run.get1("time"), h)
                assert run.get("z", "F", "stuck", "der(z)") == pytest.approx(
                    [s * z0, s * sigma0 * z0, 0.0, 0.0], rel=1e-12
                )


def test_the_force_drops_where_the_deflection_reaches_its_limit(resetting: Library) -> None:
    """By a sigma0 z0 + beta v."""
    v = 2e-4
    below, at = forces(resetting, [(0.999999999999 * 1e-5, 1.0), (v, 1.0)])
    with Instance(resetting) as run:
        run.initialise(z=0.999999999999e-5, v=v)
        below = run.get1("F")
        run.step(0.0, 1.0)
        at = run.get1("F")
    assert below - at == pytest.approx(0.5 * 1.0 + 774.6 * v, rel=1e-9)


@reproducibly
@given(
    steps=trajectory,
    z0=st.floats(1e-7, 1e-3),
    a=st.floats(0.0, 3.0),
    beta=st.floats(0.0, 1e3),
    sigma0=stiffness,
    start=st.floats(-2.0, 2.0),
)
def test_the_reset_integrator_clips(
    resetting: Library, steps: list[tuple[float, float]], start: float, **p: float
) -> None:
    """A deflection above its limit stays until the motion reverses, as the equation has it."""
    z0, z = p["z0"], start * p["z0"]
    with Instance(resetting) as run:
        run.initialise(z=z, **p)
        t = 0.0
        for v, h in steps:
            run.set({"v": v})
            run.step(t, h)
            t += h
            z = max(z, min(z + v * h, z0)) if v > 0.0 else min(z, max(z + v * h, -z0))
            stopped = (v > 0.0 and z >= z0) or (v < 0.0 and z <= -z0)
            stiffness = (1.0 + (p["a"] if abs(z) < z0 else 0.0)) * p["sigma0"]
            assert run.get("z", "der(z)") == pytest.approx([z, 0.0 if stopped else v], rel=1e-13, abs=1e-13 * z0)
            expected = stiffness * z + p["beta"] * (0.0 if stopped else v)
            assert run.get1("F") == pytest.approx(expected, rel=1e-12, abs=1e-12 * p["sigma0"] * z0)


@reproducibly
@given(v=velocities, slope=st.floats(-50.0, 50.0).filter(bool), h=st.floats(1e-6, 0.02))
def test_the_reset_integrator_follows_a_ramp_through_its_reversal(
    resetting: Library, v: float, slope: float, h: float
) -> None:
    z = 4e-6
    for x in paths(v, slope, h):
        z = min(max(z + x, -1e-5), 1e-5)
    assert ramp(resetting, v, slope, h, "z", z=4e-6)[0] == pytest.approx(z, abs=1e-15)


# ---- elasto-plastic


def steady(v: float, p: dict[str, float]) -> float:
    return p["Fc"] + (p["Fs"] - p["Fc"]) * math.exp(-((abs(v) / p["vs"]) ** p["delta"]))


def alpha(z: float, s: float, z_max: float, z_ba: float) -> float:
    """Of the paper, with |z| and both conditions."""
    if s * z <= 0.0 or abs(z) <= z_ba:
        return 0.0
    if abs(z) >= z_max:
        return 1.0
    return 0.5 + 0.5 * math.sin(math.pi * (abs(z) - (z_max + z_ba) / 2.0) / (z_max - z_ba))


def followed(z: float, v: float, slope: float, h: float, p: dict[str, float], bristles: str = "plastic") -> float:
    """z(h) by scipy, started anew at reversals, in the unit Fs/sigma0 and, unless it is stiff there, explicitly."""
    zero = -v / slope if slope else math.inf
    unit = p["Fs"] / p["sigma0"]
    for begin, end in [(0.0, zero), (zero, h)] if 0.0 < zero < h else [(0.0, h)]:
        s = float(np.sign(v + slope * (begin + end) / 2.0))
        if s == 0.0:
            continue

        def rate(t: float, y: np.ndarray, s: float = s) -> list[float]:
            speed = v + slope * t
            z_max = steady(speed, p) / p["sigma0"]
            slip = alpha(y[0] * unit, s, z_max, p["z_ba"]) if bristles == "plastic" else 1.0
            return [speed * (1.0 - slip * s * y[0] * unit / z_max) / unit]

        pieces = max(1, math.ceil(abs(slope) * (end - begin) / p["vs"])) if slope else 1
        solution = solve_ivp(
            rate, (begin, end), [z / unit], "DOP853", rtol=1e-12, atol=1e-13, max_step=(end - begin) / min(pieces, 300)
        )
        assert solution.success
        z = float(solution.y[0, -1]) * unit
    return z


def bristle_force(z: float, v: float, p: dict[str, float]) -> float:
    slip = alpha(z, float(np.sign(v)), steady(v, p) / p["sigma0"], p["z_ba"])
    z_dot = v * (1.0 - slip * np.sign(v) * z * p["sigma0"] / steady(v, p))
    return p["sigma0"] * z + p["sigma1"] * z_dot + p["sigma2"] * v


def test_b18_deflections_by_quadrature(plastic: Library) -> None:
    """The path from z_ba to z is the integral of dz / (1 - alpha z / z_ss)."""
    v, p = 2e-3, P95 | {"z_ba": 0.7e-5}
    z_max = steady(v, p) / 1e5

    def path(z: float) -> float:
        return quad(lambda x: 1.0 / (1.0 - alpha(x, 1.0, z_max, 0.7e-5) * x / z_max), 0.7e-5, z, epsrel=1e-13)[0] + 7e-6

    z_5, z_8 = (brentq(lambda z, t=t: path(z) - v * t, 0.7e-5, z_max * (1 - 1e-9), xtol=1e-22) for t in (5e-3, 8e-3))
    assert [z_5, z_8] == pytest.approx([9.05064852e-6, 9.81958549e-6], rel=1e-8)
    assert bristle_force(z_5, v, p) == pytest.approx(1.11551077, rel=1e-8)
    for s in (1.0, -1.0):
        for pieces in (1, 3, 100):
            with Instance(plastic) as run:
                run.initialise(v=s * v)
                found = []
                for end, begin in ((3e-3, 0.0), (5e-3, 3e-3), (8e-3, 5e-3)):
                    for _ in range(pieces):
                        run.step(run.get1("time"), (end - begin) / pieces)
                    found.append(run.get("z", "F"))
            assert [z for z, _ in found] == pytest.approx([s * 6e-6, s * z_5, s * z_8], rel=1e-11)
            assert found[1][1] == pytest.approx(s * bristle_force(z_5, v, p), rel=1e-10)
    assert forces(plastic, [(v, 1.0)])[0] == pytest.approx(steady(v, p) + 0.4 * v, rel=1e-12)
    assert steady(v, p) + 0.4 * v == pytest.approx(1.00995782, rel=1e-8)


@reproducibly
@given(
    v=st.floats(1e-5, 0.3),
    s=st.sampled_from([1.0, -1.0]),
    path=st.floats(0.0, 30.0),
    h=st.sampled_from(STEPS),
    start=st.floats(-1.3, 1.3),
    sigma0=st.floats(1e3, 1e6),
    Fc=friction_level,
    ratio=st.floats(0.5, 3.0),
    z_ba=st.floats(0.0, 0.99),
    delta=st.sampled_from([0.5, 1.0, 1.7, 2.0]),
)
def test_a_step_of_the_bristles_at_constant_velocity(
    plastic: Library, v: float, s: float, path: float, h: float, start: float, ratio: float, z_ba: float, **p: float
) -> None:
    """v h of up to 30 deflections; the Stribeck velocity is scaled along, so that v is somewhere on the curve."""
    unit = p["Fc"] / p["sigma0"]
    scale = path * unit / h / v
    p |= {"Fs": ratio * p["Fc"], "vs": max(0.05 * scale, 1e-9), "z_ba": z_ba * min(1.0, ratio) * unit, "sigma1": 10.0}
    p["sigma2"] = 0.1
    v = s * v * scale
    expected = followed(start * unit, v, 0.0, h, p)
    with Instance(plastic) as run:
        run.initialise(v=v, z=start * unit, **p)
        run.step(0.0, h)
        assert abs(run.get1("z") - expected) < 1e-9 * max(1.0, ratio) * unit
        z = run.get1("z")
        assert run.get1("F") == pytest.approx(bristle_force(z, v, p), rel=1e-10, abs=1e-9 * p["Fc"])


@pytest.mark.parametrize("v", [2e-3, -3e-4, 0.05, 1.0])
@pytest.mark.parametrize("z", [0.0, 0.7e-5, -1e-5, 1.2e-5])
def test_how_a_span_of_the_bristles_is_cut_does_not_matter(plastic: Library, v: float, z: float) -> None:
    expected = followed(z, v, 0.0, 0.02, P95 | {"z_ba": 0.7e-5}) if abs(v) < 0.5 else math.copysign(1e-5, v)
    for pieces in (1, 7, 1000):
        with Instance(plastic) as run:
            run.initialise(v=v, z=z)
            for _ in range(pieces):
                run.step(run.get1("time"), 0.02 / pieces)
            assert abs(run.get1("z") - expected) * 1e5 < 1e-9 * 1.5


def test_from_the_limit_of_break_away_it_never_passes_the_steady_deflection(plastic: Library) -> None:
    """The approach to z_max(v) is exponential; a deflection beyond it, as v rises, relaxes back."""
    with Instance(plastic) as run:
        run.initialise(v=1e-5, z=0.7e-5)
        last = 0.0
        for _ in range(400):
            run.step(run.get1("time"), 0.02)
            z = run.get1("z")
            assert last <= z <= steady(1e-5, P95) / 1e5
            last = z
        run.set({"v": 5e-3})
        run.step(run.get1("time"), 1e-3)
        assert run.get1("z") == pytest.approx(1e-5 + (last - 1e-5) * math.exp(-0.5), rel=1e-9)


@pytest.mark.parametrize("cycles", [1, 1000])
def test_below_break_away_the_contact_is_elastic_to_the_last_bit(plastic: Library, cycles: int) -> None:
    """Steps that are binary fractions, so that their sums are exact."""
    v, h = 2.0**-10, 2.0**-10
    with Instance(plastic) as run:
        run.initialise(z=2.0**-18, sigma1=0.0, sigma2=0.0)
        for _ in range(cycles):
            for direction in (1.0, -1.0, -1.0, 1.0):
                run.set({"v": direction * v})
                run.step(run.get1("time"), h)
                assert run.get1("elastic") == 1.0
        assert run.get1("z") == 2.0**-18


@few
@given(start=st.floats(0.7, 1.0), x=st.floats(1e-9, 0.7e-5), h=st.sampled_from(STEPS))
def test_unloading_is_elastic_from_any_deflection(plastic: Library, start: float, x: float, h: float) -> None:
    """sgn z /= sgn v: no slip, however large |z|."""
    for s in (1.0, -1.0):
        z = s * start * 1.5e-5
        with Instance(plastic) as run:
            run.initialise(z=z, v=-s * x / h)
            assert run.get1("elastic") == 1.0
            run.step(0.0, h)
            assert run.get1("z") == pytest.approx(z - s * x, rel=1e-14)


def test_it_slips_in_both_directions_alike_where_the_sine_of_z_itself_would_not(plastic: Library) -> None:
    positive = forces(plastic, [(2e-3, 1e-3)] * 20)
    assert [-F for F in forces(plastic, [(-2e-3, 1e-3)] * 20)] == positive
    assert abs(positive[-1]) < 1.02


RAMPS = [  # v at the start, slope, duration
    (1e-4, 0.05, 0.02),
    (-2e-3, 1.0, 5e-3),
    (3e-3, -0.6, 0.01),
    (0.0, 0.1, 0.02),
    (0.0, -20.0, 0.01),
    (0.1, -10.0, 0.02),
    (-1e-6, 1e-3, 0.02),
    (0.02, -40.0, 1e-3),
    (0.05, -2.5, 0.02),
    (4e-3, -0.19, 0.02),
]


@pytest.mark.parametrize(("v", "slope", "h"), RAMPS)
@pytest.mark.parametrize("z", [0.0, -9e-6, 1.2e-5])
@pytest.mark.parametrize("delta", [2.0, 1.0])
def test_the_bristles_follow_a_ramp_through_its_reversal(
    plastic: Library, v: float, slope: float, h: float, z: float, delta: float
) -> None:
    p = P95 | {"z_ba": 0.7e-5, "delta": delta}
    expected = followed(z, v, slope, h, p)
    for pieces in (1, 5):
        with Instance(plastic) as run:
            run.initialise(z=z, delta=delta)
            for k in range(pieces):
                run.set({"v": v + slope * h * k / pieces})
                assert run.input_derivatives({"v": slope}) == OK
                run.step(h * k / pieces, h / pieces)
            assert abs(run.get1("z") - expected) * 1e5 < 1e-7 * 1.5
            assert abs(run.get1("F") - bristle_force(expected, v + slope * h, p)) < 1e-6 * 1.5


@few
@given(
    begin=st.floats(0.0, 1.0),
    end=st.floats(0.0, 1.0),
    s=st.sampled_from([1.0, -1.0]),
    path=st.floats(0.01, 20.0),
    h=st.sampled_from(STEPS),
    start=st.floats(-1.3, 1.3),
    width=st.floats(0.01, 3.0),
    ratio=st.floats(0.6, 2.0),
    delta=st.sampled_from([0.5, 1.0, 1.7, 2.0]),
    z_ba=st.floats(0.0, 0.95),
    name=st.sampled_from(["LuGre", "ElastoPlastic"]),
)
def test_bristles_on_random_ramps(
    block: Callable[[str], Library],
    begin: float,
    end: float,
    s: float,
    path: float,
    h: float,
    start: float,
    width: float,
    ratio: float,
    delta: float,
    z_ba: float,
    name: str,
) -> None:
    """Speeds in units of `path` deflections a step, a Stribeck curve about as wide; 1e-6 of Fs."""
    sigma0, Fc, unit = 1e5, 1.0, 1e-5
    p = {"sigma0": sigma0, "Fc": Fc, "Fs": ratio * Fc, "delta": delta, "vs": width * path * unit / h}
    own = {"z_ba": z_ba * min(1.0, ratio) * unit}
    v, slope = s * begin * path * unit / h, s * (end - begin) * path * unit / h / h
    expected = followed(start * unit, v, slope, h, p | own, "plastic" if name == "ElastoPlastic" else "LuGre")
    given_values = p | (own if name == "ElastoPlastic" else {})
    assume(slope != 0.0)
    (z,) = ramp(block(name), v, slope, h, "z", z=start * unit, **given_values)
    assert abs(z - expected) * sigma0 < 3e-7 * max(1.0, ratio)


def test_the_elastic_range_ends_where_the_level_passes_it(plastic: Library) -> None:
    """Braking raises z_max = S/sigma0; up to z_ba, z is at that limit; above, the law holds with z below it."""
    v, passed, end, slope = 1.37e-3, 1.18e-3, 1.05e-3, -0.1
    p = {**P95, "z_ba": steady(passed, P95) / P95["sigma0"]}
    expected = followed(p["z_ba"], passed, slope, (end - passed) / slope, p)
    (z,) = ramp(plastic, v, slope, (end - v) / slope, "z", z=steady(v, p) / p["sigma0"], **p)
    assert abs(z - expected) * p["sigma0"] < 1e-6 * p["Fs"]
    assert steady(end, p) - z * p["sigma0"] > 1e-3


@pytest.mark.parametrize("name", ["LuGre", "ElastoPlastic"])
@pytest.mark.parametrize("speed", [0.05, 1.0, 50.0])
def test_a_narrow_stribeck_curve_at_the_end_of_a_long_ramp_is_seen(
    block: Callable[[str], Library], name: str, speed: float
) -> None:
    """Braking to a stop in 20 ms raises z towards Fs/sigma0 within the last vs of speed."""
    h, p = 0.02, P95 | {"z_ba": 0.7e-5, "vs": 2e-2 * speed, "sigma0": 20.0 / speed * 100.0}
    p["z_ba"] = 0.5 / p["sigma0"]
    expected = followed(0.0, speed, -speed / h, h, p, "plastic" if name == "ElastoPlastic" else "LuGre")
    values = {key: p[key] for key in ("vs", "sigma0", *(["z_ba"] if name == "ElastoPlastic" else []))}
    (z,) = ramp(block(name), speed, -speed / h, h, "z", **values)
    assert abs(z - expected) * p["sigma0"] < 1e-6 * 1.5


def test_a_break_away_deflection_above_the_steady_one_gives_maxwell_slip(plastic: Library) -> None:
    """z_ba >= Fs/sigma0 is outside the paper; the limit is elastic-perfectly plastic."""
    steps = [(3e-3 * math.sin(0.7 * k), 3e-3) for k in range(60)]
    for z_ba in (1e-5, 1.3e-5, 1.0):
        z = 0.0
        found = forces(plastic, steps, Fs=1.0, z_ba=z_ba, sigma1=0.0, sigma2=0.0)
        for (v, h), F in zip(steps, found, strict=True):
            z = min(max(z + v * h, -1e-5), 1e-5)
            assert pytest.approx(1e5 * z, abs=1e-11) == F


# ---- identities


@few
@given(steps=trajectory, slope=st.sampled_from([0.0, 0.3, -5.0]), Fc=friction_level, sigma=stiffness)
def test_b17_laws_that_are_each_other(
    dahl: Library,
    bliman_1: Library,
    lugre: Library,
    plastic: Library,
    steps: list[tuple[float, float]],
    slope: float,
    Fc: float,
    sigma: float,
) -> None:
    """LuGre without Stribeck effect and damping, and first order Bliman-Sorine, are Dahl with n = 1; Dahl with n = 0
    and elasto-plastic bristles that break away at their limit are one Maxwell slip element."""
    bristles = {"sigma0": sigma, "sigma1": 0.0, "sigma2": 0.0, "Fc": Fc, "Fs": Fc}
    reference = pytest.approx(forces(dahl, steps, slope, Fc=Fc, sigma=sigma), abs=1e-12 * Fc)
    assert forces(lugre, steps, slope, **bristles) == reference
    assert forces(bliman_1, steps, slope, f1=Fc, eps=Fc / sigma) == reference
    F, element = 0.0, []
    for v, h in steps:
        for x in paths(v, slope, h):
            F = min(max(F + sigma * x, -Fc), Fc)
        element.append(F)
    maxwell = pytest.approx(element, abs=1e-12 * Fc)
    assert forces(dahl, steps, slope, Fc=Fc, sigma=sigma, n=0.0) == maxwell
    assert forces(plastic, steps, slope, z_ba=Fc / sigma, **bristles) == maxwell


def test_first_order_bliman_sorine_has_no_slow_element(bliman_1: Library) -> None:
    assert forces(bliman_1, [(1.0, 1.0)], F_slow=5.0) == pytest.approx([1.8], rel=1e-14)
    with Instance(bliman_1) as run:
        run.initialise(v=1.0, F_slow=5.0)
        run.step(0.0, 1.0)
        assert run.get("F_slow", "der(F_slow)") == [5.0, 0.0]


# ---- what holds for each of these laws

STATES = {"BlimanSorine": ("F_fast", "F_slow")}
VISCOUS = {"LuGre": 0.4, "ElastoPlastic": 0.4}


@pytest.mark.parametrize("name", MODELS)
@few
@given(steps=trajectory, Fn=st.floats(-2.0, 5.0), Fn0=st.floats(0.1, 5.0))
def test_the_normal_force_multiplies_contact_forces_and_leaves_deflections(
    block: Callable[[str], Library], name: str, steps: list[tuple[float, float]], Fn: float, Fn0: float
) -> None:
    library, load_factor = block(name), max(Fn, 0.0) / Fn0
    with Instance(library) as plain, Instance(library) as loaded:
        plain.initialise()
        loaded.initialise(Fn=Fn, Fn0=Fn0)
        t = 0.0
        for v, h in steps:
            for run in (plain, loaded):
                run.set({"v": v})
                run.step(t, h)
            t += h
            viscous = VISCOUS.get(name, 0.0) * v
            expected = load_factor * (plain.get1("F") - viscous) + viscous
            assert loaded.get1("F") == pytest.approx(expected, rel=1e-12, abs=1e-12 * (1.0 + abs(viscous)))
            states = STATES.get(name, ("z",))
            assert loaded.get(*states) == plain.get(*states)


@pytest.mark.parametrize("name", MODELS)
def test_a_normal_force_that_changes_during_the_step_counts_at_its_end(
    block: Callable[[str], Library], name: str
) -> None:
    with Instance(block(name)) as plain, Instance(block(name)) as loaded:
        plain.initialise(v=1e-3)
        loaded.initialise(v=1e-3, Fn=-1.0)
        assert loaded.input_derivatives({"Fn": 300.0}) == OK  # opens, closes: through zero
        for run in (plain, loaded):
            run.step(0.0, 0.01)
        viscous = VISCOUS.get(name, 0.0) * 1e-3
        assert loaded.get1("F") == pytest.approx(2.0 * (plain.get1("F") - viscous) + viscous, rel=1e-9)


@pytest.mark.parametrize("name", MODELS)
@few
@given(steps=trajectory, slope=st.sampled_from([0.0, 0.3, -5.0]))
def test_these_laws_are_odd(
    block: Callable[[str], Library], name: str, steps: list[tuple[float, float]], slope: float
) -> None:
    positive = forces(block(name), steps, slope)
    assert [-F for F in forces(block(name), [(-v, h) for v, h in steps], -slope)] == positive


@pytest.mark.parametrize("name", MODELS)
@few
@given(steps=trajectory, slope=st.sampled_from([0.0, 0.3, -5.0]))
def test_deflections_stay_bounded_and_friction_takes_out_more_than_the_bristles_store(
    block: Callable[[str], Library], name: str, steps: list[tuple[float, float]], slope: float
) -> None:
    """sigma0 z (v - dz/dt) >= 0; for the linear law of order 2, which may give back, bounds only."""
    with Instance(block(name)) as run:
        run.initialise()
        t = 0.0
        for v, h in steps:
            run.set({"v": v})
            assert run.input_derivatives({"v": slope}) == OK
            run.step(t, h)
            t += h
            if name == "BlimanSorine":
                fast, slow = run.get("F_fast", "F_slow")
                assert abs(fast) <= 1.8 * (1.0 + 1e-15) and abs(slow) <= 0.8 * (1.0 + 1e-15)
                continue
            z, z_dot, now = run.get("z", "der(z)", "v")
            assert abs(z) <= {"LuGre": 1.5e-5, "ElastoPlastic": 1.5e-5}.get(name, 1e-5) * (1.0 + 1e-8)
            assert z * (now - z_dot) >= -1e-20 * abs(now)


@pytest.mark.parametrize("name", MODELS)
def test_at_rest_nothing_of_the_contact_moves(block: Callable[[str], Library], name: str) -> None:
    states = STATES.get(name, ("z",))
    with Instance(block(name)) as run:
        run.initialise(v=2e-3)
        run.step(0.0, 4e-3)
        run.set({"v": 0.0})
        held = run.get("F", *states)
        run.step(4e-3, 100.0)
        assert run.get("F", *states) == held
        run.set({"v": -0.0})
        run.step(100.004, 1e-6)
        assert run.get("F", *states) == held


LIMITS = {
    "LuGre": [
        {"Fs": 1.0},
        {"Fs": 0.5},
        {"vs": 1e-12},
        {"delta": 1e-3},
        {"delta": 100.0},
        {"sigma1": 0.0, "sigma2": 0.0},
        {"sigma0": 1e-9},
        {"Fc": 1e-9, "Fs": 1e-9},
    ],
    "Dahl": [{"n": 0.0}, {"n": 100.0}, {"n": 1e-9}, {"sigma": 1e-9}, {"Fc": 1e-9}, {"n": 0.5, "sigma": 1e12}],
    "BlimanSorine": [{"eta": 1.0}, {"f2": 0.0}, {"f1": 0.0, "f2": 0.0}, {"eta": 1e-9, "eps": 1e-12}, {"f2": 1.8}],
    "ResetIntegrator": [{"a": 0.0}, {"beta": 0.0}, {"z0": 1e-15}, {"sigma0": 1e-9}],
    "ElastoPlastic": [
        {"z_ba": 0.0},
        {"z_ba": 1e-5},
        {"z_ba": 1.0},
        {"z_ba": 0.9999999999e-5},
        {"Fs": 1.0},
        {"Fs": 0.5},
        {"Fs": 0.9, "z_ba": 0.95e-5},
        {"vs": 1e-12},
        {"delta": 1e-3},
        {"delta": 100.0},
        {"sigma1": 0.0, "sigma2": 0.0},
        {"sigma0": 1e-9},
        {"Fc": 1e-9, "Fs": 1e-9},
    ],
}


@pytest.mark.parametrize(("name", "values"), [(name, each) for name, sets in LIMITS.items() for each in sets])
def test_parameters_at_their_limits_give_numbers(
    block: Callable[[str], Library], name: str, values: dict[str, float]
) -> None:
    steps = [(v, h) for h in (1e-6, 1e-3, 0.02) for v in (0.0, 1e-9, 2e-3, -1e-3, 0.3, -10.0, 0.0)]
    for slope in (0.0, 0.1, -30.0):
        found = forces(block(name), steps, slope, **values)
        assert all(map(math.isfinite, found)), values


@pytest.mark.parametrize(("v", "z"), [(1e-5, 0.0), (-2e-3, 4e-6), (0.4, -1e-5)])
def test_damping_that_fades_with_speed(plastic: Library, v: float, z: float) -> None:
    v_d, p = 1e-3, P95 | {"z_ba": 0.7e-5}
    with Instance(plastic) as run:
        run.initialise(v=v, z=z, v_d=v_d)
        p["sigma1"] *= math.exp(-((v / v_d) ** 2))
        assert run.get1("F") == pytest.approx(bristle_force(z, v, p), rel=1e-12)
