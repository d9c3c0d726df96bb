"""What the process of an isolated FMU sends: values and errors, and never an object that runs code where it arrives."""

from __future__ import annotations

import json
import os
import pickle
import socket
import struct
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from harness import FmuError, HarnessError, PartError, StartValueError
from harness.parts.isolated.channel import BYTES, CALL, DONE, FAILED, LOG, ChannelEnd, as_error, as_plain
from harness.parts.isolated.isolated_part import Process, ProcessError


@pytest.fixture
def ends() -> Iterator[tuple[ChannelEnd, socket.socket]]:
    ours, theirs = socket.socketpair()
    ours.settimeout(5.0)
    with ours, theirs:
        yield ChannelEnd(ours), theirs


class Evil:
    """Makes a folder where it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, ...]:
        return os.mkdir, (str(self.path),)


def message(kind: int, data: bytes) -> bytes:
    return struct.pack("<BI", kind, len(data)) + data


@pytest.mark.parametrize("kind", [DONE, FAILED, LOG, BYTES, CALL])
def test_nothing_is_unpickled(kind: int, ends: tuple[ChannelEnd, socket.socket], tmp_path: Path) -> None:
    line, theirs = ends
    theirs.sendall(message(kind, pickle.dumps(Evil(tmp_path / "made"))))
    if kind == BYTES:  # bytes stay bytes
        assert line.answered() == (DONE, pickle.dumps(Evil(tmp_path / "made")))
    else:
        with pytest.raises(ValueError, match=r"codec|Expecting|kind"):
            line.answered()
    assert not (tmp_path / "made").exists()


BAD = {
    "no JSON": message(DONE, b"\x80\x04"),
    "an unknown kind": message(99, b""),
    "no error": message(FAILED, b"[1, 2]"),
    "half an error": message(FAILED, b'{"part": ["a"]}'),
    "no log": message(LOG, b"7"),
    "a level that is none": message(LOG, b'["harness.p", "high", "text"]'),
    "deep nesting": message(DONE, b"[" * 100_000),
    "an error without content": message(FAILED, b""),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_answer_ends_the_process(name: str, ends: tuple[ChannelEnd, socket.socket]) -> None:
    line, theirs = ends
    theirs.sendall(BAD[name])
    killed: list[bool] = []
    process = SimpleNamespace(
        _line=line, _kill=lambda: killed.append(True), _said=lambda: "", _log=lambda *text: int(text[1])
    )
    with pytest.raises(ProcessError, match="its process sent an invalid answer and was killed"):
        Process._answer(process, 1.0)  # type: ignore[arg-type]
    assert killed == [True]


@pytest.mark.parametrize(
    "error",
    [
        PartError("p", "fmi2DoStep", "it returned Error", 0.5),
        PartError("p", "fmi2Instantiate", "für", None),
        StartValueError("p refused it"),
        FmuError("cannot load"),
        HarnessError("else"),
    ],
)
def test_errors_arrive_as_they_were(error: HarnessError) -> None:
    back = as_error(json.loads(json.dumps(as_plain(error))))
    assert type(back) is type(error)
    assert back.args == error.args
    assert str(back) == str(error)


def test_an_error_of_another_kind_keeps_its_text() -> None:
    assert str(as_error({"error": "os.system", "text": "what it was"})) == "what it was"
