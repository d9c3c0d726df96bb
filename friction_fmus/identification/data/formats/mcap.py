"""MCAP files, such as the bags of ROS 2: the numbers in the messages of all topics (extra ``mcap``)."""

import json
import math
import numbers
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.tables import EXACT, ChannelGroup, DataTable, limit_size, on_one_clock
from harness.extras import require

SUFFIXES: Final = (".mcap",)

JOINT: Final = ("position", "velocity", "effort")  # arrays of ``sensor_msgs/JointState`` with one element for each name

DEEPEST: Final = 8  # largest depth of nested fields

VALUE: Final = 100  # memory of a number while a file is read [bytes]

LONGEST: Final = 64  # largest number of elements of an array whose elements become columns


def read(path: Path) -> DataTable:
    """Read an MCAP file."""
    # Each number in a message becomes a column named after topic, joint and field, such as
    # ``/joint_states/axis1/position``. The time is that of the header of the message if it has one, otherwise the time
    # of the log, in s since the first message of the file.
    require("mcap", "reading MCAP files needs it")
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    factory = DecoderFactory()
    decoders: dict[int, Callable[[bytes], Any] | None] = {}
    rows: dict[str, list[tuple[int, dict[str, float]]]] = {}
    ignored: dict[str, str] = {}
    damaged: dict[str, str] = {}
    count = 0
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        for chunk in summary.chunk_indexes if summary is not None else ():
            limit_size(path, chunk.uncompressed_size)
        for schema, channel, message in reader.iter_messages():
            if channel.id not in decoders:
                coded_as_json = channel.message_encoding == "json"
                decoders[channel.id] = (
                    json.loads if coded_as_json else factory.decoder_for(channel.message_encoding, schema)
                )
            decode = decoders[channel.id]
            if decode is None:
                ignored[channel.topic] = channel.message_encoding
                continue
            try:
                content = decode(message.data)
                values = dict(_numbers(content, channel.topic, DEEPEST))
            except Exception as error:  # a damaged message may raise any exception in the decoders
                damaged[channel.topic] = f"a damaged message ({' '.join(str(error).split()) or type(error).__name__})"
                continue
            count += len(values)
            limit_size(path, VALUE * count)
            if values:
                rows.setdefault(channel.topic, []).append((_stamp(content) or message.log_time, values))
    texts = {name: why for topic, why in damaged.items() for _, values in rows.pop(topic, ()) for name in values}
    if not rows and damaged:
        topic, why = next(iter(damaged.items()))
        raise RecordError(f"{path} has {why} in the topic {topic}; record it again.")
    if not rows:
        encodings = f" (encodings: {', '.join(sorted(set(ignored.values())))})" if ignored else ""
        raise RecordError(f"{path} has no topic with numbers that can be decoded{encodings}; record ROS 2 or JSON.")
    begin = min(stamp for messages in rows.values() for stamp, _ in messages)
    table = on_one_clock(path, [_group(messages, begin) for messages in rows.values()], "time", "s")
    return replace(table, texts=texts)


def _group(messages: list[tuple[int, dict[str, float]]], begin: int) -> ChannelGroup:
    """Return the signals of a topic at increasing times; of messages with equal times the first one counts."""
    at = dict(reversed(messages))
    stamps = sorted(at)
    names = dict.fromkeys(name for _, values in messages for name in values)
    signals = {name: np.array([at[stamp].get(name, np.nan) for stamp in stamps]) for name in names}
    return ChannelGroup(np.array([(stamp - begin) * 1e-9 for stamp in stamps]), signals)


def _numbers(content: Any, name: str, depth: int) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message by name; texts, headers and long arrays are left out, large integers missing."""
    if isinstance(content, numbers.Real):
        yield name, math.nan if isinstance(content, int) and abs(content) > EXACT else float(content)
    elif (fields := _fields(content)) is not None and depth:
        joints = fields.get("name")
        named = isinstance(joints, (list, tuple)) and all(isinstance(joint, str) for joint in joints)
        for field, value in fields.items():
            if field == "header":
                continue
            if named and field in JOINT and joints and len(value) == len(joints):
                yield from ((f"{name}/{joint}/{field}", float(each)) for joint, each in zip(joints, value, strict=True))
            else:
                yield from _numbers(value, f"{name}/{field}", depth - 1)
    elif isinstance(content, (list, tuple, np.ndarray)) and len(content) <= LONGEST and depth:
        for index, each in enumerate(content):
            yield from _numbers(each, f"{name}[{index}]", depth - 1)


def _fields(content: Any) -> Mapping[str, Any] | None:
    """Return the fields of a message by name; None if it is not a message."""
    if isinstance(content, Mapping):
        return content
    slots = getattr(content, "__slots__", None)
    return {name: getattr(content, name) for name in slots} if slots else None


def _stamp(content: Any) -> int:
    """Return the time in the header of a message [ns]; 0 if it has none."""
    header = (_fields(content) or {}).get("header")
    stamp = (_fields(header) or {}).get("stamp") if header is not None else None
    parts = _fields(stamp) or {} if stamp is not None else {}
    seconds, rest = parts.get("sec", 0), parts.get("nanosec", 0)
    return int(seconds) * 1_000_000_000 + int(rest)
