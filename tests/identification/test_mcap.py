"""Bags of ROS 2 and other MCAP files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer
from mcap_ros2.writer import Writer as RosWriter

from friction_fmus.identification import ROTARY, RecordError, read_measurement

T = np.arange(200) * 2e-3
Q = 0.3 * np.sin(2 * np.pi * 5 * T)  # rad
TAU = 3.0 * np.cos(2 * np.pi * 5 * T)  # N.m
BEGIN = 1_700_000_000_000_000_000  # ns

JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""

COLUMNS = {
    "time": {"column": "time"},
    "position": {"column": "/joint_states/j1/position", "unit": "rad"},
    "force": {"column": "/joint_states/j1/effort", "unit": "N.m"},
}


def bag(folder: Path, lag: int = 0) -> Path:
    """Two joints, logged `lag` ns after the time of their header, and a set-point at times of its own."""
    path = folder / "arm.mcap"
    with path.open("wb") as file:
        writer = RosWriter(file)
        joints = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        number = writer.register_msgdef("std_msgs/msg/Float64", "float64 data")
        for i, (q, tau) in enumerate(zip(Q, TAU, strict=True)):
            at = BEGIN + 2_000_000 * i
            stamp = {"sec": at // 1_000_000_000, "nanosec": at % 1_000_000_000}
            state: dict[str, Any] = {
                "header": {"stamp": stamp, "frame_id": "base"},
                "name": ["j1", "j2"],
                "position": [q, -q],
                "velocity": [],
                "effort": [tau, 0.5],
            }
            writer.write_message("/joint_states", joints, state, log_time=at + lag, publish_time=at + lag)
            if i % 2:
                writer.write_message("/setpoint", number, {"data": 2.0 * at * 1e-9}, log_time=at, publish_time=at)
        writer.finish()
    return path


@pytest.mark.parametrize("lag", [0, 700_000])
def test_a_bag_of_ros_with_the_time_of_the_headers(tmp_path: Path, lag: int) -> None:
    (record,) = read_measurement(bag(tmp_path, lag), {"columns": COLUMNS}).records
    assert record.units == ROTARY
    assert record.t == pytest.approx(T, abs=1e-9)
    assert record.q == pytest.approx(Q)
    assert record.force == pytest.approx(TAU)


def test_a_topic_at_other_times_is_interpolated_and_named(tmp_path: Path) -> None:
    columns = {**COLUMNS, "reference": {"column": "/setpoint/data", "unit": "rad"}}
    measurement = read_measurement(bag(tmp_path), {"columns": columns})
    (record,) = measurement.records
    assert np.diff(record.reference) == pytest.approx(2.0 * record.Ts, abs=1e-6)
    (note,) = [finding for finding in measurement.findings if finding.name == "other-clock"]
    assert "'/setpoint/data'" in note.what


def test_the_columns_are_named_if_none_is_chosen(tmp_path: Path) -> None:
    with pytest.raises(RecordError) as caught:
        read_measurement(bag(tmp_path))
    assert "'/joint_states/j1/position' has no unit" in str(caught.value)
    assert "/joint_states/j2/effort" in str(caught.value)


def test_messages_in_json(tmp_path: Path) -> None:
    path = tmp_path / "axis.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("state", "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel("axis", "json", schema)
        for i, (q, tau) in enumerate(zip(Q, TAU, strict=True)):
            state = {"act": {"x": q, "ok": "yes"}, "F": [tau, 0.0]}
            at = BEGIN + 2_000_000 * i
            writer.add_message(channel, at, json.dumps(state).encode(), at)
        writer.finish()
    columns = {
        "time": "time",
        "position": {"column": "axis/act/x", "unit": "m"},
        "force": {"column": "axis/F[0]", "unit": "N"},
    }
    (record,) = read_measurement(path, {"columns": columns}).records
    assert record.t == pytest.approx(T, abs=1e-9)
    assert record.q == pytest.approx(Q)
    assert record.force == pytest.approx(TAU)


def test_a_file_without_numbers_and_a_damaged_one_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "axis.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("state", "protobuf", b"")
        channel = writer.register_channel("axis", "protobuf", schema)
        writer.add_message(channel, BEGIN, b"\x00", BEGIN)
        writer.finish()
    with pytest.raises(RecordError, match=r"no topic with numbers that can be decoded \(encodings: protobuf\)"):
        read_measurement(path, {"columns": COLUMNS})
    path.write_bytes(bag(tmp_path).read_bytes()[:500])
    with pytest.raises(RecordError, match=r"axis.mcap cannot be read as a .mcap file"):
        read_measurement(path, {"columns": COLUMNS})


def test_a_damaged_message_and_large_integers_matter_in_a_topic_that_is_used_only(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("log", "jsonschema", b"{}")
        axis, other = (writer.register_channel(name, "json", schema) for name in ("/axis", "/other"))
        for i, (q, tau) in enumerate(zip(Q, TAU, strict=True)):
            at = BEGIN + 2_000_000 * i
            good = json.dumps({"q": q, "tau": tau, "id": 2**60 + i}).encode()
            writer.add_message(axis, at, good, at)
            writer.add_message(other, at, b'{"u": 1.0' if i == 50 else b'{"u": 1.0}', at)
        writer.finish()
    used = {"time": {"column": "time"}, "force": {"column": "/axis/tau", "unit": "N.m"}}
    position = {"column": "/axis/q", "unit": "rad"}
    (record,) = read_measurement(path, {"columns": {**used, "position": position}}).records
    assert len(record) == len(Q)
    with pytest.raises(RecordError, match="not numeric: it contains a damaged message"):
        read_measurement(path, {"columns": {**used, "position": {"column": "/other/u", "unit": "rad"}}})
    with pytest.raises(RecordError, match="rows without missing values"):
        read_measurement(path, {"columns": {**used, "position": {"column": "/axis/id", "unit": "rad"}}})
