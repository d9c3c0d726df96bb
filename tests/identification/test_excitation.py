"""Records made to lack one thing, and one that lacks nothing."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from friction_fmus.identification import ROTARY, Record, RecordError, examine
from friction_fmus.identification.data.excitation import examine_segments
from friction_fmus.identification.data.record import Array

TS = 2e-3
M, FC, FV, STIFFNESS = 5.0, 10.0, 20.0, 1e6


def hump(amplitude: float, frequency: float, periods: int) -> tuple[Array, Array, Array]:
    """To and fro from rest: position, velocity, acceleration."""
    t = np.arange(round(periods / frequency / TS)) * TS
    w = 2 * np.pi * frequency
    a = 0.5 * amplitude
    return a * (1 - np.cos(w * t)), a * w * np.sin(w * t), a * w**2 * np.cos(w * t)


def trapezoid(length: float, speed: float, ramp: float, turns: int) -> tuple[Array, Array, Array]:
    """Strokes at one speed, with ramps of this duration."""
    plateau = round((length / speed - ramp) / TS)
    rise = np.arange(round(ramp / TS)) * TS
    v = np.concatenate([speed / ramp * rise, np.full(plateau, speed), speed - speed / ramp * rise])
    v = np.concatenate([side * v for side in [1.0, -1.0] * turns])
    return np.cumsum(v) * TS, v, np.gradient(v, TS)


def record(*parts: tuple[Array, Array, Array], noise: float = 0.05, quantum: float = 0.0) -> Record:
    """An axis with Dahl's friction (n = 1, in closed form from sample to sample) that makes these motions."""
    q, v, a = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    z, friction = 0.0, np.zeros_like(q)
    for k in range(1, len(q)):
        step = q[k] - q[k - 1]
        target = FC * np.sign(step)
        z = target + (z - target) * np.exp(-STIFFNESS / FC * abs(step))
        friction[k] = z
    random = np.random.default_rng(7)
    force = M * a + FV * v + friction + noise * random.standard_normal(len(q))
    measured = quantum * np.round(q / quantum) if quantum else q
    return Record("made", t=np.arange(len(q)) * TS, q=measured, force=force, quantum=quantum)


FAST = hump(0.04, 1.0, 6)
SLOW = hump(0.02, 0.05, 1)
TINY = hump(2e-5, 0.5, 4)


def names(made: Record) -> list[str]:
    return [finding.name for finding in examine(made)]


def test_a_good_record_has_no_findings() -> None:
    assert examine(record(FAST, SLOW, TINY)) == ()
    assert examine(record(FAST, SLOW, TINY, quantum=1e-7)) == ()


def test_noise_of_the_position_makes_no_findings() -> None:
    made = record(FAST, SLOW, TINY)
    noisy = made.q + 2e-7 * np.random.default_rng(3).standard_normal(len(made))
    assert examine(replace(made, q=noisy)) == ()


def test_a_record_of_velocity_alone_is_examined_too() -> None:
    made = record(FAST, SLOW, TINY)
    v = np.concatenate([FAST[1], SLOW[1], TINY[1]])
    assert examine(replace(made, q=None, v=v)) == ()


def test_a_motion_to_one_side_has_no_reversal() -> None:
    t = np.arange(5000) * TS
    v = 0.05 * (1.01 - np.cos(2 * np.pi * 0.3 * t))
    made = record((np.cumsum(v) * TS, v, np.gradient(v, TS)))
    assert "no-reversal" in names(made)
    assert "few-reversals" not in names(made)


def test_one_stroke_to_and_fro_has_few_reversals() -> None:
    first, *_ = examine(record(hump(0.04, 0.5, 1), hump(0.004, 0.05, 1)))
    assert first.name == "few-reversals"
    assert "3 times" in first.what


def test_strokes_at_one_speed_are_named_with_the_speed() -> None:
    found = {finding.name: finding for finding in examine(record(trapezoid(0.05, 0.1, 0.05, 4), TINY))}
    assert set(found) == {"one-speed", "no-low-speed"}
    assert "within 10 % of one speed, 100 mm/s" in found["one-speed"].what
    assert found["one-speed"].measure == "Move at 5 speeds or more, from 1 mm/s to 100 mm/s."


def test_fast_motion_alone_has_no_low_speed() -> None:
    assert names(record(FAST, TINY)) == ["no-low-speed"]


def test_long_strokes_alone_have_no_presliding() -> None:
    (finding,) = examine(record(FAST, SLOW))
    assert finding.name == "no-presliding"
    assert "The shortest strokes are" in finding.what
    assert finding.measure == "Add slow sines with amplitudes from 2 µm to 100 µm."


