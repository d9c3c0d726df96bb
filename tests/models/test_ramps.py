"""Ramps of the velocity with hard parameters: sharp and flat Stribeck curves, levels far apart, fast attraction.

The oracle solves dy/dt = a (1 - y / S(v)) by Gauss quadrature on panels between the powers of two of (v/vs)^delta.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq, minimize_scalar
from shell.instance import OK, Instance, Library, load
from thorough import THOROUGH, few, nightly

reproducibly = settings(max_examples=few(60), deadline=20_000, derandomize=True, database=None)

Curve = Callable[[np.ndarray], np.ndarray]

unit_speed = st.one_of(st.floats(0.0, 1.0), st.just(0.0))
POINTS = 16
NODES, WEIGHTS = np.polynomial.legendre.leggauss(POINTS)


def logarithmic(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers of every size between two limits."""
    return st.floats(math.log10(low), math.log10(high)).map(lambda exponent: 10.0**exponent)


def to_the_end() -> np.ndarray:
    """Integrals from each node to 1 of the polynomials that are 1 at one node."""
    values = np.polynomial.legendre.legvander(NODES, POINTS - 1)
    whole = np.polynomial.legendre.legint(np.linalg.inv(values), axis=0)
    return np.polynomial.legendre.legval(1.0, whole)[None, :] - np.polynomial.legendre.legval(NODES, whole).T


TO_THE_END = to_the_end()


@pytest.fixture(scope="module")
def block(build_fmu: Callable[..., Path]) -> Callable[[str], Library]:
    """A block by its name."""
    return lambda name: load(build_fmu(name))


def level(speed: np.ndarray | float, p: dict[str, float]) -> np.ndarray:
    """The Stribeck curve, exact for levels of any ratio."""
    with np.errstate(over="ignore"):
        power = (np.abs(speed) / p["vs"]) ** p["delta"]
    return np.asarray(p["Fs"] * np.exp(-power) - p["Fc"] * np.expm1(-power))


def attracted(y: float, speed: float, growth: float, h: float, pull: Curve, p: dict[str, float]) -> float:
    """y(h) of dy/dt = a (1 - y / S), a = pull(speed), while the speed grows from `speed` without passing zero."""
    last = max(speed + growth * h, 0.0)

    def speeds(back: np.ndarray) -> np.ndarray:
        """Speed a time before the end, exact near both ends."""
        return np.maximum(np.where(2.0 * back < h, last - growth * back, speed + growth * (h - back)), 0.0)

    halves = 2.0 ** -np.arange(1.0, 60.0)
    powers = np.clip(np.arange(-240.0, 48.0) / 4.0 / p["delta"], -1000.0, 1000.0)
    borders = (last - p["vs"] * 2.0**powers) / growth
    grid = np.unique(np.concatenate([[0.0, h], h * halves, h * (1.0 - halves), borders]))
    grid = grid[(grid >= 0.0) & (grid <= h)]
    passed = gained = 0.0
    for begin, end in itertools.pairwise(grid):
        estimate = (end - begin) * np.max(pull(speeds(grid_of(begin, end))) / level(speeds(grid_of(begin, end)), p))
        parts = np.linspace(begin, end, 1 + int(min(max(2.0 * estimate, 1.0), 2000.0)))
        for low, high in itertools.pairwise(parts):
            if passed > 120.0:
                return gained
            at = speeds(0.5 * (low + high) - 0.5 * (high - low) * NODES)
            half, rate = 0.5 * (high - low), pull(at) / level(at, p)
            kept = np.exp(-half * TO_THE_END @ rate)
            gained += math.exp(-passed) * half * float(np.sum(WEIGHTS * pull(at) * kept))
            passed += half * float(np.sum(WEIGHTS * rate))
    return math.exp(-passed) * y + gained


def grid_of(begin: float, end: float) -> np.ndarray:
    """The nodes and the ends of a panel."""
    return np.concatenate([[begin, end], 0.5 * (begin + end) + 0.5 * (end - begin) * NODES])


