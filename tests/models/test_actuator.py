"""Actuator: delay, limit and lag against quadrature of the convolution and closed forms."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shell.instance import ERROR, OK, WARNING, Instance, Library, load
from thorough import few

reproducibly = settings(max_examples=few(100), deadline=20_000, derandomize=True, database=None)


@pytest.fixture(scope="module")
def actuator(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("Actuator"))


class Input:
    """u up to a time: steps of a begin, a value and a rate, and a constant before."""

    def __init__(self, before: float) -> None:
        self.begin, self.u, self.rate = [-math.inf], [before], [0.0]

    def add(self, begin: float, u: float, rate: float) -> None:
        self.begin.append(begin)
        self.u.append(u)
        self.rate.append(rate)

    def __call__(self, t: float) -> float:
        i = int(np.searchsorted(self.begin, t, side="left")) - 1
        return self.u[i] + (self.rate[i] * (t - self.begin[i]) if i else 0.0)


def lagged(u: Input, F0: float, t: float, delay: float, tau: float, low: float, high: float) -> float:
    """F(t) as a convolution: exp(-t/tau) F0 + int exp(-(t - s)/tau) w(s) ds / tau, by Gauss-Legendre between kinks."""
    kinks = {0.0, t}
    for i, begin in enumerate(u.begin[1:], 1):
        kinks.add(begin + delay)
        if u.rate[i]:
            kinks |= {begin + delay + (limit - u.u[i]) / u.rate[i] for limit in (low, high)}
    edges = sorted(s for s in kinks if 0.0 <= s <= t)
    nodes, weights = np.polynomial.legendre.leggauss(12)
    total = math.exp(-t / tau) * F0
    for a, b in itertools.pairwise(edges):
        cuts = np.linspace(a, b, 2 + int((b - a) / (2.0 * tau)))
        for left, right in itertools.pairwise(cuts):
            s = (left + right) / 2.0 + (right - left) / 2.0 * nodes
            w = np.clip([u(each - delay) for each in s], low, high)
            total += (right - left) / 2.0 * float(weights @ (np.exp(-(t - s) / tau) * w)) / tau
    return total


sizes = st.floats(-2.0, 2.0)


@reproducibly
@given(
    F0=sizes,
    steps=st.lists(st.tuples(st.floats(1e-3, 0.3), sizes, st.floats(-9.0, 9.0)), min_size=1, max_size=8),
    linear=st.booleans(),
    delay=st.one_of(st.just(0.0), st.floats(1e-3, 0.8)),
    tau=st.floats(0.02, 2.0),
    low=st.floats(-1.5, -0.1),
    high=st.floats(0.1, 1.5),
)
def test_steps_are_exact_for_held_and_for_linear_inputs(
    actuator: Library,
    F0: float,
    steps: list[tuple[float, float, float]],
    linear: bool,
    delay: float,
    tau: float,
    low: float,
    high: float,
) -> None:
    history, t = Input(F0), 0.0
    with Instance(actuator) as run:
        run.initialise(F_lag=F0, delay=delay, tau=tau, F_min=low, F_max=high)
        for h, u, slope in steps:
            rate = slope if linear else 0.0
            run.set({"u": u})
            if linear:
                assert run.input_derivatives({"u": rate}) == OK
            run.step(t, h)
            history.add(t, u, rate)
            t += h
            assert run.get1("F") == pytest.approx(lagged(history, F0, t, delay, tau, low, high), abs=1e-12)
            w = history(t - delay)
            assert run.get1("command") == pytest.approx(min(max(w, low), high), abs=1e-12)
            if min(abs(w - low), abs(w - high)) > 1e-12:
                assert run.get1("limited") == (w < low or w > high)


def test_a_step_comes_out_of_delay_and_lag_as_in_the_closed_form(actuator: Library) -> None:
    delay, tau, h = 0.0123, 0.004, 1e-3
    with Instance(actuator) as run:
        run.initialise(delay=delay, tau=tau, u=2.0)
        for n in range(40):
            run.step(n * h, h)
            late = (n + 1) * h - delay
            assert run.get1("F") == pytest.approx(-2.0 * math.expm1(-max(late, 0.0) / tau), abs=1e-13)


@pytest.mark.parametrize("h", [1e-3, 1.0 / 3000.0, 0.1])
@pytest.mark.parametrize("steps", [1, 7, 500])
def test_a_delay_of_whole_steps_gives_back_the_very_numbers(actuator: Library, h: float, steps: int) -> None:
    """Up to the end of a step, also where the sum of steps misses the delay by rounding; before: the start value."""
    values = np.random.default_rng(1).uniform(-50.0, 50.0, 600).tolist()
    with Instance(actuator) as run:
        run.initialise(start=0.7, delay=steps * h, F_lag=3.0)
        t = 0.7
        for n, u in enumerate(values):
            run.set({"u": u})
            assert run.get1("F") == (values[n - steps - 1] if n > steps else 3.0)
            run.step(t, h)
            t += h


def test_a_ramp_comes_late_by_delay_and_lag(actuator: Library) -> None:
    """In the steady state F = c (t - delay - tau)."""
    c, delay, tau = 5.0, 0.03, 0.01
    with Instance(actuator) as run:
        run.initialise(delay=delay, tau=tau)
        for n in range(100):
            run.set({"u": c * 0.01 * n})
            assert run.input_derivatives({"u": c}) == OK
            run.step(0.01 * n, 0.01)
        assert run.get1("F") == pytest.approx(c * (1.0 - delay - tau), abs=1e-12)
        (rate,) = run.output_derivatives("F")
        assert rate == pytest.approx(c, rel=1e-6)


def test_a_limit_is_met_inside_a_step(actuator: Library) -> None:
    """u = 10 t meets 1 at 0.1 s: then F = 1 - (1 - F(0.1)) exp(-(t - 0.1)/tau)."""
    tau = 0.25
    with Instance(actuator) as run:
        run.initialise(tau=tau, F_max=1.0)
        assert run.input_derivatives({"u": 10.0}) == OK
        run.step(0.0, 0.9)
        at_limit = 10.0 * (0.1 + tau * math.expm1(-0.1 / tau))
        assert run.get1("F") == pytest.approx(1.0 - (1.0 - at_limit) * math.exp(-0.8 / tau), abs=1e-14)
        assert run.get("command", "limited") == [1.0, 1.0]


def test_without_lag_and_delay_it_is_a_limit_that_answers_at_once(actuator: Library) -> None:
    with Instance(actuator) as run:
        run.initialise(F_min=-1.0, F_max=2.0)
        for u, F in ((0.5, 0.5), (3.0, 2.0), (-7.0, -1.0), (2.0, 2.0)):
            run.set({"u": u})
            assert run.get("F", "command", "limited") == [F, F, u != F]


@pytest.mark.parametrize("delay", [0.0, 0.0371])
def test_a_span_may_be_cut_anyhow(actuator: Library, delay: float) -> None:
    """Ramps up and down through both limits, in pieces of random size and in one."""
    draw = np.random.default_rng(3)
    with Instance(actuator) as whole, Instance(actuator) as cut:
        for run in (whole, cut):
            run.initialise(delay=delay, tau=0.013, F_min=-1.0, F_max=0.8, F_lag=0.3)
        for n in range(30):
            t, (u, end) = 0.02 * n, draw.uniform(-3.0, 3.0, 2)
            rate = (end - u) / 0.02
            whole.set({"u": u})
            assert whole.input_derivatives({"u": rate}) == OK
            whole.step(t, 0.02)
            edges = [t, *(t + np.sort(draw.uniform(0.0, 0.02, 6))), 0.02 * n + 0.02]
            for a, b in itertools.pairwise(edges):
                cut.set({"u": u + rate * (a - t)})
                assert cut.input_derivatives({"u": rate}) == OK
                cut.step(a, b - a)
            assert cut.get1("F") == pytest.approx(whole.get1("F"), abs=1e-11)


def test_a_saved_state_has_what_is_on_its_way(actuator: Library) -> None:
    def go_on(run: Instance) -> list[float]:
        found = []
        for n in range(20, 60):
            run.set({"u": 0.0})
            run.step(0.01 * n, 0.01)
            found.append(run.get1("F"))
        return found

    with Instance(actuator) as run, Instance(actuator) as other:
        for each in (run, other):
            each.initialise(delay=0.15, tau=0.02)
        for n in range(20):
            run.set({"u": math.sin(n)})
            run.step(0.01 * n, 0.01)
        state = run.serialised()
        first = go_on(run)
        other.restore(state)
        assert go_on(other) == first
        assert max(first) > 0.3


def test_more_changes_than_it_can_hold_shorten_the_delay_and_give_a_warning(actuator: Library) -> None:
    h, steps = 1e-3, 1500
    with Instance(actuator) as run:
        run.initialise(delay=steps * h)
        statuses = []
        for n in range(2000):
            run.set({"u": 0.01 * n})
            statuses.append(run.call("DoStep", n * h, h, 1))
        assert statuses.count(WARNING) == 1 and statuses.index(WARNING) == 1024
        assert run.get1("F") == pytest.approx(0.01 * (2000 - 1024 - 1), abs=1e-12)
        # a held input is no change
    with Instance(actuator) as run:
        run.initialise(delay=steps * h, u=4.0)
        for n in range(2000):
            run.step(n * h, h)
            assert run.get1("F") == (4.0 if n + 1 > steps else 0.0)


def test_limits_that_exclude_each_other_are_refused(actuator: Library) -> None:
    """With F_min above F_max, no force is within both: 10 N for u = 1 N was one of them."""
    with Instance(actuator) as run:
        run.setup()
        run.set({"F_min": 10.0, "F_max": -10.0, "u": 1.0})
        run.must("EnterInitializationMode")
        assert run.call("ExitInitializationMode") == ERROR
        assert b"must satisfy F_min <= F_max" in run.messages[-1][3]
    with Instance(actuator) as run:
        run.initialise(F_min=-2.0, F_max=-2.0, u=1.0)  # a constant force
        run.step(0.0, 1e-3)
        assert run.get1("F") == -2.0
