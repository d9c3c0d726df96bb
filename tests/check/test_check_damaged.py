"""Encodings other than UTF-8, and libraries of which bytes are missing or wrong."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import fmpy
import pytest
from check.broken import XML, contents, zipped
from check.libraries import BINARY, HERE, Library
from thorough import nightly

from friction_fmus.check import Finding, check

ENCODINGS = {
    "utf-16": "UTF-16",
    "utf-16-le": "UTF-16",
    "utf-16-be": "UTF-16",
    "utf-32": "UTF-32",
    "iso-8859-1": "ISO-8859-1",
    "cp1252": "windows-1252",
}


@pytest.fixture(scope="session")
def members(build_fmu: Callable[..., Path]) -> dict[str, bytes]:
    return contents(build_fmu("LuGre"))


@pytest.fixture
def with_library(library: Library, tmp_path: Path) -> Callable[[bytes], Path]:
    def make(data: bytes) -> Path:
        xml = (HERE / "faulty.xml").read_bytes()
        return zipped({XML: xml, BINARY: data, "documentation/index.html": b"<html/>"}, tmp_path / "a.fmu")

    return make


def rules(found: list[Finding]) -> set[str]:
    return {finding.rule for finding in found}


@pytest.mark.parametrize("declared", [True, False])
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_another_encoding_is_a_finding(
    members: dict[str, bytes], tmp_path: Path, encoding: str, declared: bool
) -> None:
    text = members[XML].decode().replace('author="', 'author="\u00fc ')
    if declared:
        text = text.replace("UTF-8", ENCODINGS[encoding])
    path = zipped(members | {XML: text.encode(encoding)}, tmp_path / "a.fmu")
    assert rules(check(path, static=True)) in ({"xml-encoding"}, {"xml-malformed"})
    assert declared <= (rules(check(path, static=True)) == {"xml-encoding"})


def test_utf_8_is_no_finding(members: dict[str, bytes], tmp_path: Path) -> None:
    text = members[XML].decode().replace('author="', 'author="\u00fc ')
    for data in (text.encode(), text.encode("utf-8-sig"), text.replace("UTF-8", "utf-8").encode()):
        assert check(zipped(members | {XML: data}, tmp_path / "a.fmu"), static=True) == []


@pytest.mark.parametrize("share", [0.2, 0.4, 0.6, 0.8])
def test_a_truncated_library_is_a_finding(members: dict[str, bytes], tmp_path: Path, share: float) -> None:
    """Loading most of them ends the process with SIGBUS."""
    name = f"binaries/{fmpy.platform}/LuGre{fmpy.sharedLibraryExtension}"
    whole = members[name]
    path = zipped(members | {name: whole[: int(share * len(whole))]}, tmp_path / "a.fmu")
    for static in (True, False):
        (finding,) = check(path, static=static)
        assert (finding.rule, finding.file) == ("binary-truncated", name)
        assert "bytes are missing at the end" in finding.message


@pytest.mark.parametrize("length", [0, 1, 16, 64, 100])
def test_a_library_without_its_tables_is_a_finding(
    library: Library, with_library: Callable[[bytes], Path], length: int
) -> None:
    (finding,) = check(with_library(library()[:length]))
    assert finding.rule in ("binary-truncated", "binary-not-loadable")


def test_a_library_of_another_platform_may_be_truncated_too(members: dict[str, bytes], tmp_path: Path) -> None:
    other = "binaries/win64/LuGre.dll"
    header = bytearray(
        b"MZ".ljust(0x3C, b"\0") + (64).to_bytes(4, "little") + b"PE\0\0\x64\x86".ljust(24, b"\0") + bytes(40)
    )
    header[64 + 6] = 1  # one section ...
    header[64 + 24 + 16 : 64 + 24 + 24] = (512).to_bytes(4, "little") + (1024).to_bytes(4, "little")  # ... at 1024
    (finding,) = check(zipped(members | {other: bytes(header)}, tmp_path / "a.fmu"), static=True)
    assert (finding.rule, finding.file) == ("binary-truncated", other)
    assert f"{1024 + 512 - len(header)} bytes are missing" in finding.message


@nightly
def test_any_bytes_of_the_library_may_be_wrong(library: Library, with_library: Callable[[bytes], Path]) -> None:
    """Whatever the loader does with them, the check ends with findings."""
    draw = random.Random(13)
    for _ in range(12):
        data = bytearray(library())
        for _ in range(draw.randrange(1, 40)):
            data[draw.randrange(min(len(data), 8000))] = draw.randrange(256)
        assert all(isinstance(finding, Finding) for finding in check(with_library(bytes(data)), time_limit=5.0))