def pieces(v: float, slope: float, h: float) -> Iterator[tuple[float, float, float]]:
    """(direction, speed, duration) of the parts of a ramp without a change of sign."""
    zero = -v / slope
    for begin, duration in [(v, zero), (0.0, h - zero)] if 0.0 < zero < h else [(v, h)]:
        yield math.copysign(1.0, begin + slope * duration / 2.0), abs(begin), duration


def ramp(library: Library, v: float, slope: float, h: float, *names: str, **values: float) -> list[float]:
    """Values after one step over a ramp."""
    with Instance(library) as run:
        run.initialise(v=v, **values)
        assert run.input_derivatives({"v": slope}) == OK
        run.step(0.0, h)
        return run.get(*names)


@nightly
@reproducibly
@given(
    start=st.floats(-1.0, 1.0),
    ends=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)).filter(lambda e: abs(e[1] - e[0]) > 1e-3),
    span=logarithmic(0.1, 300.0),
    h=logarithmic(1e-6, 0.02),
    sigma0=logarithmic(1e2, 1e7),
    sigma1=logarithmic(0.1, 1e4),
    Fc=logarithmic(1e-3, 1e3),
    ratio=logarithmic(1e-3, 1e3),
    vs=logarithmic(1e-5, 0.1),
    delta=st.one_of(st.floats(2.0, 100.0), logarithmic(0.05, 100.0), st.sampled_from([1.0, 2.0])),
    fades=st.booleans(),
)
def test_lugre_is_exact_for_hard_parameters(
    block: Callable[[str], Library],
    start: float,
    ends: tuple[float, float],
    span: float,
    h: float,
    ratio: float,
    fades: bool,
    **p: float,
) -> None:
    """F, in which sigma1 |v| / g times the error of sigma0 z counts, to 1e-6 Fs and rounding."""
    p["Fs"] = ratio * p["Fc"]
    p["v_d"] = 0.3 * span * p["vs"] if fades else 0.0
    v, slope = ends[0] * span * p["vs"], (ends[1] - ends[0]) * span * p["vs"] / h
    y = start * max(p["Fc"], p["Fs"])
    F = ramp(block("LuGre"), v, slope, h, "F", z=y / p["sigma0"], sigma2=0.0, **p)[0]
    for way, speed, duration in pieces(v, slope, h):
        y = way * attracted(way * y, speed, way * slope, duration, lambda w: p["sigma0"] * w, p)
    v_end = v + slope * h
    damping = p["sigma1"] * (math.exp(-((v_end / p["v_d"]) ** 2)) if fades else 1.0)
    expected = y + damping * (v_end - abs(v_end) * y / float(level(v_end, p)))
    rounding = 1e-14 * (max(p["Fc"], p["Fs"]) * (1.0 + damping * abs(v_end) / float(level(v_end, p))))
    assert abs(F - expected) < 1e-6 * p["Fs"] + rounding


@nightly
@reproducibly
@given(
    ends=st.tuples(unit_speed, unit_speed).filter(lambda e: abs(e[1] - e[0]) > 1e-3),
    span=logarithmic(0.1, 300.0),
    h=logarithmic(1e-6, 0.02),
    C=logarithmic(0.1, 1e14),
    ratio=logarithmic(1e-2, 1e2),
    vs=logarithmic(1e-5, 0.1),
    delta=st.one_of(logarithmic(0.005, 0.2), st.floats(1.0, 100.0)),
)
@example(ends=(1.0, 0.0), span=6e-4, h=0.02, C=2e10, ratio=2.5, vs=0.4, delta=0.0076)
@example(ends=(0.18, 1.0), span=0.11, h=1e-3, C=1.5e13, ratio=1.3e-3, vs=1.7e-4, delta=3.3)
def test_gms_is_exact_for_flat_and_sharp_curves_and_fast_attraction(
    block: Callable[[str], Library],
    ends: tuple[float, float],
    span: float,
    h: float,
    C: float,
    ratio: float,
    **p: float,
) -> None:
    """One element that slips from the start, as it begins above the level; also from rest and to a stop."""
    p |= {"Fc": 1.0, "Fs": ratio}
    v, slope = ends[0] * span * p["vs"], (ends[1] - ends[0]) * span * p["vs"] / h
    start = 1.1 * max(1.0, ratio)
    F = ramp(block("GMS"), v, slope, h, "Fi[1]", C=C, sigma2=0.0, N=1, **{"Fi[1]": start}, **p)[0]
    expected = attracted(start, v, slope, h, lambda w: np.full_like(w, C), p)
    assert abs(F - expected) < 1e-6 * p["Fs"]


