"""Bristle against its closed forms and an oracle that follows every bristle from bond to bond."""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shell.instance import DISCARD, ERROR, OK, Instance, Library, forged, load
from thorough import few

reproducibly = settings(max_examples=few(60), deadline=20_000, derandomize=True, database=None)
N, SIGMA0, DELTA_S, DELTA = 20, 5e3, 1.2e-5, 6e-6
moves = st.lists(
    st.tuples(st.one_of(st.floats(-5e-2, 5e-2), st.sampled_from([0.0, 1e-9, -3e-6])), st.floats(1e-6, 0.02)),
    min_size=1,
    max_size=6,
)


@pytest.fixture(scope="module")
def bristle(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("Bristle"))


MASK, GOLDEN = 2**64 - 1, 0x9E3779B97F4A7C15


def scramble(a: int) -> int:
    """The finaliser of splitmix64."""
    a = (a ^ a >> 30) * 0xBF58476D1CE4E5B9 & MASK
    a = (a ^ a >> 27) * 0x94D049BB133111EB & MASK
    return a ^ a >> 31


def uniform(seed: int, stream: int, n: int) -> float:
    """Number n of a stream in (0, 1)."""
    key = scramble(((seed << 32 | stream) + GOLDEN) & MASK)
    bits = scramble((scramble((key + GOLDEN) & MASK) + GOLDEN * n) & MASK)
    return ((bits >> 12) + 0.5) * 2.0**-52


class Oracle:
    """Bristles that are moved, one at a time, from each break to the next."""

    def __init__(self, n: int, delta_s: float, delta: float, seed: int) -> None:
        self.d = [0.0] * n
        self.drawn = [0] * n
        self.delta_s, self.span, self.seed = delta_s, min(delta, 2.0 * delta_s), seed

    def move(self, path: float) -> float:
        """Mean deflection after that path."""
        way = math.copysign(1.0, path)
        for i, d in enumerate(self.d):
            rest = abs(path)
            while rest > (room := self.delta_s - way * d):
                rest -= room
                self.drawn[i] += 1
                d = way * (self.delta_s - self.span * uniform(self.seed, i, self.drawn[i]))
            self.d[i] = d + way * rest
        return sum(self.d) / len(self.d)


def steps(run: Instance, trajectory: Sequence[tuple[float, float]]) -> float:
    """Hold each velocity for its time; the time at the end."""
    t = run.get1("time")
    for v, h in trajectory:
        run.set({"v": v})
        run.step(t, h)
        t = t + h
    return t


# ---- closed forms


def test_bristles_are_springs_up_to_their_first_break(bristle: Library) -> None:
    with Instance(bristle) as run:
        run.initialise(v=1e-3)
        assert run.get("F", "z", "E", "rebonds") == [0.0, 0.0, 0.0, 0.0]
        for k in range(11):
            run.step(1e-3 * k, 1e-3)
            x = 1e-6 * (k + 1)
            expected = [N * SIGMA0 * x, x, 0.5 * N * SIGMA0 * x * x, 0.0]
            assert run.get("F", "z", "E", "rebonds") == pytest.approx(expected, rel=1e-12)
            assert run.get1("der(z)") == 1e-3
        run.step(0.011, 1e-3 * (1.0 - 1e-9))
        assert run.get1("F") == pytest.approx(N * SIGMA0 * DELTA_S, rel=1e-8)
        run.step(0.011 + 1e-3 * (1.0 - 1e-9), 1e-6)
        assert run.get1("rebonds") == N
        assert run.get1("F") < 0.99 * N * SIGMA0 * DELTA_S


@pytest.mark.parametrize(("delta_s", "delta"), [(1.2e-5, 6e-6), (1e-5, 2e-5), (1e-5, 1e-6), (1e-5, 5e-5)])
def test_b35_the_mean_force_of_long_sliding(bristle: Library, delta_s: float, delta: float) -> None:
    """N sigma0 (delta_s - Delta/3), with bonds never further away than 2 delta_s."""
    n, v = 1000, 1e-3
    expected = n * SIGMA0 * (delta_s - min(delta, 2.0 * delta_s) / 3.0)
    with Instance(bristle) as run:
        run.initialise(N=n, delta_s=delta_s, Delta=delta, v=v)
        assert run.get1("F_mean") == pytest.approx(expected, rel=1e-14)
        run.step(0.0, 1.0)
        forces, h = [], 0.7 * delta_s / v
        for k in range(200):
            run.step(1.0 + k * h, h)
            forces.append(run.get1("F"))
        assert np.mean(forces) == pytest.approx(expected, rel=0.01)
        run.set({"v": -v})
        run.step(1.0 + 200 * h, 1.0)
        assert run.get1("F") == pytest.approx(-expected, rel=0.02)


def test_the_force_in_sliding_has_the_spread_of_independent_bristles(bristle: Library) -> None:
    """Stationary deflections are delta_s - R with the density 2 (1 - R/Delta)/Delta: variance Delta^2/18."""
    with Instance(bristle) as run:
        run.initialise(N=1000, v=1e-3)
        run.step(0.0, 1.0)
        z, E = run.get("z", "E")
    variance = 2.0 * E / SIGMA0 / 1000 - z * z
    assert variance == pytest.approx(DELTA**2 / 18.0, rel=0.1)


