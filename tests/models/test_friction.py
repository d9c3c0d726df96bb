"""LuGre and Stribeck against closed forms, published numbers and scipy."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from ctypes import c_double, c_uint
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from shell.instance import OK, Instance, Library, load
from thorough import few, nightly, some

P95 = {"sigma0": 1e5, "sigma1": math.sqrt(1e5), "sigma2": 0.4, "Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "delta": 2.0}

reproducibly = settings(max_examples=few(150), deadline=20_000, derandomize=True, database=None)
velocities = st.one_of(st.floats(-5e-3, 5e-3), st.floats(-1.0, 1.0), st.sampled_from([0.0, 1e-9, -1e-9, 30.0, -30.0]))
level = st.floats(0.05, 20.0)
exponent = st.floats(0.3, 4.0)
stribeck_velocity = st.floats(1e-4, 0.1)


@pytest.fixture(scope="module")
def lugre(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("LuGre"))


@pytest.fixture(scope="module")
def stribeck(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("Stribeck"))


def steady(v: float, p: dict[str, float]) -> float:
    """Fc + (Fs - Fc) exp(-|v/vs|^delta)."""
    return p["Fc"] + (p["Fs"] - p["Fc"]) * math.exp(-((abs(v) / p["vs"]) ** p["delta"]))


def relaxed(z: float, v: float, h: float, p: dict[str, float]) -> float:
    """z after h at constant v: z_ss + (z - z_ss) exp(-sigma0 |v| h / g), in extended precision."""
    extended = np.longdouble
    g = extended(steady(v, p))
    z_ss = extended(np.sign(v)) * g / extended(p["sigma0"])
    return float(z_ss + (extended(z) - z_ss) * np.exp(-extended(p["sigma0"]) * abs(extended(v)) * extended(h) / g))


def bristle_force(z: float, v: float, p: dict[str, float]) -> float:
    return p["sigma0"] * z + p["sigma1"] * (v - p["sigma0"] * abs(v) * z / steady(v, p)) + p["sigma2"] * v


# ---- LuGre at constant velocity


def test_b01_bristles_relax_as_in_the_closed_form(lugre: Library) -> None:
    v, tabulated = (
        2e-3,
        {1e-3: (1.814283586e-6, 0.70097980), 5e-3: (6.345250987e-6, 0.87011349), 0.02: (None, 1.00280323)},
    )
    assert steady(v, P95) == pytest.approx(1.009157819, abs=1e-9)
    for t, (z_tabulated, F_tabulated) in tabulated.items():
        with Instance(lugre) as run:
            run.initialise(v=v)
            run.step(0.0, t)
            z, F = run.get("z", "F")
        assert z == pytest.approx(relaxed(0.0, v, t, P95), rel=1e-13)
        assert pytest.approx(bristle_force(relaxed(0.0, v, t, P95), v, P95), rel=1e-12) == F
        assert pytest.approx(F_tabulated, abs=1e-8) == F
        assert z_tabulated is None or z == pytest.approx(z_tabulated, rel=1e-9)


@reproducibly
@given(
    v=velocities,
    h=st.floats(1e-6, 0.02),
    start=st.floats(-1.0, 1.0),
    sigma0=st.floats(1e2, 1e7),
    sigma1=st.floats(0.0, 1e3),
    sigma2=st.floats(0.0, 10.0),
    Fc=level,
    Fs=level,
    vs=stribeck_velocity,
    delta=exponent,
)
def test_a_step_at_constant_velocity_is_exact(lugre: Library, v: float, h: float, start: float, **p: float) -> None:
    z = start * max(p["Fc"], p["Fs"]) / p["sigma0"]
    with Instance(lugre) as run:
        run.initialise(v=v, z=z, **p)
        t = 0.0
        for _ in range(3):
            run.step(t, h)
            z, t = relaxed(z, v, h, p), t + h
            assert run.get1("z") == pytest.approx(z, rel=1e-12, abs=1e-15 * max(p["Fc"], p["Fs"]) / p["sigma0"])
            largest = (
                1e-3 * max(p["Fc"], p["Fs"]) + p["sigma0"] * abs(z) + 2.0 * p["sigma1"] * abs(v) + p["sigma2"] * abs(v)
            )
            slack = 1e-12 * largest + 1e-14 * p["sigma1"] * p["sigma0"] * abs(v * z) / steady(v, p)
            assert run.get1("F") == pytest.approx(bristle_force(z, v, p), rel=1e-12, abs=slack)


@pytest.mark.parametrize("v", [2e-3, -1e-4, 0.5])
def test_how_a_span_is_cut_does_not_matter(lugre: Library, v: float) -> None:
    expected = relaxed(4e-6, v, 0.01, P95)
    for pieces in (1, 2, 7, 100, 3000):
        with Instance(lugre) as run:
            run.initialise(v=v, z=4e-6)
            for k in range(pieces):
                run.step(0.01 * k / pieces, 0.01 / pieces)
            assert run.get1("z") == pytest.approx(expected, rel=1e-12)


def test_at_rest_nothing_moves(lugre: Library) -> None:
    with Instance(lugre) as run:
        run.initialise(z=3e-6)
        run.step(0.0, 1000.0)
        assert run.get("z", "F") == [3e-6, 1e5 * 3e-6]


def test_a_long_step_at_speed_ends_on_the_stribeck_curve(lugre: Library) -> None:
    for v in (-20.0, -1e-3, 1e-4, 2e-3, 0.1, 100.0):
        with Instance(lugre) as run:
            run.initialise(v=v)
            run.step(0.0, 1e4)
            expected = math.copysign(steady(v, P95), v) + 0.4 * v
            assert run.get1("F") == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("v", "F"), [(0.005, 0.711431), (0.01, -0.077139), (0.05, -6.385694)])
def test_b38_a_jump_of_velocity_makes_friction_push(lugre: Library, v: float, F: float) -> None:
    with Instance(lugre) as run:
        run.initialise(v=v, z=1.5 / 1e5)
        assert run.get1("F") == pytest.approx(F, abs=5e-7)
        assert run.get1("F") == pytest.approx(bristle_force(1.5e-5, v, P95), rel=1e-12)


def test_bristle_damping_that_fades_with_speed_keeps_friction_dissipative(lugre: Library) -> None:
    """Below v_d = 4 sqrt(2 e) Fc / sigma1 the force never pushes, from any z that can be reached."""
    v_d = 0.99 * 4.0 * math.sqrt(2.0 * math.e) / P95["sigma1"]
    for v in np.geomspace(1e-6, 10.0, 60):
        for z in np.linspace(-1.5e-5, 1.5e-5, 7):
            with Instance(lugre) as run:
                run.initialise(v=v, z=z, v_d=v_d)
                z_dot = v - 1e5 * v * z / steady(v, P95)
                expected = 1e5 * z + P95["sigma1"] * math.exp(-((v / v_d) ** 2)) * z_dot + 0.4 * v
                assert run.get1("F") == pytest.approx(expected, rel=1e-11, abs=1e-12)
                # the storage function sigma0 z^2 / 2 cannot grow by more than what is put in
                assert v * expected - 1e5 * z * z_dot >= -1e-12


@reproducibly
@given(v=velocities, z=st.floats(-1e-5, 1e-5), h=st.floats(1e-5, 0.01))
def test_friction_is_odd(lugre: Library, v: float, z: float, h: float) -> None:
    results = []
    for sign in (1.0, -1.0):
        with Instance(lugre) as run:
            run.initialise(v=sign * v, z=sign * z)
            run.step(0.0, h)
            results.append([sign * value for value in run.get("z", "F", "der(z)")])
    assert results[0] == results[1]


@reproducibly
@given(
    Fs=level,
    Fc=level,
    steps=st.lists(st.tuples(velocities, st.floats(-10.0, 10.0), st.floats(1e-5, 0.01)), min_size=1, max_size=6),
)
def test_the_deflection_stays_within_the_break_away_level(
    lugre: Library, Fs: float, Fc: float, steps: list[tuple[float, float, float]]
) -> None:
    """|z| <= max(Fs, Fc) / sigma0, for held velocities and for such that change linearly."""
    with Instance(lugre) as run:
        run.initialise(Fs=Fs, Fc=Fc)
        t = 0.0
        for v, slope, h in steps:
            run.set({"v": v})
            assert run.input_derivatives({"v": slope}) == OK
            run.step(t, h)
            t += h
            assert abs(run.get1("z")) <= max(Fs, Fc) / 1e5 * (1.0 + 1e-8)


# ---- LuGre at changing velocity


def integrated(z: float, v: float, slope: float, h: float, sets: Callable[[float], dict[str, float]]) -> float:
    """z(h) by scipy for v + slope s, in pieces that do not cross v = 0; `sets(v)` gives the parameters."""
    zero = -v / slope
    pieces = [0.0, *([zero] if 0.0 < zero < h else []), h]
    for begin, end in itertools.pairwise(pieces):
        p = sets(v + slope * (begin + end) / 2.0)

        def rate(s: float, y: np.ndarray, p: dict[str, float] = p) -> np.ndarray:
            speed = v + slope * s
            return speed - p["sigma0"] * abs(speed) * y / steady(speed, p)

        def jacobian(s: float, _: np.ndarray, p: dict[str, float] = p) -> list[list[float]]:
            speed = v + slope * s
            return [[-p["sigma0"] * abs(speed) / steady(speed, p)]]

        solution = solve_ivp(rate, (begin, end), [z], "Radau", rtol=1e-11, atol=1e-18, jac=jacobian)
        assert solution.success
        z = float(solution.y[0, -1])
    return z


RAMPS = [  # v at the start, slope, duration
    (1e-4, 0.05, 0.02),
    (-2e-3, 1.0, 5e-3),
    (3e-3, -0.6, 0.01),
    (0.0, 0.1, 0.02),
    (0.0, -20.0, 0.01),
    (0.1, -10.0, 0.02),
    (-1e-6, 1e-3, 0.02),
    (1.0, -1e-3, 0.02),
    (0.02, -40.0, 1e-3),
]


@pytest.mark.parametrize(("v", "slope", "h"), some(RAMPS, RAMPS[::3]))
@pytest.mark.parametrize("z", [0.0, -9e-6, 1.2e-5])
def test_a_linear_velocity_is_integrated_through_its_reversal(
    lugre: Library, v: float, slope: float, h: float, z: float
) -> None:
    expected = integrated(z, v, slope, h, lambda _: P95)
    with Instance(lugre) as run:
        run.initialise(v=v, z=z)
        assert run.input_derivatives({"v": slope}) == OK
        run.step(0.0, h)
        assert abs(run.get1("z") - expected) * 1e5 < 1e-8 * 1.5
        assert abs(run.get1("F") - bristle_force(expected, v + slope * h, P95)) < 1e-6 * 1.5


@pytest.mark.parametrize(("v", "slope", "h"), some(RAMPS[:6], RAMPS[:6:3]))
def test_a_linear_velocity_uses_the_parameters_of_its_direction(
    lugre: Library, v: float, slope: float, h: float
) -> None:
    negative = P95 | {"Fc": 0.7, "Fs": 2.0, "vs": 3e-3, "delta": 1.0, "sigma2": 3.0}
    expected = integrated(0.0, v, slope, h, lambda speed: P95 if speed >= 0.0 else negative)
    with Instance(lugre) as run:
        own = {f"{name}_neg": negative[name] for name in ("Fc", "Fs", "vs", "delta", "sigma2")}
        run.initialise(v=v, asymmetric=1, **own)
        assert run.input_derivatives({"v": slope}) == OK
        run.step(0.0, h)
        end = v + slope * h
        assert abs(run.get1("z") - expected) * 1e5 < 1e-8 * 2.0
        F = bristle_force(expected, end, P95 if end >= 0.0 else negative)
        assert abs(run.get1("F") - F) < 2e-6


@pytest.mark.parametrize("v", [-5e-324, -1e-320, -1e-308, -1e-300, -1e-200, -1e-20])
def test_a_reversal_right_after_the_start_of_the_step_is_passed(lugre: Library, v: float) -> None:
    """A velocity that has decayed to almost nothing, even to a subnormal number, and turns."""
    expected = integrated(-3e-6, 0.0, 1.0, 1e-3, lambda _: P95)
    with Instance(lugre) as run:
        run.initialise(v=v, z=-3e-6)
        assert run.input_derivatives({"v": 1.0}) == OK
        run.step(0.0, 1e-3)
        assert abs(run.get1("z") - expected) * 1e5 < 1e-8 * 1.5


def test_a_stop_at_the_end_of_the_step_is_reached_exactly(lugre: Library) -> None:
    with Instance(lugre) as run:
        run.initialise(v=0.01)
        assert run.input_derivatives({"v": -10.0}) == OK
        run.step(0.0, 1e-3)
        v, z = run.get("v", "z")
        assert abs(v) < 1e-17
        assert abs(z - integrated(0.0, 0.01, -10.0, 1e-3, lambda _: P95)) < 1e-8 * 1.5e-5


# ---- LuGre with a set of its own for v < 0


@reproducibly
@given(
    v=velocities,
    z=st.floats(-1e-5, 1e-5),
    h=st.floats(1e-5, 0.02),
    Fc=level,
    Fs=level,
    vs=stribeck_velocity,
    delta=exponent,
)
def test_the_asymmetric_set_counts_for_negative_velocity_only(
    lugre: Library, v: float, z: float, h: float, **negative: float
) -> None:
    own = {f"{name}_neg": value for name, value in negative.items()} | {"sigma2_neg": 7.0}
    p = P95 | negative | {"sigma2": 7.0} if v < 0.0 else P95
    with Instance(lugre) as run:
        run.initialise(v=v, z=z, asymmetric=1, **own)
        run.step(0.0, h)
        expected = relaxed(z, v, h, p)
        assert run.get1("z") == pytest.approx(expected, rel=1e-12, abs=1e-19)
        slack = 1e-11 * (1.0 + p["sigma1"] * abs(v) * (1.0 + 1e5 * abs(expected) / steady(v, p)))
        assert run.get1("F") == pytest.approx(bristle_force(expected, v, p), rel=1e-11, abs=slack)


def test_the_negative_set_is_idle_while_asymmetric_is_false(lugre: Library) -> None:
    with Instance(lugre) as plain, Instance(lugre) as other:
        plain.initialise(v=-2e-3)
        other.initialise(v=-2e-3, Fc_neg=9.0, Fs_neg=9.0, vs_neg=1.0, delta_neg=1.0, sigma2_neg=9.0)
        for run in (plain, other):
            run.step(0.0, 1e-3)
        assert plain.get("z", "F") == other.get("z", "F")


def test_a_parameter_may_change_between_steps(lugre: Library) -> None:
    v, z = 2e-3, 0.0
    with Instance(lugre) as run:
        run.initialise(v=v)
        for k, Fc in enumerate((1.0, 1.4, 0.6)):
            run.set({"Fc": Fc})
            run.step(2e-3 * k, 2e-3)
            z = relaxed(z, v, 2e-3, P95 | {"Fc": Fc})
            assert run.get1("z") == pytest.approx(z, rel=1e-12)


# ---- LuGre with a mass


def coupled(
    mass: Instance, friction: Instance, h: float, stop: float, observe: Callable[[float, float, float], None]
) -> None:
    """Gauss-Seidel: friction with the velocity of now, the mass with the friction force of then."""
    step = mass.library.handle.fmi2DoStep, friction.library.handle.fmi2DoStep
    set_mass, set_friction = mass.library.handle.fmi2SetReal, friction.library.handle.fmi2SetReal
    get_mass, get_friction = mass.library.handle.fmi2GetReal, friction.library.handle.fmi2GetReal
    state, force = (c_uint * 2)(mass.reference("v"), mass.reference("x")), (c_uint * 1)(friction.reference("F"))
    v_in, F_in = (c_uint * 1)(friction.reference("v")), (c_uint * 1)(mass.reference("F_friction"))
    values, F = (c_double * 2)(*mass.get("v", "x")), c_double()
    one, two = mass.pointer, friction.pointer
    for k in range(round(stop / h)):
        t = k * h
        failed = set_friction(two, v_in, 1, values) or step[1](two, t, h, 1) or get_friction(two, force, 1, F)
        failed = failed or set_mass(one, F_in, 1, F) or step[0](one, t, h, 1) or get_mass(one, state, 2, values)
        assert not failed, (mass.messages, friction.messages)
        observe(t + h, values[0], values[1])


@pytest.fixture(scope="module")
def stick_slip(build_fmu: Callable[..., Path], lugre: Library) -> Callable[[float], dict[str, float]]:
    """Case B5 with a communication step: m = 1 kg, k = 2 N/m, pulled at 0.1 m/s."""

    def simulate(h: float) -> dict[str, float]:
        slips: list[float] = []
        last = [0.0, 0.0]
        seen = {"v_max": 0.0, "F_max": 0.0, "x_20": math.nan}

        def observe(t: float, v: float, x: float) -> None:
            if last[1] < 0.05 <= v:
                slips.append(last[0] + (t - last[0]) * (0.05 - last[1]) / (v - last[1]))
            last[:] = t, v
            seen["v_max"] = max(seen["v_max"], v)
            seen["F_max"] = max(seen["F_max"], 2.0 * (0.1 * t - x))
            if abs(t - 20.0) < h / 2:
                seen["x_20"] = x

        with Instance(load(build_fmu("Mass"))) as mass, Instance(lugre) as friction:
            mass.initialise(k=2.0, v_support=0.1)
            friction.initialise()
            coupled(mass, friction, h, 34.0, observe)
        return seen | {"first": slips[0], "period": slips[-1] - slips[-2]}

    return simulate


@nightly
def test_b05_co_simulated_stick_slip_converges_to_the_published_numbers(
    stick_slip: Callable[[float], dict[str, float]],
) -> None:
    reference = {"period": 6.36271982, "v_max": 0.369816, "F_max": 1.507988, "first": 7.540397, "x_20": 1.272596}
    by_step = {h: stick_slip(h) for h in (1e-3, 5e-4, 2.5e-4)}
    coarse, middle, fine = (
        {name: abs(run[name] / reference[name] - 1.0) for name in reference} for run in by_step.values()
    )
    assert coarse["period"] < 5e-4
    assert fine["period"] < middle["period"] < coarse["period"]
    assert fine["period"] < 0.35 * coarse["period"]
    for name in reference:
        assert fine[name] < max(coarse[name], 2e-6) and fine[name] < 2e-4, name


# ---- Stribeck


@reproducibly
@given(
    v=velocities.filter(bool),
    F_ext=st.floats(-5.0, 5.0),
    offset=st.floats(-3.0, 3.0),
    asymmetric=st.booleans(),
    positive=st.tuples(level, level, st.floats(0.0, 10.0), stribeck_velocity, exponent),
    negative=st.tuples(level, level, st.floats(0.0, 10.0), stribeck_velocity, exponent),
)
def test_the_sliding_force_is_the_formula(
    stribeck: Library,
    v: float,
    F_ext: float,
    offset: float,
    asymmetric: bool,
    positive: tuple[float, ...],
    negative: tuple[float, ...],
) -> None:
    names = ("Fc", "Fs", "Fv", "vs", "delta")
    one, other = dict(zip(names, positive, strict=True)), dict(zip(names, negative, strict=True))
    p = other if asymmetric and v < 0.0 else one
    with Instance(stribeck) as run:
        own = {f"{name}_neg": value for name, value in other.items()}
        run.initialise(v=v, F_ext=F_ext, offset=offset, asymmetric=asymmetric, **one, **own)
        expected = math.copysign(steady(v, p), v) + p["Fv"] * v + offset
        assert run.get("F", "stuck") == pytest.approx([expected, 0.0], rel=1e-12, abs=1e-12)
        run.step(0.0, 0.01)
        assert run.get("F", "stuck") == pytest.approx([expected, 0.0], rel=1e-12, abs=1e-12)


@reproducibly
@given(
    F_ext=st.floats(-30.0, 30.0),
    offset=st.floats(-3.0, 3.0),
    asymmetric=st.booleans(),
    Fs=level,
    Fs_neg=level,
    rest=st.sampled_from([0.0, -0.0]),
)
def test_at_rest_the_external_force_decides(
    stribeck: Library, F_ext: float, offset: float, asymmetric: bool, Fs: float, Fs_neg: float, rest: float
) -> None:
    """Friction is the external force as far as static friction reaches, and then its limit."""
    low, high = offset - (Fs_neg if asymmetric else Fs), offset + Fs
    with Instance(stribeck) as run:
        run.initialise(v=rest, F_ext=F_ext, offset=offset, asymmetric=asymmetric, Fs=Fs, Fs_neg=Fs_neg)
        assert run.get("F", "stuck") == [min(max(F_ext, low), high), float(low <= F_ext <= high)]


@reproducibly
@given(
    v=velocities,
    F_ext=st.floats(-5.0, 5.0),
    Fc=st.floats(0.0, 5.0),
    Fs=st.floats(0.0, 5.0),
    Fv=st.floats(0.0, 5.0),
    delta=exponent,
)
def test_friction_takes_power_out(stribeck: Library, v: float, F_ext: float, **p: float) -> None:
    with Instance(stribeck) as run:
        run.initialise(v=v, F_ext=F_ext, **p)
        assert v * run.get1("F") >= 0.0


@reproducibly
@given(v=velocities, F_ext=st.floats(-5.0, 5.0), delta=exponent)
def test_without_an_offset_friction_is_odd(stribeck: Library, v: float, F_ext: float, delta: float) -> None:
    forces = []
    for sign in (1.0, -1.0):
        with Instance(stribeck) as run:
            run.initialise(v=sign * v, F_ext=sign * F_ext, delta=delta)
            forces.append(sign * run.get1("F"))
    assert forces[0] == forces[1]


def test_equal_levels_are_coulomb_and_viscous_friction(stribeck: Library) -> None:
    """The measured axis: F = Fc sign(v) + Fv v + offset."""
    Fc, Fv, offset = 20.3935, 203.5034, -3.1648
    with Instance(stribeck) as run:
        run.initialise(Fc=Fc, Fs=Fc, Fv=Fv, offset=offset)
        for v in (-0.2, -1e-6, 1e-6, 0.13):
            run.set({"v": v})
            assert run.get1("F") == pytest.approx(math.copysign(Fc, v) + Fv * v + offset, rel=1e-14)
