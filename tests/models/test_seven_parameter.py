"""The seven-parameter model against its rules, written down a second time without rings, cubics or steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from shell.instance import DISCARD, OK, WARNING, Instance, Library, load
from thorough import few

reproducibly = settings(max_examples=few(80), deadline=20_000, derandomize=True, database=None)

START = {"kt": 1e5, "Fc": 1.0, "Fv": 0.4, "Fs_a": 0.2, "Fs_inf": 0.5, "vs": 1e-3, "tauL": 5e-3, "gamma": 1.0}

Piece = tuple[float, float, float]  # duration, v at its start, slope


@pytest.fixture(scope="module")
def seven(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("SevenParameter"))


def sign(v: float) -> float:
    return float(np.sign(v))


@dataclass
class Oracle:
    """The contact over pieces of linear velocity; break-away from a dense scan and Brent's method."""

    p: dict[str, float]
    t: float = 0.0
    v: float = 0.0
    d: float = 0.0
    t2: float = 0.0
    slip: float = 0.0
    Fs_last: float = 0.0
    history: list[tuple[float, float, float]] = field(default_factory=list)  # begin, v, slope
    tie: bool = False  # a piece ended so near to break-away that rounding decides

    def __post_init__(self) -> None:
        self.Fs_last = self.p["Fs_a"]

    def delayed(self) -> float:
        at, value = self.t - self.p["tauL"], 0.0
        for begin, v, slope in self.history:
            if begin <= at + 1e-11:
                value = v + slope * (at - begin)
        return value

    def excess(self, t2: float) -> float:
        dwelt = t2 / (t2 + self.p["gamma"]) if self.p["gamma"] else 1.0
        return self.Fs_last + (self.p["Fs_inf"] - self.Fs_last) * dwelt

    def share(self, v: float) -> float:
        return 1.0 / (1.0 + (v / self.p["vs"]) ** 2)

    def meet(self, v: float, before: float) -> None:
        """The velocity is v from now on; a contact that stops keeps the Stribeck part of before."""
        self.v = v
        if self.slip and sign(v) != self.slip:
            self.Fs_last = self.excess(self.t2) * self.share(self.delayed() if self.p["tauL"] else before)
            self.d = self.slip * (self.p["Fc"] + self.Fs_last) / self.p["kt"]
            self.slip = self.t2 = 0.0

    def move(self, duration: float, v: float, slope: float = 0.0) -> None:
        zero = -v / slope if slope else -1.0
        if 0.0 < zero < duration * (1.0 - 1e-12):
            self.move(zero, v, slope)
            self.move(duration - zero, 0.0, slope)
            return
        self.history.append((self.t, v, slope))
        self.meet(v, self.v)
        if not self.slip:
            wait = self.break_away(duration, v, slope)
            stuck = min(wait, duration)
            end = self.d + v * duration + 0.5 * slope * duration**2
            beyond = self.p["kt"] * abs(end) - self.p["Fc"] - self.excess(self.t2 + duration)
            self.tie = self.tie or ((v != 0.0 or slope != 0.0) and abs(beyond) < 1e-9)
            self.d += v * stuck + 0.5 * slope * stuck**2
            self.t2 += stuck
            if wait <= duration:
                self.slip = sign(v + 0.5 * slope * duration)
        self.t += duration
        end = v + slope * duration
        self.meet(0.0 if abs(end) < 1e-12 * abs(v) else end, end)

    def break_away(self, duration: float, v: float, slope: float) -> float:
        s = sign(v + 0.5 * slope * duration)

        def over(u: float) -> float:
            stretch = self.p["kt"] * s * (self.d + v * u + 0.5 * slope * u * u)
            return stretch - self.p["Fc"] - self.excess(self.t2 + u)

        if s == 0.0:
            return math.inf
        times = np.unique([0.0, *np.geomspace(1e-9, 1.0, 100) * duration, *np.linspace(0.0, duration, 300)])
        for k, u in enumerate(times):
            if over(float(u)) > 1e-12:
                before = float(times[max(k - 1, 0)])
                if over(before) > -1e-12:  # at the limit already
                    return before
                return float(brentq(over, before, u, xtol=1e-18, rtol=1e-15))
        return math.inf

    @property
    def force(self) -> float:
        if self.slip:
            return (self.p["Fc"] + self.excess(self.t2) * self.share(self.delayed())) * self.slip + self.p[
                "Fv"
            ] * self.v
        return self.p["kt"] * self.d


