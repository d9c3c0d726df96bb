"""The thermal motion of the Prandtl-Tomlinson tip: equipartition for every interval of the noise, Boltzmann's
distribution over the corrugation, drag and diffusion of Langevin's equation."""

from __future__ import annotations

import math
from collections.abc import Callable
from ctypes import c_double, c_uint
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from shell.instance import Instance, Library, load
from thorough import nightly, some

KT, M, DT = 0.7, 2e-3, 0.01


@pytest.fixture(scope="module")
def tip(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("PrandtlTomlinson"))


def trajectory(run: Instance, steps: int, h: float) -> np.ndarray:
    """x and w after each of `steps` steps of h."""
    found = np.empty((steps, 2))
    references, values = (c_uint * 2)(run.reference("x"), run.reference("w")), (c_double * 2)()
    t = run.get1("time")
    for j in range(steps):
        run.step(t + j * h, h)
        run.must("GetReal", references, 2, values)
        found[j] = values
    return found


def bound_of_variance(stiffness: float, damping: float, h: float, steps: int) -> np.ndarray:
    """Standard errors of the mean squares of x and w over their means, of Langevin's equation of a spring.

    For a stationary Gaussian series with the correlation rho the mean of n squares has the relative variance
    2/n sum of (1 - |k|/n) rho_k^2; rho follows from the regression theorem, (x, w)' = A (x, w) on average."""
    to_next = expm(h * np.array([[0.0, 1.0], [-stiffness / M, -damping]]))
    total, power = np.ones(2), np.eye(2)
    for k in range(1, steps):
        power = power @ to_next
        rho = np.diag(power)
        total += 2.0 * (1.0 - k / steps) * rho**2
        if np.abs(power).max() < 1e-9:
            break
    return np.sqrt(2.0 / steps * total)


@pytest.mark.parametrize("h", [1.0, 1.3], ids=["on the grid", "between"])
@pytest.mark.parametrize("y", some([0.01, 0.1, 1.0, 3.0, 10.0, 100.0, 1e4], [0.01, 1.0, 100.0]))
def test_position_and_velocity_share_the_temperature(tip: Library, y: float, h: float) -> None:
    """<x^2> k / kT = m <w^2> / kT = 1, however much of the motion the damping takes within an interval of the noise."""
    damping, steps = y / DT, 10000
    stiffness = M * max(0.1 * y, (0.5 * y) ** 2 if y < 0.4 else 0.0) / DT**2  # a tenth decays per dt, or critical
    draw = np.random.default_rng(1)
    size = math.sqrt(KT / stiffness)
    start = {"x": draw.normal() * size, "w": draw.normal() * math.sqrt(KT / M)}
    with Instance(tip) as run:
        run.initialise(tolerance=1e-6, m=M, k=stiffness, damping=damping, E0=0.0, a=size, kT=KT, dt=DT, **start)
        found = (trajectory(run, steps, h * DT) ** 2).mean(axis=0) * [stiffness / KT, M / KT]
    assert (np.abs(found - 1.0) < 4.0 * bound_of_variance(stiffness, damping, h * DT, steps)).all(), found


def test_a_strongly_damped_tip_on_a_spring_is_not_too_hot(tip: Library) -> None:
    """y = 10 at a spring of 1 N/m: a force that is held over dt makes the position 5.4 times too hot."""
    m, damping, k, steps = 1e-3, 1e3, 1.0, 40000
    with Instance(tip) as run:
        run.initialise(tolerance=1e-6, m=m, k=k, damping=damping, E0=0.0, kT=1.0, dt=DT)
        found = (trajectory(run, steps, DT) ** 2).mean(axis=0) * [k, m]
    relaxations = steps * DT * k / (m * damping)  # x forgets with k/(m damping), so x^2 with twice that
    assert abs(found[0] - 1.0) < 4.0 * math.sqrt(2.0 / relaxations)
    assert abs(found[1] - 1.0) < 4.0 * math.sqrt(2.0 / steps)


