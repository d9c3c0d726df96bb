"""Circle against an integration of its speed, the geometry, and the conditions at its ends."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from shell.instance import Instance, Library, load
from thorough import few

reproducibly = settings(max_examples=few(100), deadline=20_000, derandomize=True, database=None)
AXES = ("x", "xd", "xdd", "y", "yd", "ydd")
BLEND = Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
"""speed over feed against the share of the ramp, with two zero derivatives at 0 and at 1"""


@pytest.fixture(scope="module")
def circle(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("Circle"))


def path(s: float, feed: float, T: float, L: float) -> tuple[float, float, float]:
    """Way, speed and acceleration s seconds after the start, L may be infinite."""
    V = min(feed, L / T) if T else feed
    end = L / V + T
    if s < 0.0:
        return 0.0, 0.0, 0.0
    if s >= end:
        return L, 0.0, 0.0
    if s < T:
        u = s / T
        return V * T * BLEND.integ()(u), V * BLEND(u), V / T * BLEND.deriv()(u)
    if s > end - T:
        u = (end - s) / T
        return L - V * T * BLEND.integ()(u), V * BLEND(u), -V / T * BLEND.deriv()(u)
    return V * T / 2.0 + V * (s - T), V, 0.0


def expected(t: float, p: dict[str, float]) -> np.ndarray:
    """The six numbers as the derivatives of a complex exponential."""
    L = 2.0 * math.pi * p["radius"] * p["turns"] if p["turns"] else math.inf
    way = (-1.0 if p["clockwise"] else 1.0) / p["radius"]
    turned, rate, rate_dot = (way * a for a in path(t - p["t_start"], p["feed"], p["t_ramp"], L))
    z = p["radius"] * np.exp(1j * (p["start_angle"] + turned))
    zd, zdd = 1j * rate * z, (1j * rate_dot - rate**2) * z
    z = z + p["x_centre"] + 1j * p["y_centre"]
    return np.array([z.real, zd.real, zdd.real, z.imag, zd.imag, zdd.imag])


@reproducibly
@given(
    radius=st.floats(1e-3, 0.5),
    feed=st.floats(1e-3, 0.5),
    turns=st.one_of(st.just(0.0), st.floats(0.01, 5.0)),
    start_angle=st.floats(-7.0, 7.0),
    clockwise=st.booleans(),
    t_start=st.floats(-1.0, 1.0),
    t_ramp=st.one_of(st.just(0.0), st.floats(0.01, 2.0)),
    centre=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
    times=st.lists(st.floats(-2.0, 10.0), min_size=1, max_size=10),
)
def test_it_is_a_rotating_phasor_with_a_blended_speed(
    circle: Library,
    radius: float,
    feed: float,
    turns: float,
    start_angle: float,
    clockwise: bool,
    t_start: float,
    t_ramp: float,
    centre: tuple[float, float],
    times: list[float],
) -> None:
    p = {
        "radius": radius, "feed": feed, "turns": turns, "start_angle": start_angle, "clockwise": float(clockwise),
        "t_start": t_start, "t_ramp": t_ramp, "x_centre": centre[0], "y_centre": centre[1],
    }  # fmt: skip
    for t in times:
        with Instance(circle) as run:
            run.initialise(start=t, **p)
            rate = feed / radius
            scale = np.array([1.0, rate, rate**2 + rate / (t_ramp or 1.0)] * 2) * (1.0 + 10.0 * rate)
            assert np.all(np.abs(np.array(run.get(*AXES)) - expected(t, p)) <= 1e-12 * scale)


def test_velocity_and_acceleration_are_the_derivatives(circle: Library) -> None:
    """By Simpson's rule over half a millisecond, through start, feed and stop, which lasts L / V + T."""
    p = {"radius": 0.02, "feed": 0.05, "turns": 1.25, "t_ramp": 0.3}
    end = 2.0 * math.pi * 0.02 * 1.25 / 0.05 + 0.3
    h = 5e-4
    with Instance(circle) as run:
        run.initialise(**p)
        rows = [run.get(*AXES)]
        for n in range(int(end / h) + 40):
            run.step(n * h, h)
            rows.append(run.get(*AXES))
    rows = np.array(rows).T
    for axis in (0, 3):
        for lower, upper in ((axis, axis + 1), (axis + 1, axis + 2)):
            found = np.diff(rows[lower][::2])
            a, b, c = rows[upper][:-2:2], rows[upper][1:-1:2], rows[upper][2::2]
            simpson = h / 3.0 * (a + 4.0 * b + c)[: found.size]
            np.testing.assert_allclose(found, simpson, rtol=0, atol=2e-9)  # jerk is bent where ramps begin
    assert rows[:, -1] == pytest.approx([0.0, 0.0, 0.0, 0.02, 0.0, 0.0], abs=1e-16)


def test_radius_and_feed_hold_between_the_ramps(circle: Library) -> None:
    R, V = 0.03, 0.1
    with Instance(circle) as run:
        run.initialise(radius=R, feed=V, x_centre=0.4, y_centre=-0.2, clockwise=1)
        run.step(0.0, 0.2)
        for n in range(100):
            run.step(0.2 + 0.1 * n, 0.1)
            x, xd, xdd, y, yd, ydd = run.get(*AXES)
            x, y = x - 0.4, y + 0.2
            assert math.hypot(x, y) == pytest.approx(R, rel=1e-14)
            assert math.hypot(xd, yd) == pytest.approx(V, rel=1e-14)
            assert x * yd - y * xd == pytest.approx(-R * V, rel=1e-13)  # clockwise
            assert (xdd, ydd) == pytest.approx((-x * (V / R) ** 2, -y * (V / R) ** 2), abs=1e-13)


@pytest.mark.parametrize("clockwise", [0, 1])
@pytest.mark.parametrize("start_angle", [0.0, 0.3, -2.0])
def test_an_axis_reverses_at_each_end_of_a_quadrant(circle: Library, clockwise: int, start_angle: float) -> None:
    """reversals counts the changes of sign of xd and yd."""
    with Instance(circle) as run:
        run.initialise(radius=0.01, feed=0.05, turns=3.1, clockwise=clockwise, start_angle=start_angle, t_ramp=0.1)
        signs, changes, h = None, 0, 2e-3
        for n in range(2100):
            run.step(n * h, h)
            now = np.sign(run.get("xd", "yd"))
            if now.all():
                changes += 0 if signs is None else int(np.sum(now != signs))
                signs = now
        assert run.get1("reversals") == changes == pytest.approx(12, abs=1)
        turned = run.get1("angle") - start_angle
        assert turned == pytest.approx((-1) ** clockwise * 3.1 * 2.0 * math.pi, rel=1e-14)


@pytest.mark.parametrize("turns", [1e-9, 0.001, 0.01])
def test_a_path_too_short_for_the_feed_lasts_two_ramps(circle: Library, turns: float) -> None:
    R, T = 0.01, 0.2
    L = 2.0 * math.pi * R * turns
    assert L < 0.01 * T
    with Instance(circle) as run:
        run.initialise(radius=R, feed=0.01, turns=turns, t_ramp=T)
        run.step(0.0, T)
        assert math.hypot(*run.get("xd", "yd")) == pytest.approx(L / T, rel=1e-12)
        run.step(T, T * (1.0 + 1e-9))
        assert run.get("xd", "yd", "xdd", "ydd") == [0.0] * 4
        assert run.get1("angle") == pytest.approx(2.0 * math.pi * turns, rel=1e-14)