def test_a_coarse_encoder_is_named_with_its_step() -> None:
    (finding,) = (f for f in examine(record(FAST, SLOW, TINY, quantum=5e-5)) if f.name == "coarse-position")
    assert "resolution of the position is 50 µm" in finding.what
    assert finding.measure == "Measure the position with a resolution of 2 µm or better."


def test_a_motion_of_a_few_steps_of_the_encoder_is_coarse() -> None:
    assert "coarse-position" in names(record(hump(2e-5, 0.5, 4), quantum=1e-6))


def test_few_samples_behind_a_reversal_are_too_slow_sampling() -> None:
    made = record(hump(0.2, 5.0, 20), SLOW, TINY)
    assert names(made) == ["slow-sampling"]
    # 0.1 mm = 0.1 m (1 - cos(2 pi 5 t)) at t = 1.4 ms, within one interval of 2 ms
    (finding,) = examine(made)
    assert "first 100 µm have only 2 samples" in finding.what or "first 100 µm have only 1 sample," in finding.what


def test_slow_motion_does_not_show_the_mass() -> None:
    # 5 kg at (2 pi 0.2)^2 x 10 mm = 0.016 m/s2 are 0.08 N of 10 N
    made = record(hump(0.02, 0.2, 2), hump(0.002, 0.05, 1), TINY)
    assert names(made) == ["no-acceleration"]
    assert names(replace(made, force=None, friction=made.force)) == []


def test_a_limited_force_is_saturated() -> None:
    made = record(FAST, SLOW, TINY)
    limit = 0.8 * float(made.force.max())
    found = {finding.name: finding for finding in examine(replace(made, force=np.clip(made.force, -limit, limit)))}
    assert list(found) == ["force-saturated"]
    assert f"exactly the largest force, {limit:.4g} N" in found["force-saturated"].what


def test_a_force_without_noise_is_not_taken_for_a_saturated_one() -> None:
    made = record(trapezoid(0.05, 0.1, 0.05, 4), SLOW, TINY, noise=0.0)
    assert "force-saturated" not in names(made)


@pytest.mark.parametrize("column", ["q", "force"])
def test_constant_columns_are_named(column: str) -> None:
    made = record(FAST, SLOW, TINY)
    (finding,) = examine(replace(made, **{column: np.full(len(made), 3.0)}))
    assert finding.name == "constant-column"
    assert "is 3 in all" in finding.what


def test_an_axis_at_rest_has_no_motion() -> None:
    made = record(FAST, SLOW, TINY)
    noise = 1e-6 * np.random.default_rng(2).standard_normal(len(made))
    assert names(replace(made, q=noise)) == ["no-motion"]


def test_a_rotary_axis_is_judged_in_radians() -> None:
    made = record(hump(4.0, 0.5, 6), hump(2.0, 0.05, 1))
    (finding,) = (f for f in examine(replace(made, units=ROTARY)) if f.name == "no-presliding")
    assert "after at most 0.001 rad" in finding.what


def test_pieces_lack_what_all_of_them_lack() -> None:
    without_tiny, without_slow = record(FAST, SLOW), record(FAST, TINY)
    assert examine_segments([without_tiny, without_slow]) == ()
    assert [f.name for f in examine_segments([without_tiny, record(FAST)])] == ["no-presliding"]


def test_every_finding_says_what_and_what_to_measure() -> None:
    for finding in (*examine(record(FAST)), *examine(record(trapezoid(0.05, 0.1, 0.05, 1)))):
        assert finding.what.endswith(".")
        assert finding.measure.endswith(".")
        assert any(letter.isdigit() for letter in finding.what)


def test_a_window_that_holds_nothing_is_an_error() -> None:
    with pytest.raises(RecordError, match="fewer than 3 samples"):
        record(FAST).window(100.0, 101.0)


def test_the_pages_list_every_finding() -> None:
    root = Path(__file__).parents[2]
    sources = [path.read_text(encoding="utf-8") for path in (root / "friction_fmus" / "identification").rglob("*.py")]
    made = {name for source in sources for name in re.findall(r'Finding\(\s*"([a-z-]+)"', source)}
    pages = ("identification.md", "study-of-an-axis.md")
    text = "".join((root / "docs" / page).read_text(encoding="utf-8") for page in pages)
    assert len(made) > 15
    assert {name for name in made if f"`{name}`" not in text} == set()