def play(
    library: Library, pieces: Sequence[Piece], cuts: int = 1, scale: float = 1.0, **values: float
) -> list[tuple[float, ...]]:
    """F, stuck, d and t2 at the end of each piece, each in `cuts` steps."""
    found = []
    with Instance(library) as run:
        run.initialise(**values)
        t = 0.0
        for duration, v, slope in pieces:
            for k in range(cuts):
                run.set({"v": scale * (v + slope * (duration * k / cuts))})
                if slope:
                    assert run.input_derivatives({"v": scale * slope}) == OK
                run.step(t, duration / cuts)
                t += duration / cuts
            found.append(tuple(run.get("F", "stuck", "d", "t2")))
    return found


def expected(pieces: Sequence[Piece], p: dict[str, float], ties: bool = False) -> list[tuple[float, ...]]:
    """As of `play`; made-up pieces with ties are passed over."""
    oracle, found = Oracle(p), []
    for duration, v, slope in pieces:
        oracle.move(duration, v, slope)
        if not ties:
            assume(not oracle.tie)
        found.append((oracle.force, float(not oracle.slip), oracle.d, oracle.t2))
    return found


# ---- trajectories

duration = st.one_of(st.sampled_from([1e-6, 1e-4, 1e-3, 5e-3, 0.02]), st.floats(1e-6, 0.02))
velocity = st.one_of(st.floats(-5e-3, 5e-3), st.sampled_from([0.0, 0.0, 1e-3, -1e-3, 0.1, -0.1, 1e-6]))
parameters = st.fixed_dictionaries(
    {
        "kt": st.sampled_from([97531.0, 20117.0]),  # such that break-away is never just at the end of a step
        "Fc": st.floats(0.1, 2.0),
        "Fv": st.floats(0.0, 2.0),
        "Fs_a": st.floats(0.0, 1.0),
        "Fs_inf": st.floats(0.0, 1.0),
        "vs": st.floats(1e-4, 1e-2),
        "tauL": st.sampled_from([0.0, 1e-3, 5e-3, 0.0123]),
        "gamma": st.sampled_from([0.0, 1e-3, 0.1, 1.0]),
    }
)


@reproducibly
@given(pieces=st.lists(st.tuples(duration, velocity, st.just(0.0)), min_size=1, max_size=15), p=parameters)
def test_held_velocities_give_the_force_of_the_rules(seven: Library, pieces: list[Piece], p: dict[str, float]) -> None:
    for one, other in zip(play(seven, pieces, **p), expected(pieces, p), strict=True):
        assert one == pytest.approx(other, rel=1e-9, abs=1e-12)


@reproducibly
@given(
    pieces=st.lists(st.tuples(duration, velocity, st.floats(-2.0, 2.0)), min_size=1, max_size=8),
    p=parameters,
    cuts=st.sampled_from([1, 3]),
)
def test_velocities_with_slopes_give_the_force_of_the_rules(
    seven: Library, pieces: list[Piece], p: dict[str, float], cuts: int
) -> None:
    """Through reversals inside the steps; the pieces jump where they meet."""
    for one, other in zip(play(seven, pieces, cuts, **p), expected(pieces, p), strict=True):
        assert one[:3] == pytest.approx(other[:3], rel=1e-8, abs=1e-9)
        assert one[3] == pytest.approx(other[3], rel=1e-8, abs=1e-7)  # the scan sees break-away 1e-12 N late


@pytest.mark.parametrize("h", [1e-6, 1e-5, 1e-4, 1e-3, 1e-2])
def test_any_communication_step_gives_the_same_force(seven: Library, h: float) -> None:
    """0.06 s of holds, reversals and two speeds in steps of h against one step for each velocity."""
    pieces = [(0.02, 2e-3, 0.0), (0.01, 0.0, 0.0), (0.01, 2e-3, 0.0), (0.01, 7e-4, 0.0), (0.01, -3e-3, 0.0)]
    whole, cut = play(seven, pieces), []
    with Instance(seven) as run:
        run.initialise()
        t = 0.0
        for span, v, _ in pieces:
            run.set({"v": v})
            for _ in range(round(span / h)):
                run.step(t, h)
                t += h
            cut.append(tuple(run.get("F", "stuck", "d", "t2")))
    for one, other in zip(whole, cut, strict=True):
        assert one == pytest.approx(other, rel=1e-9, abs=1e-12)


