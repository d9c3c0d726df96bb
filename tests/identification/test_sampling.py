from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from friction_fmus.identification import RecordError, RecordFinding, read_measurement
from friction_fmus.identification.data.excitation import position_findings
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.force_findings import FORBIDDING, contradictions

HZ = 5.0
T = np.arange(1000) * 1e-3


def motion(t: Array) -> Array:
    return 0.01 * np.sin(2 * np.pi * HZ * t)


def velocity(t: Array) -> Array:
    return 0.01 * 2 * np.pi * HZ * np.cos(2 * np.pi * HZ * t)


def axis(folder: Path, t: Array, q: Array, force: Array, v: Array | None = None, r: Array | None = None) -> Path:
    columns = {"t [s]": t, "x [m]": q, "force [N]": force}
    columns |= {} if v is None else {"v [m/s]": v}
    columns |= {} if r is None else {"ref [m]": r}
    path = folder / "axis.csv"
    rows = [",".join(f"{value:.12g}" for value in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join([",".join(columns), *rows]) + "\n", encoding="utf-8")
    return path


def named(findings: tuple[RecordFinding, ...]) -> list[str]:
    return [finding.name for finding in findings]


def test_equal_intervals_are_kept_as_they_are(tmp_path: Path) -> None:
    measurement = read_measurement(axis(tmp_path, T, motion(T), velocity(T)))
    assert measurement.findings == ()
    assert measurement.records[0].q == pytest.approx(motion(T), abs=1e-12)


def test_jittered_times_are_resampled_and_named(tmp_path: Path) -> None:
    t = T + np.random.default_rng(1).uniform(-2e-4, 2e-4, len(T))
    measurement = read_measurement(axis(tmp_path, t, motion(t), velocity(t)))
    assert named(measurement.findings) == ["irregular-sampling"]
    assert "cubic spline" in measurement.findings[0].what
    (record,) = measurement.records
    assert np.ptp(np.diff(record.t)) < 1e-9
    assert record.q == pytest.approx(motion(record.t), abs=1e-8)
    # linear between samples h apart: (2 pi f h)^2 / 8 of the amplitude
    assert record.force == pytest.approx(velocity(record.t), abs=0.314 * (2 * np.pi * HZ * 1.4e-3) ** 2 / 8)


def test_times_with_too_few_digits_are_equal_intervals_again(tmp_path: Path) -> None:
    t = np.arange(1000) / 3000
    measurement = read_measurement(axis(tmp_path, np.round(t, 4), motion(t), velocity(t)))
    assert named(measurement.findings) == ["rounded-time"]
    (record,) = measurement.records
    assert record.t == pytest.approx(t, abs=1e-6)
    assert record.q == pytest.approx(motion(t), abs=1e-12)


def test_gaps_split_the_record(tmp_path: Path) -> None:
    keep = ((T < 0.3) | (T > 0.45)) & ((T < 0.9) | (T > 0.96))
    measurement = read_measurement(axis(tmp_path, T[keep], motion(T[keep]), velocity(T[keep])))
    assert named(measurement.findings) == ["gaps", "short-pieces"]
    assert "2 gaps, the longest of 0.152 s after t = 0.299 s" in measurement.findings[0].what
    assert [record.name for record in measurement.records] == ["axis, segment 1", "axis, segment 2"]
    assert [(record.t[0], record.t[-1]) for record in measurement.records] == [(0.0, 0.299), (0.451, 0.899)]
    assert [len(part) for part in measurement.window(0.2, 0.6)] == [100, 150]


def test_a_doubled_time_in_a_regular_clock_is_replaced_and_named_with_its_line(tmp_path: Path) -> None:
    t = T.copy()
    t[500] = t[499]
    measurement = read_measurement(axis(tmp_path, t, motion(T), velocity(T)))
    assert named(measurement.findings) == ["wrong-times"]
    assert "1 times do not fit the regular clock of the others, the first in line 502" in measurement.findings[0].what
    assert measurement.records[0].t == pytest.approx(T, abs=1e-9)


def test_a_doubled_time_without_a_regular_clock_is_an_error_with_its_line(tmp_path: Path) -> None:
    t = np.cumsum(np.random.default_rng(2).uniform(0.5e-3, 1.5e-3, len(T)))
    t[500] = t[499]
    with pytest.raises(RecordError, match=r"has the time [\d.]+ s twice, the second time in line 502 \(once in"):
        read_measurement(axis(tmp_path, t, motion(T), velocity(T)))


def test_joined_logs_are_segments(tmp_path: Path) -> None:
    t = np.where(T >= 0.5, T - 0.2, T)
    measurement = read_measurement(axis(tmp_path, t, motion(t), velocity(t)))
    assert named(measurement.findings) == ["joined-logs", "gaps"]
    assert "goes back from 0.499 s to 0.3 s in line 502 (once in the file)" in measurement.findings[0].what
    first, second = measurement.records
    assert first.q == pytest.approx(motion(t[:500]), abs=1e-12)
    assert second.q == pytest.approx(motion(t[500:]), abs=1e-12)
    assert second.t[0] - first.t[-1] == pytest.approx(0.01)


def test_times_that_go_back_without_order_are_an_error_with_its_line(tmp_path: Path) -> None:
    t = np.random.default_rng(3).permutation(np.cumsum(np.random.default_rng(2).uniform(0.1e-3, 2e-3, len(T))))
    with pytest.raises(RecordError, match=r"decreases from [\d.]+ s to [\d.]+ s in line \d+ \(\d+ times in the file\)"):
        read_measurement(axis(tmp_path, t, motion(t), velocity(t)))


def test_rows_in_another_order_are_sorted(tmp_path: Path) -> None:
    t = T.copy()
    t[[100, 101, 500, 502]] = t[[101, 100, 502, 500]]
    measurement = read_measurement(axis(tmp_path, t, motion(t), velocity(t)))
    assert named(measurement.findings) == ["unsorted-rows"]
    assert measurement.records[0].q == pytest.approx(motion(T), abs=1e-12)


def test_repeated_rows_are_left_out(tmp_path: Path) -> None:
    t = np.insert(T, [100, 500], T[[99, 499]])
    measurement = read_measurement(axis(tmp_path, t, motion(t), velocity(t)))
    assert named(measurement.findings) == ["repeated-rows"]
    assert measurement.records[0].t == pytest.approx(T, abs=1e-12)


def test_times_of_fewer_digits_than_the_rate_are_a_regular_clock(tmp_path: Path) -> None:
    t = np.arange(4000) / 4000  # in whole milliseconds
    measurement = read_measurement(axis(tmp_path, np.floor(1e3 * t) / 1e3, motion(t), velocity(t)))
    assert named(measurement.findings) == ["rounded-time"]
    assert np.diff(measurement.records[0].t) == pytest.approx(0.25e-3, rel=1e-3)


def test_stamps_that_jitter_around_a_regular_clock_are_replaced(tmp_path: Path) -> None:
    """The motion decides: here the samples were taken on the clock, in the test above at the stamps."""
    stamps = T + np.random.default_rng(1).uniform(-2e-4, 2e-4, len(T))
    measurement = read_measurement(axis(tmp_path, stamps, motion(T), velocity(T)))
    assert named(measurement.findings) == ["jittered-times"]
    assert measurement.records[0].q == pytest.approx(motion(T), abs=1e-12)
    assert np.ptp(np.diff(measurement.records[0].t)) < 1e-12


def test_a_change_of_rate_is_no_gap(tmp_path: Path) -> None:
    t = np.concatenate([np.arange(100) * 0.01, 1.0 + np.arange(500) * 0.001])
    measurement = read_measurement(axis(tmp_path, t, motion(t), velocity(t)))
    assert named(measurement.findings) == ["rate-change"]
    assert "from 0.01 s to 0.001 s" in measurement.findings[0].what
    slow, fast = measurement.records
    assert (len(slow), len(fast)) == (100, 500)
    assert (slow.Ts, fast.Ts) == (pytest.approx(0.01), pytest.approx(0.001))


def test_rows_that_are_lost_at_random_do_not_change_the_rate(tmp_path: Path) -> None:
    kept = np.sort(np.random.default_rng(7).choice(20_000, 14_000, replace=False))
    t = kept * 1e-3
    measurement = read_measurement(axis(tmp_path, t, motion(t), velocity(t)))
    # five lost rows leave a gap, so that pieces shorter than 50 samples between two of them are no use either
    assert named(measurement.findings) == ["gaps", "short-pieces", "irregular-sampling"]
    assert sum(map(len, measurement.records)) > 19_000
    for record in measurement.records:
        assert record.q == pytest.approx(motion(record.t), abs=1e-6)


def test_the_first_of_several_changes_of_the_rate_is_stated(tmp_path: Path) -> None:
    t = np.cumsum(np.repeat([1e-3, 2e-3, 1e-3], [300, 300, 900]))
    (change,) = read_measurement(axis(tmp_path, t, motion(t), velocity(t))).findings
    assert "changes 2 times, first from 0.001 s to 0.002 s" in change.what


def test_a_position_that_is_updated_less_often_is_reduced_to_its_updates(tmp_path: Path) -> None:
    held = motion(T)[np.arange(len(T)) // 4 * 4]
    measurement = read_measurement(axis(tmp_path, T, held, velocity(T)))
    assert named(measurement.findings) == ["held-position"]
    (record,) = measurement.records
    assert record.Ts == pytest.approx(4e-3)
    assert record.q == pytest.approx(motion(record.t), abs=1e-12)
    assert record.force == pytest.approx(velocity(record.t), abs=1e-9)


def forbidding(path: Path) -> list[str]:
    found = contradictions(read_measurement(path).records)
    return [finding.name for finding in found if finding.name in FORBIDDING and finding.name.startswith("position")]


def test_positions_that_no_axis_has_forbid_their_use(tmp_path: Path) -> None:
    force = velocity(T)
    assert forbidding(axis(tmp_path, T, motion(T), force)) == []
    assert forbidding(axis(tmp_path, T, np.where(T > 0.52, motion(T) + 0.005, motion(T)), force)) == ["position-jumps"]
    assert forbidding(axis(tmp_path, T, np.minimum(motion(T), 0.006), force)) == ["position-clipped"]
    assert forbidding(axis(tmp_path, T, np.clip(motion(T), -0.006, 0.006), force)) == ["position-clipped"]
    updates = np.sort(np.random.default_rng(1).choice(len(T), 250, replace=False))
    held = motion(T)[updates[np.maximum(np.searchsorted(updates, np.arange(len(T)), "right") - 1, 0)]]
    assert forbidding(axis(tmp_path, T, held, force)) == ["position-held"]


@pytest.mark.parametrize("axes", [2, 3, 7])
def test_axes_that_take_turns_in_the_rows_are_named(tmp_path: Path, axes: int) -> None:
    """As a bus logs its motors, with a column of their numbers: no row follows from the one before it."""
    turn = np.arange(len(T)) % axes
    q, v = (1.0 + 0.2 * turn) * motion(T) + 0.05 * turn, (1.0 + 0.2 * turn) * velocity(T)
    path = axis(tmp_path, T, q, 2.0 * np.sign(v) + 0.1 * v, v)
    assert "position-jumps" in forbidding(path)
    (found,) = position_findings(read_measurement(path).records)
    assert found.what.endswith(f"the rows are of {axes} axes in turn.")


@pytest.mark.parametrize("lowest", [-0.25, -9.0])
def test_a_force_that_is_clipped_forbids_its_use_but_not_one_that_is_limited(tmp_path: Path, lowest: float) -> None:
    """20 g with 0.2 N of friction: a sensor that ends at 0.25 N, and a drive that does, which moves the mass less."""
    noise = 1e-3 * np.random.default_rng(1).normal(size=4000)
    t = np.arange(4000) * 1e-3
    a = -0.01 * (2 * np.pi * HZ) ** 2 * np.sin(2 * np.pi * HZ * t) * (1.0 + 0.5 * np.sin(2 * np.pi * 0.7 * t))
    for limited in (False, True):
        v = np.cumsum(a) * 1e-3
        needed = 0.02 * a + 0.2 * np.sign(v)
        force = np.clip(needed, lowest, 0.25)
        if limited:  # what the force lacks, the acceleration lacks as well
            acceleration = a + (force - needed) / 0.02
            v = np.cumsum(acceleration) * 1e-3
        q = np.cumsum(v) * 1e-3
        force = np.clip(force + np.where(np.abs(force) < 0.25, noise, 0.0), lowest, 0.25)
        measurement = read_measurement(axis(tmp_path, t, q, force))
        found = [finding.name for finding in contradictions(measurement.records)]
        assert ("force-clipped" in found) == (not limited), found


def test_a_largest_force_in_the_last_sample_is_no_limit(tmp_path: Path) -> None:
    t = T[:200]
    force = velocity(t)
    force[-1] = 2.0 * force.max()
    assert forbidding(axis(tmp_path, t, motion(t), force)) == []


def test_dwells_and_counts_of_an_encoder_are_no_faults(tmp_path: Path) -> None:
    """A slow stroke with stops in counts of 10 um, whose ends are reached with a constant deceleration."""
    stroke = np.repeat([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0, 0.0], [100, 200, 100, 100, 100, 200, 100, 100])
    q = 0.1 * np.cumsum(np.cumsum(np.tile(stroke, 2))) * 1e-6
    t = np.arange(len(q)) * 1e-3
    assert forbidding(axis(tmp_path, t, 1e-5 * np.round(q / 1e-5), np.gradient(q, t))) == []


def test_a_record_of_a_few_samples_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="has 20 samples; an identification needs at least 50"):
        read_measurement(axis(tmp_path, T[:20], motion(T[:20]), velocity(T[:20])))


def test_a_record_that_is_all_gaps_is_refused(tmp_path: Path) -> None:
    t = T + np.floor(T / 0.02)
    with pytest.raises(RecordError, match="has no 50 samples without a gap"):
        read_measurement(axis(tmp_path, t, motion(T), velocity(T)))


def test_a_column_of_nothing_is_an_error_that_names_it(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match=r"most are missing for 'force' \(1000 of 1000\)"):
        read_measurement(axis(tmp_path, T, motion(T), np.full(1000, np.nan)))


def test_position_and_velocity_in_units_that_disagree_are_named(tmp_path: Path) -> None:
    findings = read_measurement(axis(tmp_path, T, 1e3 * motion(T), velocity(T), velocity(T))).findings
    assert named(findings) == ["position-and-velocity-disagree"]
    assert "changes by 1e+03 times" in findings[0].what
    assert read_measurement(axis(tmp_path, T, motion(T), velocity(T), velocity(T) + 0.1)).findings == ()


def test_position_and_reference_in_units_that_disagree_are_named(tmp_path: Path) -> None:
    findings = read_measurement(axis(tmp_path, T, motion(T), velocity(T), r=1e3 * motion(T))).findings
    assert named(findings) == ["position-and-reference-disagree"]


def test_motion_that_no_machine_makes_is_named(tmp_path: Path) -> None:
    findings = read_measurement(axis(tmp_path, T, 1e6 * motion(T), velocity(T))).findings
    assert named(findings) == ["implausible-motion"]


def test_forces_of_the_other_sign_are_named(tmp_path: Path) -> None:
    findings = read_measurement(axis(tmp_path, T, motion(T), 3.0 - velocity(T))).findings
    assert named(findings) == ["force-of-other-sign"]
    assert findings[0].measure == "Set sign = -1 for this column."


def test_a_jump_of_the_position_is_named_although_the_intervals_differ(tmp_path: Path) -> None:
    """Resampled by a spline, the jump has others beside it."""
    t = T + np.random.default_rng(1).uniform(-2e-4, 2e-4, len(T))
    jump = np.where(t < 0.4007, 0.0, 0.3)
    findings = read_measurement(axis(tmp_path, t, motion(t) + jump, velocity(t))).findings
    assert named(findings) == ["irregular-sampling", "position-jumps"]
    assert f"once, first at t = {t[t < 0.4007][-1]:.6g} s" in findings[1].what


def test_an_angle_that_begins_anew_after_each_turn_is_made_continuous_and_named(tmp_path: Path) -> None:
    turns = 500.0 * motion(T)  # 5 rad to either side
    path = axis(tmp_path, T, np.mod(turns + np.pi, 2 * np.pi) - np.pi, velocity(T))
    path.write_text(path.read_text().replace("x [m]", "x [rad]").replace("force [N]", "force [N.m]"))
    measurement = read_measurement(path)
    assert named(measurement.findings) == ["wrapped"]
    assert measurement.records[0].q == pytest.approx(turns, abs=1e-9)
    path = axis(tmp_path, T, turns, velocity(T))
    path.write_text(path.read_text().replace("x [m]", "x [rad]").replace("force [N]", "force [N.m]"))
    assert read_measurement(path).findings == ()