@reproducibly
@given(trajectory=moves)
def test_bristles_that_re_bond_where_they_break_are_a_maxwell_slip_element(
    bristle: Library, trajectory: list[tuple[float, float]]
) -> None:
    z = 0.0
    with Instance(bristle) as run:
        run.initialise(Delta=0.0)
        for v, h in trajectory:
            steps(run, [(v, h)])
            z = min(max(z + v * h, -DELTA_S), DELTA_S)
            assert run.get1("F") == pytest.approx(N * SIGMA0 * z, rel=1e-12, abs=1e-15)
        assert run.get1("F_mean") == pytest.approx(N * SIGMA0 * DELTA_S)


# ---- re-bonds


@reproducibly
@given(
    trajectory=moves,
    n=st.integers(1, 30),
    seed=st.integers(0, 2**31 - 1),
    delta_s=st.floats(1e-6, 1e-4),
    ratio=st.floats(0.05, 4.0),
)
def test_every_bristle_is_followed_through_its_re_bonds(
    bristle: Library, trajectory: list[tuple[float, float]], n: int, seed: int, delta_s: float, ratio: float
) -> None:
    oracle = Oracle(n, delta_s, ratio * delta_s, seed)
    with Instance(bristle) as run:
        run.initialise(N=n, seed=seed, delta_s=delta_s, Delta=ratio * delta_s)
        for v, h in trajectory:
            steps(run, [(v, h)])
            z = oracle.move(v * h)
            assert run.get1("z") == pytest.approx(z, rel=1e-10, abs=1e-10 * delta_s)
            assert run.get1("rebonds") == sum(oracle.drawn)
            squares = sum(d * d for d in oracle.d)
            assert run.get1("E") == pytest.approx(0.5 * SIGMA0 * squares, rel=1e-9, abs=1e-20)


@reproducibly
@given(trajectory=moves, pieces=st.integers(2, 40), spread=st.sampled_from([0.0, 0.7]))
def test_how_a_span_is_cut_does_not_matter(
    bristle: Library, trajectory: list[tuple[float, float]], pieces: int, spread: float
) -> None:
    with Instance(bristle) as whole, Instance(bristle) as cut:
        for run in (whole, cut):
            run.initialise(spread=spread)
        for v, h in trajectory:
            steps(whole, [(v, h)])
            steps(cut, [(v, h / pieces)] * pieces)
            assert cut.get1("F") == pytest.approx(whole.get1("F"), rel=1e-9, abs=1e-10)
            assert cut.get1("rebonds") == whole.get1("rebonds")


@pytest.mark.parametrize(
    ("v", "slope", "h"), [(1e-3, 2.0, 0.01), (-0.02, 1.0, 0.015), (0.0, -3.0, 4e-3), (0.01, -1, 0.01)]
)
def test_only_the_path_counts_through_a_linear_velocity_and_its_reversal(
    bristle: Library, v: float, slope: float, h: float
) -> None:
    turn = -v / slope
    pieces = [0.0, turn, h] if 0.0 < turn < h else [0.0, h]
    oracle = Oracle(N, DELTA_S, DELTA, 1)
    for begin, end in itertools.pairwise(pieces):
        z = oracle.move((v + 0.5 * slope * (begin + end)) * (end - begin))
    with Instance(bristle) as run:
        run.initialise(v=v)
        assert run.input_derivatives({"v": slope}) == OK
        run.step(0.0, h)
        assert run.get1("z") == pytest.approx(z, rel=1e-9)


def test_the_speed_does_not_matter(bristle: Library) -> None:
    forces = []
    for factor in (1.0, 1e3):
        with Instance(bristle) as run:
            run.initialise()
            steps(run, [(v * factor, 1e-3 / factor) for v in (0.03, -0.01, 0.0, 0.07, -0.2)])
            forces.append(run.get1("F"))
    assert forces[0] == pytest.approx(forces[1], rel=1e-11)


def test_seeds_are_reproducible_and_differ(bristle: Library) -> None:
    def force(seed: int) -> float:
        with Instance(bristle) as run:
            run.initialise(seed=seed)
            steps(run, [(1e-2, 0.02)])
            return run.get1("F")

    assert force(5) == force(5)
    assert len({force(seed) for seed in range(20)}) == 20


def test_more_re_bonds_than_can_be_followed_are_refused(bristle: Library) -> None:
    with Instance(bristle) as run:
        run.initialise(v=1.0)
        run.step(0.0, 1.0)
        before = run.get("F", "z", "rebonds")
        assert run.call("DoStep", 1.0, 1e4, 1) == DISCARD
        assert run.get("F", "z", "rebonds") == before