@nightly
@pytest.mark.parametrize(("y", "dt"), some([(0.2, 0.1), (2.0, 0.2), (20.0, 0.4)], [(2.0, 0.2)]))
@pytest.mark.parametrize("E0", some([0.5, 2.0], [2.0]))
def test_over_a_corrugation_the_tip_follows_boltzmann(tip: Library, y: float, dt: float, E0: float) -> None:
    """Means of cos(2 pi x), x^2, |x| and w^2 by quadrature, after a start from that distribution; the errors from runs
    with other seeds."""
    k, kT, m, steps, runs = 1.0, 0.5, 1.0, 400, 120
    x = np.linspace(-8.0, 8.0, 16001)
    weight = np.exp(-(k * x**2 / 2.0 + E0 / 2.0 * (1.0 - np.cos(2.0 * math.pi * x))) / kT)
    weight /= weight.sum()

    def observed(x: np.ndarray) -> list[np.ndarray]:
        return [np.cos(2.0 * math.pi * x), x**2, np.abs(x)]

    exact = [*((weight * f).sum() for f in observed(x)), kT / m]
    draw, means = np.random.default_rng(5), []
    for seed in range(runs):
        start = {"x": draw.choice(x, p=weight), "w": draw.normal() * math.sqrt(kT / m)}
        with Instance(tip) as run:
            run.initialise(tolerance=1e-6, m=m, k=k, damping=y / dt, E0=E0, kT=kT, dt=dt, seed=seed, **start)
            run.step(0.0, 20.0 * dt)
            places, speeds = trajectory(run, steps, 3.1 * dt).T
        means.append([*(f.mean() for f in observed(places)), (speeds**2).mean()])
    error = np.std(means, axis=0, ddof=1) / math.sqrt(runs)
    away = np.abs(np.mean(means, axis=0) - exact)
    assert (away < 4.5 * error).all(), (away, error)  # one in 60000
    assert (error < 0.15 * np.abs(exact)).all(), (error, exact)


@pytest.mark.parametrize("y", some([0.1, 1.0, 10.0, 100.0], [10.0]))
def test_a_free_tip_diffuses_as_einstein_says(tip: Library, y: float) -> None:
    """<x^2> = 2 kT t / (m damping) over times much longer than 1/damping; chi square of many seeds."""
    damping, runs = y / DT, 800
    t = round(200.0 / min(y, 1.0)) * DT
    ends = np.empty(runs)
    for seed in range(runs):
        with Instance(tip) as run:
            run.initialise(tolerance=1e-6, m=M, k=1e-30, damping=damping, E0=0.0, kT=KT, dt=DT, seed=seed)
            run.step(0.0, t)
            ends[seed] = run.get1("x")
    transient = 1.0 - 3.0 / (2.0 * damping * t)  # a start at rest: 2 D (t - 3/(2 damping))
    expected = 2.0 * KT / (M * damping) * t * transient
    assert abs((ends**2).mean() / expected - 1.0) < 4.0 * math.sqrt(2.0 / runs) + 0.01


@pytest.mark.parametrize("y", [0.1, 1.0, 10.0, 100.0])
def test_a_pulled_tip_feels_the_drag_of_its_damping(tip: Library, y: float) -> None:
    """m damping v on average, at a temperature that hides nothing."""
    m, v, k, dt, parts = 1.0, 0.3, 50.0, 0.1, 100
    damping = y / dt
    settled = dt * math.ceil(16.0 * max(m * damping / k, 2.0 / damping) / dt)
    with Instance(tip) as run:
        run.initialise(v=v, m=m, k=k, damping=damping, E0=0.0, kT=1e-24, dt=dt)
        run.step(0.0, settled)
        forces = []
        for j in range(parts):
            run.step(settled + j * dt / parts, dt / parts)
            forces.append(run.get1("F"))
    assert np.mean(forces) == pytest.approx(m * damping * v, rel=3e-3)


def test_the_noise_does_not_depend_on_the_start_time(tip: Library) -> None:
    """Intervals of 10 ns after a Unix time, whose rounding is 240 ns: they are counted, not read off the time."""
    found = []
    for start in (0.0, 1.7e9):
        with Instance(tip) as run:
            run.initialise(start=start, m=M, kT=KT, dt=1e-8, E0=0.0)
            found.append([])
            for k in range(20):
                run.step(start + k * 1e-6, 1e-6)
                found[-1].append(run.get1("w"))
    assert found[0] == found[1]


def test_noise_begins_long_after_the_start(tip: Library) -> None:
    """At 1e14 intervals after the start, the end of an interval is lost in the time."""
    with Instance(tip) as run:
        run.initialise(kT=0.0, E0=0.0, dt=DT)
        run.step(0.0, 1e12)
        run.set({"kT": KT})
        run.step(1e12, 3.0 * DT)
        assert run.get1("w") != 0.0
