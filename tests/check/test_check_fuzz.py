"""Bytes from strangers: `check` gives findings and `open_archive` an FmuError, and neither leaves a file."""

from __future__ import annotations

import re
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from check.broken import XML, contents, zipped
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from robustness.mutate import NAMES, WORDS
from thorough import few, nightly

from friction_fmus.check import Finding, check
from harness import FmuError, open_archive

SETTINGS = settings(
    max_examples=few(60), deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.fixture(scope="session")
def small(build_fmu: Callable[..., Path]) -> dict[str, bytes]:
    """An FMU whose binary is no binary, so that mutations are quick."""
    members = contents(build_fmu("LuGre"))
    return {name: data if name == XML else data[:50] for name, data in members.items()}


@pytest.fixture
def place(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """All temporary folders are made in here."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def survives(path: Path) -> None:
    assert all(isinstance(finding, Finding) for finding in check(path, static=True))
    try:
        open_archive(path)
    except FmuError as error:
        assert str(path) in str(error)
    assert list(path.parent.iterdir()) == [path]


@nightly
@SETTINGS
@given(data=st.data())
def test_any_change_of_the_bytes(small: dict[str, bytes], place: Path, data: st.DataObject) -> None:
    path = zipped(small, place / "a.fmu")
    content = bytearray(path.read_bytes())
    # the directory at the end is where a zip can lie most
    first = data.draw(st.sampled_from([0, content.index(b"PK\x01\x02")]))
    for _ in range(data.draw(st.integers(1, 8))):
        content[data.draw(st.integers(first, len(content) - 1))] = data.draw(st.integers(0, 255))
    end = data.draw(st.sampled_from([len(content), data.draw(st.integers(0, len(content)))]))
    path.write_bytes(content[:end])
    survives(path)


@SETTINGS
@given(data=st.data())
def test_any_value_of_any_attribute(small: dict[str, bytes], place: Path, data: st.DataObject) -> None:
    text = small[XML].decode()
    for _ in range(data.draw(st.integers(1, 4))):
        found = list(re.finditer(r'="([^"<]*)"', text))
        match = data.draw(st.sampled_from(found))
        text = text[: match.start(1)] + data.draw(st.sampled_from(WORDS)) + text[match.end(1) :]
    survives(zipped(small | {XML: text.encode()}, place / "a.fmu"))


@SETTINGS
@given(data=st.data())
def test_any_lines_missing_or_twice(small: dict[str, bytes], place: Path, data: st.DataObject) -> None:
    lines = small[XML].decode().splitlines()
    for _ in range(data.draw(st.integers(1, 6))):
        k = data.draw(st.integers(1, len(lines) - 1))
        lines[k : k + 1] = data.draw(st.sampled_from([[], [lines[k]] * 2, [lines[k].replace("Real", "Integer")]]))
    survives(zipped(small | {XML: "\n".join(lines).encode()}, place / "a.fmu"))


@SETTINGS
@given(name=st.text(st.characters(blacklist_categories=["Cs"]), min_size=1, max_size=40) | st.sampled_from(NAMES))
def test_any_name_of_a_member(small: dict[str, bytes], place: Path, name: str) -> None:
    path = zipped(small, place / "a.fmu")
    with zipfile.ZipFile(path, "a") as archive:
        if name not in archive.namelist():
            archive.writestr(name, b"x")
    survives(path)