@pytest.mark.parametrize("delta", [0.02, 0.05, 0.1, 0.5, 1.0, 3.0])
@pytest.mark.parametrize("start", [0.5, 1.2, 1.4])
@pytest.mark.parametrize("k", [1e3, 1e7])
def test_gms_slips_where_the_force_meets_a_level_that_falls_steeply(
    block: Callable[[str], Library], delta: float, start: float, k: float
) -> None:
    """From rest, and without attraction: the force stays as it is when k path + F(0) = S, even after 1e-30 s."""
    p = {"Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "delta": delta}
    slope, h = 20.0, 1e-3

    def force(logarithm: float) -> float:
        return start + k * 0.5 * slope * math.exp(2.0 * logarithm)

    def excess(logarithm: float) -> float:
        return force(logarithm) - float(level(slope * math.exp(logarithm), p))

    expected = (
        force(brentq(excess, -300.0, math.log(h), xtol=1e-13)) if excess(math.log(h)) > 0.0 else force(math.log(h))
    )
    F = ramp(block("GMS"), 0.0, slope, h, "Fi[1]", C=0.0, sigma2=0.0, N=1, **{"Fi[1]": start, "k[1]": k}, **p)[0]
    assert abs(F - expected) < 1e-9


@pytest.mark.parametrize("gap", [4e-10, 1e-2])
def test_gms_sticks_where_the_force_almost_meets_the_rising_level(block: Callable[[str], Library], gap: float) -> None:
    """While the motion slows down, k path + F(0) is nearest to S before the end."""
    p = {"Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "delta": 2.0}
    v, h, k = 5e-3, 2e-3, 1e5

    def room(s: float) -> float:
        return float(level(v * (1.0 - s / h), p)) - k * v * s * (1.0 - 0.5 * s / h)

    nearest = minimize_scalar(room, bounds=(0.0, h), method="bounded", options={"xatol": 1e-12})
    assert 0.1 * h < nearest.x < 0.9 * h
    start = nearest.fun - gap
    F = ramp(block("GMS"), v, -v / h, h, "Fi[1]", sigma2=0.0, N=1, **{"Fi[1]": start, "k[1]": k}, **p)[0]
    assert pytest.approx(start + k * 0.5 * v * h, rel=1e-12) == F


@pytest.mark.parametrize("delta", [0.7, 1.0, 2.0, 11.0])
@pytest.mark.parametrize("start", [-0.9, 0.2])
def test_an_elastic_perfectly_plastic_contact_follows_a_rising_level(
    block: Callable[[str], Library], delta: float, start: float
) -> None:
    """z_ba > z_max: z = path + the least of z(0) and of z_max - path up to now."""
    sigma0, h, v = 1e5, 2e-3, 0.02
    p = {"Fc": 0.4, "Fs": 1.5, "vs": 1e-3, "delta": delta}
    s = np.linspace(0.0, h, 2_000_001)
    path = v * s * (1.0 - 0.5 * s / h)
    expected = path[-1] + min(start * 0.4 / sigma0, float(np.min(level(v * (1.0 - s / h), p) / sigma0 - path)))
    z = ramp(block("ElastoPlastic"), v, -v / h, h, "z", z=start * 0.4 / sigma0, z_ba=2e-5, sigma0=sigma0, **p)[0]
    assert abs(z - expected) * sigma0 < 1e-9


def test_an_elastic_perfectly_plastic_contact_slips_at_its_level(block: Callable[[str], Library]) -> None:
    """z_ba > z_max: after a reversal and a long path, dz/dt = 0 although z may be below z_max by a rounding error."""
    draw = np.random.default_rng(1)
    for v_before, v, h in draw.uniform((0.01, 0.01, 0.1), (0.05, 0.05, 1.0), (200, 3)).tolist():
        with Instance(block("ElastoPlastic")) as run:
            run.initialise(z_ba=2e-5, v=-v_before)
            run.step(0.0, 0.1)
            assert run.input_derivatives({"v": (v_before + v) / h}) == OK
            run.step(0.1, h)
            assert run.get1("F") == pytest.approx(1.0 + 0.4 * v, abs=1e-9)


def test_a_ramp_of_an_elastic_perfectly_plastic_contact_can_be_cut(block: Callable[[str], Library]) -> None:
    """z_ba > z_max: from above its level, which rises while the motion slows down, z meets it within the step."""
    draw = np.random.default_rng(1)
    for v, share, logarithm, start in draw.uniform((5e-4, -1.0, -4.0, 1.0), (3e-3, 0.5, -2.0, 1.5), (50, 4)).tolist():
        h, ends = 10.0**logarithm, []
        for cuts in (1, 10):
            with Instance(block("ElastoPlastic")) as run:
                run.initialise(z_ba=1e-4, z=start * 1e-5)
                for k in range(cuts):
                    run.set({"v": v + (share - 1.0) * v * k / cuts})
                    assert run.input_derivatives({"v": (share - 1.0) * v / h}) == OK
                    run.step(run.get1("time"), h / cuts)
                ends.append(1e5 * run.get1("z"))
        assert ends[0] == pytest.approx(ends[1], abs=1e-9)


def test_modified_leuven_ends_a_step_over_levels_twelve_decades_apart(block: Callable[[str], Library]) -> None:
    """The elements end on the Stribeck curve, in less than a second."""
    elements = {"k[1]": 0.0, "k[2]": 379.9, "k[3]": 396.0, "W[1]": 0.15, "W[2]": 0.15, "W[3]": 3.9e7, "N": 3}
    begin = time.perf_counter()
    Fh = ramp(
        block("ModifiedLeuven"),
        1.53,
        -295.6,
        0.0123,
        "Fh",
        n=0.1,
        Fc=1e-9,
        Fs=1327.0,
        vs=0.193,
        delta=100.0,
        **elements,
    )[0]
    assert not THOROUGH or time.perf_counter() - begin < 1.0
    assert abs(Fh + 1e-9) < 1e-6 * 1e-9


@pytest.mark.parametrize("v", [0.0, 1e-12, 1e-6, 3e-4, 1.0])
def test_a_static_level_far_below_the_kinetic_one_is_kept(block: Callable[[str], Library], v: float) -> None:
    """Fs / Fc = 1e-18: the curve is Fs + (Fc - Fs) (1 - exp(-(v/vs)^2)), never zero."""
    Fs, Fc = 1e-9, 1e9
    expected = Fs - (Fc - Fs) * math.expm1(-((v / 1e-3) ** 2))
    with Instance(block("Stribeck")) as run:
        run.initialise(v=v, Fc=Fc, Fs=Fs, vs=1e-3, Fv=0.0, F_ext=1.0)
        assert run.get1("F") == pytest.approx(expected, rel=1e-13)
    for name in ("LuGre", "ElastoPlastic", "GMS", "Leuven", "ModifiedLeuven"):
        for slope in (0.0, 0.3, -0.3):
            with Instance(block(name)) as run:
                run.initialise(v=v, Fc=Fc, Fs=Fs, vs=1e-3)
                assert run.input_derivatives({"v": slope}) == OK
                run.step(0.0, 1e-3)
                assert math.isfinite(run.get1("F"))
