"""Checkpoints that are damaged or forged: refused in one sentence, before anything is changed."""

from __future__ import annotations

import hashlib
import json
import os
import random
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness_parts import mass
from thorough import THOROUGH, nightly

from harness import Bias, CallablePart, Delay, ExperimentError, HarnessError, Result, SeriesPart, System
from harness.system.wire import Wire

SETTINGS: dict[str, Any] = {"step": 0.01, "manipulators": (Bias("mass.F", 0.1, start=0.2), Delay("mass.F", 2))}


def made() -> System:
    """Parts of two kinds, a delay and manipulators: everything that a checkpoint holds."""
    series = SeriesPart("series", [0.0, 0.4, 9.0], {"F": [0.0, 1.0, 2.0]}, {"F": "N"})
    sine = CallablePart("sine", lambda t, u, x: np.sin(9.0 * t) + 0.0 * u[0], ["a"], ["b"], sampled=True)
    return System([series, mass(v0=1.0), sine], [Wire("series.F", "mass.F", 1.0, 0.0, 3), "mass.x -> sine.a"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("checkpoints")


@pytest.fixture(scope="module")
def good(folder: Path) -> Path:
    made().run(stop=0.5, checkpoint=folder / "good", **SETTINGS)
    return folder / "good"


@pytest.fixture(scope="module")
def rest(good: Path) -> Result:
    return made().run(stop=1.0, resume=good, **SETTINGS)


def resumed(path: Path) -> Result:
    return made().run(stop=1.0, resume=path, **SETTINGS)


def refused(path: Path) -> str:
    with pytest.raises(ExperimentError) as caught:
        resumed(path)
    message = str(caught.value)
    assert "\n" not in message and len(message) < 1000
    return message


def forged(good: Path, change: Callable[[dict[str, bytes]], object], *, rehash: bool = True) -> Path:
    """A copy with other members and, if wanted, a hash that is right for them."""
    with zipfile.ZipFile(good) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    old = members.pop("sha256", b"")
    change(members)
    digest = hashlib.sha256()
    for name, content in members.items():
        digest.update(f"{len(name)} {len(content)} {name}".encode() + content)
    with zipfile.ZipFile(good.with_name("forged"), "w") as archive:
        for name, content in (*members.items(), ("sha256", digest.hexdigest().encode() if rehash else old)):
            archive.writestr(name, content)
    return good.with_name("forged")


def with_header(**changes: object) -> Callable[[dict[str, bytes]], object]:
    def change(members: dict[str, bytes]) -> None:
        header = json.loads(members["checkpoint.json"])
        members["checkpoint.json"] = json.dumps(header | changes).encode()

    return change


def test_the_forger_forges_well(good: Path, rest: Result) -> None:
    assert resumed(forged(good, lambda members: None)).identical(rest)


@pytest.mark.parametrize("tick", [-1, 0.5, 50.0, True, None, "50", [], {}, 2**63, 1e300, float("nan"), float("inf")])
def test_a_number_of_steps_that_is_none(good: Path, tick: object) -> None:
    message = refused(forged(good, with_header(tick=tick)))
    assert "the invalid step count" in message or "give a later stop" in message


@pytest.mark.parametrize("value", [None, 1, "x", [], [1], {"a": 1}, {"a": None}, {"a": "x"}, {"a": [1, 2, 3]}, 1e400])
@pytest.mark.parametrize("key", ["format", "system", "signals", "memory", "tick"])
def test_a_header_of_another_form(good: Path, key: str, value: object) -> None:
    if (key, value) in (("signals", {"a": "x"}), ("tick", 1)):
        value = "0x1p99999"
    refused(forged(good, with_header(**{key: value})))


def test_no_header_and_none_that_can_be_read(good: Path) -> None:
    for text in (b"", b"null", b"[" * 100_000, b"\xff", b"{", b'{"format": 2}'):
        refused(forged(good, lambda members, text=text: members.update({"checkpoint.json": text})))
    refused(forged(good, lambda members: members.pop("checkpoint.json")))


def test_states_of_another_size(good: Path) -> None:
    with zipfile.ZipFile(good) as archive:
        names = [name for name in archive.namelist() if name.startswith(("parts/", "memory/"))]
    assert len(names) > 5
    for name in names:
        refused(forged(good, lambda members, name=name: members.pop(name)))
        for content in (b"\0" * 7, b"\0" * 80_000):
            path = forged(good, lambda members, name=name, content=content: members.update({name: content}))
            with pytest.raises(HarnessError) as caught:
                resumed(path)
            assert "\n" not in str(caught.value)


def test_memory_of_another_type_changes_no_part(good: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def change(members: dict[str, bytes]) -> None:
        header = json.loads(members["checkpoint.json"])
        name = next(iter(header["memory"]))
        header["memory"][name][0] = "<c16"
        members["checkpoint.json"] = json.dumps(header).encode()

    def never(part: object, data: bytes) -> None:
        raise AssertionError("a part was changed")

    monkeypatch.setattr(CallablePart, "deserialise", never)
    monkeypatch.setattr(SeriesPart, "deserialise", never)
    assert "than this run" in refused(forged(good, change))


def test_the_hash_covers_everything(good: Path) -> None:
    with zipfile.ZipFile(good) as archive:
        names = archive.namelist()
    for name in names:
        if name == "sha256":
            continue

        def change(members: dict[str, bytes], name: str = name) -> None:
            members[name] = members[name].replace(b"0", b"1", 1) if name.endswith("json") else members[name] + b"\0"

        assert "it is damaged" in refused(forged(good, change, rehash=False))


@nightly
def test_a_large_member_is_not_unpacked(good: Path) -> None:
    path = good.with_name("bomb")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("checkpoint.json", "w") as file:
        for _ in range(1100):
            file.write(bytes(1 << 20))
    assert "unpacks to more than" in refused(path)


def test_what_is_no_file(good: Path) -> None:
    assert "not a regular file" in refused(Path("/dev/zero"))
    assert "folder" in refused(good.parent)
    os.mkfifo(good.with_name("pipe"))
    assert "not a regular file" in refused(good.with_name("pipe"))
    assert "No such file" in refused(good.with_name("none"))
    assert "NUL" in refused(Path("a\0b")) or "null byte" in refused(Path("a\0b"))


def test_any_changed_bytes(good: Path, rest: Result) -> None:
    """Each is refused, or what was changed does not matter and the run goes on as it should."""
    content, draw = good.read_bytes(), random.Random(18)
    scraps = (b"", b"\0", b"\xff", b"PK", b"\x01\x02", b"{", b"-1", b"9" * 20)
    path = good.with_name("mutant")
    for number in range(2000 if THOROUGH else 500):
        data = content
        for _ in range(draw.randint(1, 3)):
            place, length = draw.randrange(len(data) + 1), draw.choice((0, 1, 1, 2, 8, 60))
            scrap = draw.choice((*scraps, draw.randbytes(draw.randint(1, 4))))
            data = data[:place] + scrap + data[place + length :]
        if number % 10 == 0:
            data = data[: draw.randrange(len(data))]
        path.write_bytes(data)
        try:
            result = resumed(path)
        except HarnessError as error:
            assert "\n" not in str(error)
        else:
            assert result.identical(rest)