# ---- what the model is known for


@pytest.mark.parametrize("hold", [0.0, 0.01, 1.0, 100.0])
def test_static_friction_grows_with_the_dwell_time(seven: Library, hold: float) -> None:
    """The highest force after a rest is Fc + Fs_a + (Fs_inf - Fs_a) T / (T + gamma), T until break-away."""
    speed = 1e-6
    dwell = hold
    for _ in range(60):  # T = hold + d / v, with kt d the level itself
        top = 1.0 + 0.2 + 0.3 * dwell / (dwell + 1.0)
        dwell = hold + top / 1e5 / speed
    with Instance(seven) as run:
        run.initialise()
        if hold:
            run.step(0.0, hold)
        run.set({"v": speed})
        run.step(hold, (dwell - hold) * (1.0 - 1e-9))
        F, stuck, t2 = run.get("F", "stuck", "t2")
        assert stuck == 1.0
        assert [F, t2] == pytest.approx([top, dwell], rel=1e-8)
        run.step(run.get1("time"), dwell * 2e-9)
        assert run.get1("stuck") == 0.0


def test_the_stribeck_effect_follows_the_velocity_after_a_pure_delay(seven: Library) -> None:
    """Not a lag: nothing happens for tauL, then the jump is there as a whole, at any time between steps."""
    tauL = 7.3e-3
    with Instance(seven) as run:
        run.initialise(tauL=tauL, v=1e-3)
        run.step(0.0, 0.1)
        F_slow, t2 = run.get("F", "t2")
        Fs = 0.2 + 0.3 * t2 / (t2 + 1.0)
        assert F_slow == pytest.approx(1.0 + Fs / 2.0 + 0.4e-3, rel=1e-12)
        run.set({"v": 3e-3})
        assert run.get1("F") == pytest.approx(1.0 + Fs / 2.0 + 1.2e-3, rel=1e-12)
        run.step(0.1, tauL * 0.999)
        assert run.get1("F") == pytest.approx(1.0 + Fs / 2.0 + 1.2e-3, rel=1e-12)
        run.step(run.get1("time"), tauL * 0.002)
        assert run.get1("F") == pytest.approx(1.0 + Fs / 10.0 + 1.2e-3, rel=1e-12)


def test_a_ramp_is_delayed_between_the_communication_points(seven: Library) -> None:
    slope, tauL = 0.05, 4.1e-3
    with Instance(seven) as run:
        run.initialise(tauL=tauL)
        for k in range(10):
            run.set({"v": slope * 3e-3 * k})
            assert run.input_derivatives({"v": slope}) == OK
            run.step(3e-3 * k, 3e-3)
            assert run.get1("v_delayed") == pytest.approx(
                max(slope * (3e-3 * (k + 1) - tauL), 0.0), rel=1e-9, abs=1e-15
            )


def test_friction_at_falling_speed_is_below_that_at_rising_speed(seven: Library) -> None:
    """Frictional lag: at the same speed the Stribeck part has not yet come back."""
    found = {}
    with Instance(seven) as run:
        run.initialise(v=1e-4, Fv=0.0)
        run.step(0.0, 1.0)
        for k, (v, slope) in enumerate([(1e-4, 0.2)] * 20 + [(4.1e-3, -0.2)] * 20):
            start = v + slope * 1e-3 * (k % 20)
            run.set({"v": start})
            assert run.input_derivatives({"v": slope}) == OK
            run.step(1.0 + 1e-3 * k, 1e-3)
            found[k] = run.get1("F")
    assert all(found[38 - k] < found[k] - 1e-3 for k in range(1, 15))


@pytest.mark.parametrize("tauL", [0.0, 1e-9, 5e-3])
def test_a_jump_to_rest_keeps_the_stribeck_part(seven: Library, tauL: float) -> None:
    """With a delay, however short, or without one: the spring takes over what the slide had."""
    with Instance(seven) as run:
        run.initialise(v=2e-3, tauL=tauL)
        run.step(0.0, 0.05)
        sliding = run.get1("F") - 0.4 * 2e-3
        run.set({"v": 0.0})
        assert run.get("F", "stuck") == pytest.approx([sliding, 1.0], rel=1e-12)
        run.step(0.05, 1e-3)
        run.set({"v": -1e-6})
        assert run.get("F", "stuck") == pytest.approx([sliding, 1.0], rel=1e-12)


