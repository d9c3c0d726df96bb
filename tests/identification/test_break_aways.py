"""Break-away experiments: on axes whose static friction is known, and on a measured record."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from friction_fmus.data import load_tribometer
from harness import CallablePart, FmuPart, Port, System

sys.path.append(str(Path(__file__).parents[2] / "examples" / "identification"))
from break_aways import BreakAways, find_break_aways

BuildFmu = Callable[..., Path]
FC, FS = 1.0, 1.5


def ramp(rate: float) -> CallablePart:
    return CallablePart("ramp", lambda t, u, x: [rate * t], [], [Port("F", "N")])


def axis(build_fmu: BuildFmu, friction: str | None, **start: float) -> Callable[[float, float], System]:
    """A mass of 1 kg with a friction model, or Karnopp's with friction inside."""

    def system(position: float, rate: float) -> System:
        if friction is None:
            parts = [ramp(rate), FmuPart("mass", build_fmu("KarnoppMass"))]
            wires = ["ramp.F -> mass.F_ext"]
        else:
            parts = [ramp(rate), FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu(friction))]
            wires = ["ramp.F -> mass.F_drive", "mass.v -> friction.v", "friction.F -> mass.F_friction"]
        return System(parts, wires, {"mass.x0": position, **{key.replace("_0_", "."): v for key, v in start.items()}})

    return system


def break_away(
    system: Callable[[float, float], System],
    positions: tuple[float, ...] = (0.0,),
    *,
    rate: float,
    travel: float,
    stop: float,
    step: float = 1e-3,
) -> BreakAways:
    """Ramps of the force after half a second of rest, forward and backward, until the axis has moved by the travel."""
    rows = []
    for position in positions:
        for way in (1.0, -1.0):
            with system(position, way * rate) as made:
                result = made.run(stop=stop, step=step, record=["ramp.F", "mass.x"], master="newton")
            F, x = (result[name].to_numpy() for name in ("ramp.F", "mass.x"))
            end = int((np.abs(x - x[0]) > travel).argmax()) + 1
            rested = np.zeros(round(0.5 / step))  # before the ramp
            t = step * np.arange(rested.size + end)
            F, x = np.append(rested, F[:end]), np.append(rested + position, x[:end])
            found = find_break_aways(t, F, x, travel=travel, dwell=0.3)
            assert found.force.size == 1
            rows.append([getattr(found, field.name)[0] for field in fields(found)])
    return BreakAways(*map(np.array, zip(*rows, strict=True)))


@pytest.mark.parametrize("rate", [0.5, 5.0])
def test_a_rigid_contact_breaks_away_late_by_the_time_of_the_travel(build_fmu: BuildFmu, rate: float) -> None:
    """(Fs - Fc) t^2/2 + rate t^3/6 = m travel."""
    karnopp = axis(build_fmu, None, mass_0_DV=1e-12, mass_0_Fv=0.0)
    travel, step = 1e-4, 2e-4
    late = brentq(lambda t: (FS - FC) * t**2 / 2.0 + rate * t**3 / 6.0 - travel, 0.0, 1.0)
    found = break_away(karnopp, (0.0, 0.3), rate=rate, travel=travel, stop=FS / rate + 0.1, step=step)
    assert list(found.direction) == [1.0, -1.0] * 2
    assert list(found.position) == [0.0, 0.0, 0.3, 0.3]
    assert found.force == pytest.approx([FS + rate * late] * 4, abs=2.0 * rate * step + 1e-6)
    assert found.rate == pytest.approx([rate] * 4, rel=1e-9)
    assert found.sliding.all()
    assert found.level(1)[0] == pytest.approx(FS, abs=0.03 * rate)
    assert found.level(-1)[1] < 1e-9


def test_each_direction_has_its_level(build_fmu: BuildFmu) -> None:
    forward, backward = (axis(build_fmu, None, mass_0_DV=1e-12, mass_0_Fs=level) for level in (2.0, 1.6))
    found = break_away(
        lambda position, rate: (forward if rate > 0.0 else backward)(position, rate),
        rate=0.5,
        travel=1e-4,
        stop=5.0,
    )
    assert found.level(1)[0] == pytest.approx(2.0, rel=1e-2)
    assert found.level(-1)[0] == pytest.approx(1.6, rel=1e-2)


def lugre_break_away(rate: float, travel: float) -> float:
    """By scipy, from the equations."""
    s0, s1, s2, vs = 1e5, 316.22776601683796, 0.4, 1e-3

    def rates(t: float, y: np.ndarray) -> list[float]:
        _, v, z = y
        slope = v - s0 * abs(v) * z / (FC + (FS - FC) * np.exp(-((v / vs) ** 2)))
        return [v, rate * t - s0 * z - s1 * slope - s2 * v, slope]

    def away(t: float, y: np.ndarray) -> float:
        return float(y[0] - travel)

    away.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(rates, (0.0, 3.0 * FS / rate), np.zeros(3), "Radau", events=away, rtol=1e-9, atol=1e-14)
    return float(rate * found.t[-1])