def test_bristles_that_a_new_limit_overstretches_break_at_once_even_at_rest(bristle: Library) -> None:
    with Instance(bristle) as run:
        run.initialise(v=1e-3)
        run.step(0.0, 9e-3)
        run.set({"v": 0.0, "delta_s": 6e-6})
        run.step(9e-3, 1e-3)
        assert run.get1("rebonds") >= N
        assert abs(run.get1("z")) <= 6e-6


# ---- start


@pytest.mark.parametrize("n", [1, 2, 7, 20])
def test_a_spread_start_is_balanced_and_within_its_range(bristle: Library, n: int) -> None:
    with Instance(bristle) as run:
        run.initialise(N=n, spread=0.5)
        F, E = run.get("F", "E")
        assert F == 0.0
        assert (E > 0.0) == (n > 1)
        assert math.sqrt(2.0 * E / (n * SIGMA0)) <= 0.5 * DELTA_S
        steps(run, [(1e-3, 5e-3)])  # nothing breaks on the first half
        assert run.get("F", "rebonds") == pytest.approx([n * SIGMA0 * 5e-6, 0.0], rel=1e-12)


def test_a_spread_start_is_uniform(bristle: Library) -> None:
    """Of each pair, by its random number 0: E is the energy of these springs."""
    with Instance(bristle) as run:
        run.initialise(spread=0.8, seed=7)
        away = [0.8 * DELTA_S * (2.0 * uniform(7, pair, 0) - 1.0) for pair in range(N // 2)]
        assert run.get1("E") == pytest.approx(0.5 * SIGMA0 * sum(2.0 * d * d for d in away), rel=1e-12)


def test_the_deflection_at_the_start_can_be_given(bristle: Library) -> None:
    with Instance(bristle) as run:
        run.initialise(z=7e-6)
        assert run.get("F", "E") == pytest.approx([N * SIGMA0 * 7e-6, 0.5 * N * SIGMA0 * 49e-12], rel=1e-14)
        steps(run, [(-1e-3, 2e-3)])
        assert run.get1("F") == pytest.approx(N * SIGMA0 * 5e-6, rel=1e-12)


# ---- what holds for every friction model


@reproducibly
@given(trajectory=moves, Fn=st.floats(-2.0, 50.0), Fn0=st.floats(0.1, 10.0))
def test_the_force_scales_with_the_load_and_the_deflection_does_not(
    bristle: Library, trajectory: list[tuple[float, float]], Fn: float, Fn0: float
) -> None:
    with Instance(bristle) as plain, Instance(bristle) as loaded:
        plain.initialise()
        loaded.initialise(Fn=Fn, Fn0=Fn0)
        for run in (plain, loaded):
            steps(run, trajectory)
        assert loaded.get1("z") == plain.get1("z")
        assert loaded.get1("F") == pytest.approx(max(Fn, 0.0) / Fn0 * plain.get1("F"), rel=1e-14)


@reproducibly
@given(trajectory=moves)
def test_friction_is_odd_and_bounded(bristle: Library, trajectory: list[tuple[float, float]]) -> None:
    with Instance(bristle) as one, Instance(bristle) as other:
        for run in (one, other):
            run.initialise()
        for v, h in trajectory:
            steps(one, [(v, h)])
            steps(other, [(-v, h)])
            assert one.get1("F") == -other.get1("F")
            assert abs(one.get1("F")) <= N * SIGMA0 * DELTA_S * (1.0 + 1e-12)


def test_breaking_bonds_only_take_energy(bristle: Library) -> None:
    """Work in, less what is stored, never falls by more than the error of the trapezoidal rule in a step."""
    draw = np.random.default_rng(3)
    h, work, lost = 1e-4, 0.0, 0.0
    with Instance(bristle) as run:
        run.initialise()
        for v in np.repeat(draw.uniform(-1e-2, 1e-2, 40), 50):
            before, bonds = run.get("F", "rebonds")
            steps(run, [(float(v), h)])
            F, E, now = run.get("F", "E", "rebonds")
            work += 0.5 * (before + F) * v * h
            slack = (now - bonds) * SIGMA0 * DELTA * abs(v) * h + 1e-18
            assert work - E >= lost - slack
            lost = work - E
        assert lost > 1e-5


def test_friction_at_rest_stays(bristle: Library) -> None:
    with Instance(bristle) as run:
        run.initialise(v=1e-3)
        run.step(0.0, 0.1)
        run.set({"v": 0.0})
        before = run.get("F", "z", "E")
        run.step(0.1, 1e6)
        assert run.get("F", "z", "E") == before


def test_bristles_that_no_run_can_have_are_refused(bristle: Library) -> None:
    """Of the 20 in use; the deflections of 1000 are in the last 16000 bytes of a state."""
    with Instance(bristle) as run:
        run.initialise(v=1e-3)
        run.step(0.0, 1e-3)
        data, z = run.serialised(), run.get1("z")
        assert run.try_restore(data) == OK
        for i, status in ((0, ERROR), (19, ERROR), (20, OK)):
            bad = forged(data, len(data) - 64 - 16 * (1000 - i), struct.pack("d", math.nan))
            assert run.try_restore(bad) == status
        assert run.get1("z") == z