@pytest.mark.parametrize("s", [1.0, -1.0])
def test_the_force_is_continuous_where_slip_ends(seven: Library, s: float) -> None:
    """At v = 0 after a ramp, and where a jump to the other direction ends it; then the spring unloads."""
    with Instance(seven) as run:
        run.initialise(v=s * 2e-3)
        run.step(0.0, 0.05)
        assert run.input_derivatives({"v": -s * 2.0}) == OK
        run.step(0.05, 1e-3 * (1.0 - 1e-9))
        before = run.get1("F")
        assert run.get1("stuck") == 0.0
        run.set({"v": 0.0})
        at_rest = run.get("F", "stuck", "Fs_last")
        assert at_rest[0] == pytest.approx(before, rel=1e-9)
        assert at_rest[1] == 1.0
        run.step(run.get1("time"), 0.5)
        assert run.get("F", "stuck") == [at_rest[0], 1.0]
        assert run.get1("Fs_last") == at_rest[2] == pytest.approx(abs(at_rest[0]) - 1.0, rel=1e-12)
        run.set({"v": -s * 1e-6})
        run.step(run.get1("time"), 1.0)
        assert run.get1("F") == pytest.approx(at_rest[0] - s * 1e5 * 1e-6, rel=1e-12)


@pytest.mark.parametrize("s", [1.0, -1.0])
def test_a_spring_that_just_reaches_the_growing_static_friction_breaks_away(seven: Library, s: float) -> None:
    """With kt d = 1 + t - t^2/2 and Fs = t/(1 + t), kt d - Fs is largest at the golden section."""
    g = 0.5 * (math.sqrt(5.0) - 1.0)
    most = 1.0 + g - 0.5 * g**2 - g / (1.0 + g)
    for beyond in (1e-6, -1e-6):
        with Instance(seven) as run:
            run.initialise(v=s * 1e-5, d=s * 1e-5, Fc=most - beyond, Fs_inf=1.0, Fs_a=0.0, gamma=1.0, kt=1e5)
            assert run.input_derivatives({"v": -s * 1e-5}) == OK
            run.step(0.0, 0.9)
            assert run.get1("stuck") == (0.0 if beyond > 0.0 else 1.0)


@pytest.mark.parametrize("s", [1.0, -1.0])
def test_deflection_and_dwell_time_grow_while_the_contact_sticks(seven: Library, s: float) -> None:
    with Instance(seven) as run:
        run.initialise(v=s * 1e-6)
        run.step(0.0, 1.0)
        assert run.get("stuck", "der(d)", "der(t2)") == [1.0, s * 1e-6, 1.0]
        run.set({"v": s * 2e-3})
        run.step(1.0, 0.1)
        assert run.get("stuck", "der(d)", "der(t2)") == [0.0, 0.0, 0.0]


def test_a_velocity_that_only_touches_zero_makes_the_contact_stick(seven: Library) -> None:
    pieces = [(0.05, 2e-3, 0.0), (1e-3, 2e-3, -2.0), (1e-6, 0.0, 0.1), (0.01, 1e-7, 0.1)]
    found = play(seven, pieces, gamma=1e-3)
    for k, (one, other) in enumerate(zip(found, expected(pieces, START | {"gamma": 1e-3}, ties=True), strict=True)):
        shown = 2 if k == 1 else 4  # where it has just stopped, d and t2 follow with the next step
        assert one[:shown] == pytest.approx(other[:shown], rel=1e-8, abs=1e-9)
    assert found[2][1] == 1.0


def test_dither_below_break_away_does_not_drift(seven: Library) -> None:
    with Instance(seven) as run:
        run.initialise(v=1e-3)
        run.step(0.0, 5e-3)
        F = run.get1("F")
        for k in range(1000):
            run.set({"v": 1e-4 * (-1) ** k})
            run.step(5e-3 + 0.01 * k, 0.01)
        assert run.get1("F") == pytest.approx(F, rel=1e-11)


# ---- properties


