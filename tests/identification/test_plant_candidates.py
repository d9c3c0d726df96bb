"""Effects beyond a rigid mass are named with their size, on axes simulated in `flexible_axis`; clean axes get none."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flexible_axis import Axis, moves, reference, simulate
from thorough import THOROUGH, landing, nightly, some

from friction_fmus.data import load_emps
from friction_fmus.identification import ROTARY, Record, plant_candidates
from friction_fmus.identification.plant_candidates import plant_findings
from friction_fmus.study.config import load_config
from friction_fmus.study.data import load_data

T = 1e-3 * np.arange(20000.0 if THOROUGH else 14000.0)
TWO = Axis(motor=4.0, load=8.0, kp=8.0, kv=300.0)


NUMBER = r"-?\d+\.?\d*(?:e[-+]?\d+)?"


def numbers_of(text: str) -> list[float]:
    """Return the numbers of a sentence, without standard errors."""
    return [float(each) for each in re.findall(rf"(?<!± )(?<![\d.e-]){NUMBER}", text)]


def named(record: Record) -> tuple[str, list[float]]:
    """Return the name of the only finding and the numbers in it, without standard errors."""
    (finding,), _ = plant_findings([record])
    return finding.name, numbers_of(finding.what)


@nightly
@pytest.mark.parametrize("load_friction", [0.0, 10.0])
def test_two_masses(load_friction):
    own = 18.0 if not load_friction else 8.0
    axis = replace(TWO, load_friction=load_friction, forward=own, backward=own)
    record = simulate(axis, moves(T))
    (finding,), load = plant_findings([record])
    assert finding.name == "two-masses"
    assert load is not None
    assert load.resonance == pytest.approx(axis.resonance, rel=0.05)
    numbers = numbers_of(finding.what)
    assert numbers[:2] == pytest.approx([axis.motor, axis.load], rel=0.12)
    if load_friction:
        assert numbers[2] == pytest.approx(load_friction, rel=0.15)
    assert f"{finding.measure}".startswith(f"Set resonance = [{load.resonance:.3g}] in [axis]")


@landing
def test_direction_dependent_friction():
    name, (forward, backward, constant) = named(simulate(Axis(forward=22.0, backward=15.0, noise=0.5), reference(T)))
    assert name == "direction-dependent-friction"
    assert (forward, backward, constant) == pytest.approx((22.0, 15.0, 3.5), rel=0.1)


def test_a_constant_force_above_friction():
    record = simulate(Axis(), moves(T))
    name, (constant, _) = named(replace(record, force=record.column("force") - 40.0))
    assert name == "constant-force"
    assert constant == pytest.approx(-40.0, rel=0.02)


@landing
@pytest.mark.parametrize("path", some([moves, reference], [moves]))
def test_drift_of_friction(path):
    name, (begin, end, *_) = named(simulate(Axis(drift=-0.3), path(T)))
    assert name == "friction-drifts"
    assert (begin, end) == pytest.approx((18.0, 12.6), rel=0.1)


@landing
def test_drift_of_a_constant_force():
    axis = Axis(offset_drift=-6.0)
    record = simulate(axis, reference(T))
    name, (begin, end) = named(replace(record, force=record.column("force") + 3.0))  # 3 N at the begin, -3 N at the end
    assert name == "offset-drifts"
    assert (begin, end) == pytest.approx((3.0, -3.0), rel=0.1)


@landing
def test_gravity_of_a_rotary_axis():
    axis = Axis(gravity=60.0, limit=4000.0)
    record = replace(simulate(axis, moves(T, stroke=3.0, duration=1.0, period=1.5)), units=ROTARY)
    name, (size,) = named(record)
    assert name == "gravity"
    assert size == pytest.approx(60.0, rel=0.1)


@nightly
@pytest.mark.parametrize("gap", [2e-4, 5e-4])
def test_backlash(gap):
    axis = replace(
        TWO, backlash=gap, resonance=100.0, kp=40.0, kv=1500.0, forward=8.0, backward=8.0, load_friction=10.0
    )
    name, numbers = named(simulate(axis, moves(T)))
    assert name == "backlash"
    assert 0.5 * gap < numbers[-1] < 2.5 * gap  # bounces on impact make it look wider


@pytest.mark.parametrize("limit", [None, 30.0])
def test_share_of_saturation(limit):
    t = 1e-3 * np.arange(10000.0)
    wanted = 40.0 * np.sin(2.0 * np.pi * 0.7 * t)
    record = Record("axis", t, q=np.sin(t), force=np.clip(wanted, -30.0, 30.0))
    finding = plant_findings([record], limit)[0][0]
    assert finding.name == "saturated"
    numbers = numbers_of(finding.what)
    level = 0.98 * 30.0 if limit else 30.0
    assert numbers == pytest.approx([30.0, 100.0 * (1.0 - 2.0 / np.pi * np.arcsin(level / 40.0))], rel=0.01)
    assert "Do not trust the intervals" in finding.measure
    rare = replace(record, force=np.where(t < 9.9, 0.5, 1.0) * np.clip(wanted, -30.0, 30.0))
    assert "saturated" not in [each.name for each in plant_findings([rare], 30.0)[0]]


@landing
def test_a_current_without_sign_is_not_at_its_limit_at_rest():
    """A third of the log at rest, where the current is zero, its least value; a limit of 30 on one side only is one."""
    t = 1e-3 * np.arange(9000.0)
    force = np.where(t < 3.0, 0.0, np.abs(20.0 * np.sin(2.0 * np.pi * 0.7 * t)))
    record = Record("axis", t, q=np.sin(t), force=force)
    assert "saturated" not in [each.name for each in plant_findings([record], None)[0]]
    limited = replace(
        record, force=np.maximum(40.0 * np.sin(2.0 * np.pi * 0.7 * t) + np.where(t == 1.0, 5.0, 0.0), -30.0)
    )
    finding = plant_findings([limited], None)[0][0]
    assert (finding.name, numbers_of(finding.what)[0]) == ("saturated", pytest.approx(30.0))


CLEAN = {
    "moves": (Axis(noise=0.5), moves(T)),
    "harmonics": (Axis(noise=0.5), reference(T)),
    "noisy": (Axis(noise=3.0), moves(T)),
    "coarse": (Axis(quantum=1e-5, noise=0.5), moves(T)),
    "slow": (Axis(noise=0.5), moves(T, stroke=0.02, duration=0.5, period=0.8)),
    "late": (Axis(delay=4, kv=600.0, noise=0.5), moves(T)),
    "presliding": (Axis(presliding=3e5, viscous=300.0, noise=0.5), moves(T, stroke=1e-2)),
    "frictionless": (Axis(forward=0.0, backward=0.0, viscous=5.0, noise=0.5), moves(T)),
}


@landing
@pytest.mark.parametrize("case", some([*CLEAN], ["noisy", "coarse", "presliding", "frictionless"]))
@pytest.mark.parametrize("seed", some([1, 2], [1]))
def test_nothing_is_named_on_a_clean_axis(case, seed):
    axis, path = CLEAN[case]
    assert plant_findings([simulate(axis, path, seed)], axis.limit) == ((), None)


@landing
def test_records_of_the_package(tmp_path: Path):
    (finding,), _ = plant_findings([load_emps()], 351.5)
    assert finding.name == "direction-dependent-friction"  # the constant force of -3.16 N of Janot et al. 2019
    assert float(re.findall(r"force of (-?\d+\.\d+)", finding.what)[0]) == pytest.approx(-3.16, rel=0.05)
    assert plant_findings(load_data(load_config("demo"), tmp_path).records, 20.0) == ((), None)


@pytest.mark.parametrize(("frequency", "size", "name"), [(1.3, 20.0, "missing-force"), (7.1, 3.0, "disturbed-force")])
def test_a_periodic_force_from_outside(frequency, size, name):
    """It moves the axis, the drive acts against it, and the log has the force of the drive alone."""
    record = simulate(Axis(noise=0.5, outside=(size, frequency)), reference(T))
    (finding,), load = plant_findings([record])
    assert (finding.name, load) == (name, None)
    found, amplitude = numbers_of(finding.what)
    assert found == pytest.approx(frequency, abs=0.2 / T[-1])
    assert amplitude == pytest.approx(size, rel=0.05)


@landing
def test_a_drift_beside_a_periodic_force_from_outside():
    record = simulate(Axis(noise=0.5, drift=-0.4, outside=(20.0, 1.3)), moves(T))
    assert [each.name for each in plant_findings([record])[0]] == ["missing-force", "friction-drifts"]


def test_a_periodic_force_in_segments_of_a_log():
    record = simulate(Axis(noise=0.5, outside=(20.0, 1.3)), moves(T))
    first, second = record.window(0.0, 0.55 * T[-1]), record.window(0.6 * T[-1], T[-1])
    (finding,), _ = plant_findings([first, replace(second, t=second.t - second.t[0])])  # a clock of its own
    assert numbers_of(finding.what) == pytest.approx([1.3, 20.0], rel=0.05)


@landing
def test_a_ripple_at_one_speed_is_cogging():
    """After 2 s at one speed, the force is periodic in time, too: 12 kg, 18 N, 45 N.s/m, 10 N over 24 mm."""
    w, shakes = 4.0 * np.pi, T < 2.0
    q = 0.05 * T + np.where(shakes, 3e-3 * (1.0 - np.cos(w * T)), 0.0)
    v, a = 0.05 + np.where(shakes, 3e-3 * w * np.sin(w * T), 0.0), np.where(shakes, 3e-3 * w**2 * np.cos(w * T), 0.0)
    noise = 0.5 * np.random.default_rng(1).standard_normal(len(T))
    ripple = 10.0 * np.sin(2.0 * np.pi * q / 0.024)
    name, numbers = named(Record("axis", T, q=q, force=12.0 * a + 18.0 + 45.0 * v + ripple + noise))
    assert name == "cogging"
    assert numbers == pytest.approx([10.0, 0.024], rel=0.05)


def test_records_without_force_are_left_alone():
    t = 1e-3 * np.arange(3000.0)
    assert plant_findings([Record("axis", t, q=np.sin(t))]) == ((), None)
    assert plant_findings([Record("axis", t[:60], q=np.sin(t[:60]), force=np.cos(t[:60]))]) == ((), None)


@landing
@pytest.mark.parametrize("begin", some([0.0, 8.0], [8.0]))
def test_friction_that_varies_is_found_beside_a_rest(begin):
    """Coulomb friction of 18 +- 9 N, alternately for 2.5 s, with a rest of 4 s."""
    t = 1e-3 * np.arange(20000.0)
    record = simulate(Axis(noise=0.3), moves(np.where(begin > t, t, np.maximum(t - 4.0, begin))))
    more = np.where((t // 2.5) % 2 == 0, 9.0, -9.0) * np.sign(np.gradient(record.q))
    name, sizes = named(replace(record, force=record.column("force") + more))
    assert name == "friction-varies"
    assert sizes == pytest.approx((9.0, 27.0), rel=0.02)


@landing
def test_a_second_mass_in_a_part_of_a_long_record_holds_for_all_of_it(monkeypatch):
    monkeypatch.setattr(plant_candidates, "LONG", 6000)
    name, numbers = named(simulate(TWO, moves(T)))  # without the second mass, a force over position would be found
    assert name == "two-masses"
    assert numbers[:2] == pytest.approx([TWO.motor, TWO.load], rel=0.12)