@pytest.mark.parametrize("rate", [0.3, 3.0])
def test_lugre_breaks_away_as_its_equations_do(build_fmu: BuildFmu, rate: float) -> None:
    found = break_away(axis(build_fmu, "LuGre"), rate=rate, travel=1e-3, stop=FS / rate + 0.5)
    assert found.force == pytest.approx([lugre_break_away(rate, 1e-3)] * 2, abs=2.0 * rate * 1e-3)
    assert found.level(1)[0] == pytest.approx(FS, rel=0.06 if rate < 1.0 else 0.2)
    assert found.sliding.all()


def test_gms_breaks_away_at_its_static_friction(build_fmu: BuildFmu) -> None:
    found = break_away(axis(build_fmu, "GMS"), rate=0.6, travel=1e-3, stop=4.0)
    assert found.level(1)[0] == pytest.approx(FS, rel=0.02)
    assert found.level(-1)[0] == pytest.approx(FS, rel=0.02)


def test_a_travel_within_presliding_is_not_taken_for_break_away(build_fmu: BuildFmu) -> None:
    found = break_away(axis(build_fmu, "LuGre"), rate=1.0, travel=5e-6, stop=3.0)
    assert not found.sliding.any()
    with pytest.raises(ValueError, match="did not slide forward within `travel` in any of 1 break-aways"):
        found.level(1)


def test_a_made_record_has_the_break_aways_that_it_was_made_with() -> None:
    """Holds of 1 s and strokes of 10 mm in 0.5 s: the force rises to a peak, then falls to the level of sliding."""
    t = 1e-3 * np.arange(6000)
    phase, cycle = t % 1.5, (t // 1.5).astype(int)
    way = np.where(cycle % 2 == 0, 1.0, -1.0)
    moving = phase >= 1.0
    x = np.where(way > 0, 0.0, 10e-3) + way * np.where(moving, 10e-3 * (phase - 1.0) / 0.5, 0.0)
    peak = np.array([3.0, 4.0, 3.2, 4.4])[cycle]
    force = way * np.where(moving, np.where(phase < 1.01, peak, 2.0), peak * (phase - 0.5).clip(0.0) / 0.5)
    found = find_break_aways(t, force, x, travel=1e-3, dwell=0.5)
    assert list(found.direction) == [1.0, -1.0, 1.0, -1.0]
    assert list(found.force) == [3.0, 4.0, 3.2, 4.4]
    assert found.dwell == pytest.approx(np.full(4, 1.0), abs=0.03)
    assert found.position == pytest.approx([0.0, 10e-3, 0.0, 10e-3], abs=1e-5)
    assert found.rate == pytest.approx(2.0 * np.array([3.0, 4.0, 3.2, 4.4]), rel=0.01)  # not 1 s, but 0.5 s of rise
    assert found.level(1) == pytest.approx((3.1, 0.1))
    assert found.level(-1) == pytest.approx((4.2, 0.2))
    assert find_break_aways(t, force, x, travel=1e-3, dwell=2.0).force.size == 0


def test_the_tribometer_breaks_away_after_each_of_its_holds() -> None:
    """Against the largest force of each stroke until 0.2 mm, with strokes from the differences of the positions."""
    record = load_tribometer()
    t, x, F = record.t, record.q, record.friction
    assert F is not None
    found = find_break_aways(t, F, x, travel=0.2e-3, dwell=0.4)
    assert found.sliding.all()
    assert (found.dwell > 0.9).all()
    speed = np.gradient(x, t)
    way = np.where(np.abs(speed) > 0.05e-3, np.sign(speed), 0.0)
    starts = np.flatnonzero((way[1:] != 0.0) & (way[:-1] == 0.0)) + 1
    peaks = []
    for start in starts:
        stroke = slice(start, start + np.flatnonzero(way[start:] != way[start])[0])
        far = np.abs(x[stroke] - x[start]) > 0.2e-3
        if far.any():
            peaks.append((way[start], np.max(way[start] * F[stroke][: far.argmax() + 1])))
    assert len(peaks) == found.force.size == 100
    assert found.direction == pytest.approx(np.array(peaks)[:, 0])
    assert found.force == pytest.approx(np.array(peaks)[:, 1], rel=5e-3)
    for direction in (1, -1):
        level, error = found.level(direction)
        assert 0.41 < level / 5.0 < 0.50
        assert error < 0.01