@reproducibly
@given(pieces=st.lists(st.tuples(duration, velocity, st.floats(-2.0, 2.0)), min_size=1, max_size=8), p=parameters)
def test_friction_is_odd_and_bounded_and_scales_with_the_load(
    seven: Library, pieces: list[Piece], p: dict[str, float]
) -> None:
    plain = play(seven, pieces, **p)
    mirrored = play(seven, pieces, scale=-1.0, **p)
    loaded = play(seven, pieces, Fn=3.0, Fn0=2.0, **p)
    lifted = play(seven, pieces, Fn=-1.0, **p)
    top = p["Fc"] + max(p["Fs_a"], p["Fs_inf"])
    for k, (duration, v, slope) in enumerate(pieces):
        end = v + slope * duration
        viscous = 0.0 if plain[k][1] else p["Fv"] * end
        assert mirrored[k] == (-plain[k][0], plain[k][1], -plain[k][2], plain[k][3])
        assert abs(plain[k][0]) <= top * (1.0 + 1e-9) + p["Fv"] * abs(end)
        assert loaded[k][0] == pytest.approx(1.5 * (plain[k][0] - viscous) + viscous, rel=1e-11, abs=1e-13)
        assert loaded[k][1:] == plain[k][1:]
        assert lifted[k][0] == pytest.approx(viscous, abs=1e-13)


@reproducibly
@given(pieces=st.lists(st.tuples(st.floats(1e-4, 0.01), velocity, st.just(0.0)), min_size=1, max_size=10))
def test_no_more_energy_comes_back_than_the_spring_has_stored(seven: Library, pieces: list[Piece]) -> None:
    """kt d^2 / 2 grows by no more than the work put in; d stays at break-away while the contact slips."""
    stored = 0.0
    with Instance(seven) as run:
        run.initialise()
        t = 0.0
        for span, v, _ in pieces:
            run.set({"v": v})
            for _ in range(20):
                F, h = run.get1("F"), span / 20
                stuck = run.get1("stuck")
                run.step(t, h)
                t += h
                now = 0.5e5 * run.get1("d") ** 2
                if stuck and run.get1("stuck"):  # a spring, exactly, from the d of F: slip may just have ended
                    begin = 0.5 * F * F / 1e5
                    assert now - begin == pytest.approx(0.5 * (F + run.get1("F")) * v * h, abs=1e-15)
                    assert begin <= stored * (1.0 + 1e-9) + 1e-20
                elif not stuck:
                    assert v * F >= 0.0
                    assert now <= stored * (1.0 + 1e-12)
                stored = now


@pytest.mark.parametrize(
    "values",
    [
        {"vs": 1e-12},
        {"gamma": 0.0},
        {"gamma": 1e300},
        {"tauL": 0.0},
        {"tauL": 1e300},
        {"Fc": 0.0},
        {"Fc": 0.0, "Fs_a": 0.0, "Fs_inf": 0.0},
        {"Fs_a": 0.9, "Fs_inf": 0.0},
        {"kt": 1e-9},
        {"kt": 1e30},
    ],
    ids=str,
)
def test_parameters_at_their_limits_are_computed(seven: Library, values: dict[str, float]) -> None:
    pieces = [(0.01, v, 0.0) for v in (0.0, 1e-3, 0.0, -1e-3, 5e-324, 1.0, -1.0, 0.0)]
    assert all(math.isfinite(F) and abs(F) <= 2.4 for F, *_ in play(seven, pieces, **values))


def test_without_stribeck_part_and_stiffness_limits_it_is_coulomb_and_viscous_friction(seven: Library) -> None:
    """B17 in the limit kt -> infinity: F = Fc sign(v) + Fv v."""
    pieces = [(0.01, v, 0.0) for v in (1e-3, -2e-3, 0.5, -1e-6)]
    found = [F for F, *_ in play(seven, pieces, Fs_a=0.0, Fs_inf=0.0, kt=1e12)]
    assert found == pytest.approx([sign(v) + 0.4 * v for _, v, _ in pieces], rel=1e-12)


def test_with_a_huge_stiffness_and_no_delay_it_is_the_lorentzian_curve(
    seven: Library, build_fmu: Callable[..., Path]
) -> None:
    stribeck = load(build_fmu("Stribeck"))
    for v in (1e-4, -1e-3, 3e-3, -0.2):
        with Instance(seven) as one, Instance(stribeck) as other:
            one.initialise(v=v, kt=1e15, tauL=0.0, gamma=0.0)
            other.initialise(v=v, shape=1)
            one.step(0.0, 1e-3)
            assert one.get1("F") == pytest.approx(other.get1("F"), rel=1e-12)


