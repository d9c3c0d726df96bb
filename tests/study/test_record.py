"""The record of an axis: what is loaded, and what is refused."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from friction_fmus.data import load_emps
from friction_fmus.errors import FrictionError
from friction_fmus.identification import Record, RecordError
from friction_fmus.study import load_config


def record(**changes: object) -> Record:
    t = np.linspace(0.0, 1.0, 11)
    columns: dict[str, object] = {"t": t, "q": np.sin(t), "reference": t, "force": np.cos(t)}
    return Record("bench", **{**columns, **changes})  # type: ignore[arg-type]


GAIN = 35.15065188248547  # of the drive of EMPS [N/V]


def test_emps_is_what_its_authors_describe() -> None:
    axis, servo = load_emps(), load_config("emps").servo
    assert len(axis) == 24841
    assert axis.Ts == pytest.approx(1e-3, rel=1e-6)
    assert servo is not None
    assert servo.gains == pytest.approx({"kp": 160.18, "kv": 243.45 * GAIN, "ki": 0.0})
    assert "Janot" in axis.citation


def test_emps_obeys_its_controller() -> None:
    """The recorded force is that of the documented control law, to 3.7 mV rms."""
    axis, servo = load_emps(), load_config("emps").servo
    assert servo is not None
    q, n = axis.column("q"), servo.window
    v = (q[n:] - q[:-n]) / (n * servo.Ts)
    law = servo.gains["kv"] * (servo.gains["kp"] * (axis.column("reference") - q)[n:] - v)
    residual = (np.clip(law, -servo.force_limit, servo.force_limit) - axis.column("force")[n:]) / GAIN
    assert np.sqrt(np.mean(residual**2)) < 4e-3


def test_a_record_is_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        record().q[0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        record().name = "other"  # type: ignore[misc]


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"q": np.zeros(10)}, "different lengths .*q 10"),
        ({"t": np.r_[np.linspace(0, 0.9, 10), 0.85]}, "does not increase at index 10"),
        ({"t": np.linspace(0, 1, 11) ** 2}, "not equally spaced"),
        ({"force": np.r_[np.zeros(10), np.nan]}, "'force' .* 1 NaN or infinite .* index 10"),
        ({"q": np.r_[np.inf, np.zeros(10)]}, "'q' .* index 0"),
        ({"reference": ["a"] * 11}, "not numeric"),
        ({name: np.arange(2.0) for name in ("t", "q", "reference", "force")}, "at least 3"),
    ],
)
def test_unusable_records_are_refused(changes: dict[str, object], complaint: str) -> None:
    with pytest.raises(RecordError, match=complaint) as caught:
        record(**changes)
    assert "bench" in str(caught.value)
    assert isinstance(caught.value, FrictionError)
