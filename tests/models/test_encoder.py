"""Encoder against rounding in decimal numbers, differences of them, and the statistics of its jitter."""

from __future__ import annotations

from collections.abc import Callable
from decimal import ROUND_HALF_UP, Decimal
from pathlib import Path

import numpy as np
import pytest
from shell.instance import OK, Instance, Library, load

Ts = 1e-3


@pytest.fixture(scope="module")
def encoder(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("Encoder"))


def sampled(run: Instance, x: np.ndarray, v: np.ndarray | float = 0.0, h: float = Ts) -> np.ndarray:
    """x_measured and v_measured of samples at 0, h, ... of these positions: two rows."""
    found = []
    for n, (position, velocity) in enumerate(zip(x, np.broadcast_to(v, x.shape), strict=True)):
        run.set({"x": float(position), "v": float(velocity)})
        run.step(n * h, h)
        found.append(run.get("x_measured", "v_measured"))
    return np.array(found).T


def test_positions_are_whole_counts_and_velocities_their_differences(encoder: Library) -> None:
    q = 2e-6
    x = np.random.default_rng(1).uniform(-1e-3, 1e-3, 200)
    with Instance(encoder) as run:
        run.initialise(q=q, v0=0.25)
        measured, velocity = sampled(run, x, v=7.0)  # without jitter the velocity has no say
    counts = [int((Decimal(float(a)) / Decimal(q)).to_integral_value(ROUND_HALF_UP)) for a in x]
    np.testing.assert_allclose(measured, q * np.array(counts), rtol=1e-15)
    assert velocity[0] == 0.25
    np.testing.assert_allclose(velocity[1:], q / Ts * np.diff(counts), rtol=0, atol=1e-15)


def test_without_a_step_the_position_itself_is_sampled(encoder: Library) -> None:
    x = np.random.default_rng(2).uniform(-1.0, 1.0, 50)
    with Instance(encoder) as run:
        run.initialise(q=0.0)
        measured, velocity = sampled(run, x)
    assert measured.tolist() == x.tolist()
    assert velocity[1:].tolist() == (np.diff(x) / Ts).tolist()


@pytest.mark.parametrize("q", [0.0, 1e-6])
def test_a_ramp_has_its_velocity_but_for_one_count(encoder: Library, q: float) -> None:
    v = 0.01234567
    with Instance(encoder) as run:
        run.initialise(q=q)
        _, velocity = sampled(run, v * Ts * np.arange(300))
    steps = (velocity[1:] - v) / (q / Ts if q else 1.0)
    assert np.abs(steps).max() < (1.0 if q else 1e-12)
    assert np.mean(velocity[1:]) == pytest.approx(v, abs=q / Ts / 250.0 + 1e-13)


def test_it_samples_in_time_whatever_the_step(encoder: Library) -> None:
    """x = 0.1 t, given as a ramp: samples at k Ts inside a long step, and none inside a short one."""
    with Instance(encoder) as run:
        run.initialise(q=0.0, Ts=0.01)
        assert run.input_derivatives({"x": 0.1}) == OK
        run.step(0.0, 0.0951)
        assert run.get("x_measured", "v_measured") == pytest.approx([0.009, 0.1], rel=1e-12)
        run.set({"x": 0.1 * 0.0951})
        run.step(0.0951, 0.004)
        assert run.get("x_measured", "v_measured") == pytest.approx([0.009, 0.1], rel=1e-12)
        run.set({"x": 0.01})
        run.step(0.0991, 0.0019)
        assert run.get("x_measured", "v_measured") == pytest.approx([0.01, 0.1], rel=1e-12)


def test_jitter_moves_the_sample_by_the_velocity(encoder: Library) -> None:
    """delta is uniform: bounds, mean, variance jitter^2 / 3, no correlation; and the same for any velocity."""
    jitter, n = 2e-5, 4000
    times = {}
    for v in (0.5, -2.0):
        x = v * Ts * np.arange(n)
        with Instance(encoder) as run:
            run.initialise(q=0.0, jitter=jitter, seed=3)
            measured, velocity = sampled(run, x, v)
        times[v] = (measured - x) / v
        np.testing.assert_allclose(velocity[1:], np.diff(measured) / Ts, rtol=0, atol=1e-12)
    delta = times[0.5]
    np.testing.assert_allclose(times[-2.0], delta, rtol=0, atol=1e-15)
    assert np.abs(delta).max() <= jitter and np.abs(delta).max() > 0.99 * jitter
    assert abs(delta.mean()) < 4.0 * jitter / np.sqrt(3.0 * n)
    assert delta.var() == pytest.approx(jitter**2 / 3.0, rel=0.06)
    for lag in (1, 2, 10):
        assert abs(np.corrcoef(delta[lag:], delta[:-lag])[0, 1]) < 4.0 / np.sqrt(n)


def test_the_seed_makes_the_jitter(encoder: Library) -> None:
    x = np.zeros(100)
    found = []
    for seed in (1, 1, 2):
        with Instance(encoder) as run:
            run.initialise(q=0.0, jitter=1e-5, seed=seed)
            found.append(sampled(run, x, 1.0)[0])
    assert found[0].tolist() == found[1].tolist()
    assert abs(np.corrcoef(found[0], found[2])[0, 1]) < 0.4
    assert not np.any(found[0] == found[2])


def test_a_restored_encoder_goes_on_with_the_same_numbers(encoder: Library) -> None:
    def go_on(run: Instance) -> list[list[float]]:
        rows = []
        for n in range(10, 20):
            run.set({"x": 1e-3 * n**2, "v": 1.0})
            run.step(n * Ts, Ts)
            rows.append(run.get("x_measured", "v_measured"))
        return rows

    with Instance(encoder) as run:
        run.initialise(jitter=1e-5)
        sampled(run, 1e-3 * np.arange(10.0) ** 2, 1.0)
        state = run.serialised()
        first = go_on(run)
        run.restore(state)
        assert go_on(run) == first