# ---- the history of the velocity


def test_more_pieces_than_are_kept_give_a_warning_once_and_a_history_that_is_thinned_out(seven: Library) -> None:
    """A sine in held steps of 1 us, delayed by 5 ms: after thinning still the sine, to the size of the steps."""
    w, peak, h = 2.0 * math.pi * 50.0, 5e-3, 1e-6
    statuses, worst = [], 0.0
    with Instance(seven) as run:
        run.initialise()
        for k in range(12000):
            run.set({"v": peak * (2.0 + math.sin(w * h * k))})
            statuses.append(run.call("DoStep", h * k, h, 1))
            if k > 5010 and k % 7 == 0:
                at = h * (k + 1) - 5e-3
                worst = max(worst, abs(run.get1("v_delayed") - peak * (2.0 + math.sin(w * at))))
        assert any(b"thinned" in message[3] for message in run.messages)
    assert statuses.count(WARNING) == 1
    assert set(statuses) == {OK, WARNING}
    assert statuses.index(WARNING) == 1024
    assert worst < 2.0 * peak * w * h


def test_held_steps_and_ramps_take_one_piece_each(seven: Library) -> None:
    """A million steps of 1 us would not do, but ten thousand of two velocities and a ramp are three pieces."""
    with Instance(seven) as run:
        run.initialise(tauL=0.02)
        for k in range(15000):
            t = 1e-6 * k
            if k < 5000:
                run.set({"v": 1e-3})
            elif k < 10000:
                run.set({"v": 2e-3})
            else:
                run.set({"v": 2e-3 + 0.5 * (t - 0.01)})
                assert run.input_derivatives({"v": 0.5}) == OK
            run.must("DoStep", t, 1e-6, 1)
        run.set({"v": 1e-3})
        run.step(run.get1("time"), 0.017)
        assert run.get1("v_delayed") == pytest.approx(2e-3 + 0.5 * 2e-3, rel=1e-9)


def test_a_rest_takes_one_piece(seven: Library) -> None:
    with Instance(seven) as run:
        run.initialise(tauL=5.0)
        for k in range(1100):
            run.must("DoStep", 1e-3 * k, 1e-3, 1)
        run.set({"v": 2e-3})
        run.step(run.get1("time"), 0.01)
        run.set({"v": 0.0})
        run.step(run.get1("time"), 4.995)
        assert run.get1("v_delayed") == 2e-3


def test_the_delay_line_is_part_of_the_state(seven: Library) -> None:
    draw = np.random.default_rng(3)
    v = draw.uniform(-5e-3, 5e-3, 200)
    with Instance(seven) as run, Instance(seven) as other:
        run.initialise()
        other.initialise()
        for k in range(100):
            run.set({"v": float(v[k])})
            run.step(1e-3 * k, 1e-3)
        other.restore(run.serialised())
        for k in range(100, 200):
            for each in (run, other):
                each.set({"v": float(v[k])})
                each.step(1e-3 * k, 1e-3)
            assert run.everything() == other.everything()


def test_a_refused_step_keeps_the_history_of_a_restored_state(seven: Library) -> None:
    """The history before a step is kept by what the last step has added, unless another state was restored."""
    with Instance(seven) as run, Instance(seven) as other:
        for each, speed in ((run, 1e-3), (other, 2e-3)):
            each.initialise(Fv=1e3)
            for k in range(10):
                each.set({"v": speed + 1e-4 * k})
                each.step(1e-3 * k, 1e-3)
        run.restore(other.serialised())
        run.set({"v": 1e308})
        assert run.call("DoStep", 1e-2, 1e-3, 1) == DISCARD
        pieces = 1024 * 24  # bytes at the end of a state
        assert run.serialised()[-pieces:] == other.serialised()[-pieces:]


def test_a_longer_delay_during_the_run_looks_further_back(seven: Library) -> None:
    with Instance(seven) as run:
        run.initialise(tauL=1e-3)
        for k in range(50):
            run.set({"v": 1e-4 * (k + 1)})
            run.step(1e-3 * k, 1e-3)
        assert run.get1("v_delayed") == pytest.approx(5e-3, rel=1e-12)
        run.set({"tauL": 0.0205})
        assert run.get1("v_delayed") == pytest.approx(3e-3, rel=1e-12)
