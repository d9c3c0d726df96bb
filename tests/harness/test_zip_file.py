"""Archives from elsewhere: what cannot be unpacked without harm is refused in one sentence, as an FMU and as an SSP."""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from check.hostile_zips import REFUSED, ZEROS, Spoil, packed, wrong_checksum
from ssp_files import component, ssd, system
from thorough import nightly, some

from harness import FmuError, FmuPart, System, SystemFileError
from harness.storage.zip_file import find_clashes

CONSTANTS = {"p.u": 3.0, "p.n": 4, "p.b": True}
Members = dict[str, bytes]


@pytest.fixture
def fmu(probe: Path) -> Members:
    with zipfile.ZipFile(probe) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.fixture
def ssp(probe: Path) -> Members:
    return {
        "SystemStructure.ssd": ssd(system(component("p"))).encode(),
        "resources/probe.fmu": probe.read_bytes(),
    }


def sentence(error: BaseException, path: Path) -> str:
    text = str(error)
    assert str(path) in text
    assert "\n" not in text
    assert len(text) < 400
    return text


@pytest.mark.parametrize("spoil", some([*REFUSED], [*REFUSED][::2]), ids=lambda spoil: spoil.__name__)
def test_an_fmu_is_refused(fmu: Members, tmp_path: Path, spoil: Spoil) -> None:
    path = packed(tmp_path / "a.fmu", fmu)
    FmuPart("p", path)
    spoil(path)
    with pytest.raises(FmuError) as caught:
        FmuPart("p", path)
    assert REFUSED[spoil][1] in sentence(caught.value, path)


@pytest.mark.parametrize("spoil", some([*REFUSED], [*REFUSED][::6]), ids=lambda spoil: spoil.__name__)
def test_an_ssp_is_refused(ssp: Members, tmp_path: Path, spoil: Spoil) -> None:
    path = packed(tmp_path / "a.ssp", ssp)
    System.from_ssp(path).close()
    spoil(path)
    with pytest.raises(SystemFileError) as caught:
        System.from_ssp(path)
    assert REFUSED[spoil][1] in sentence(caught.value, path)


@nightly
@pytest.mark.parametrize("spoil", some([*REFUSED], [*REFUSED][::4]), ids=lambda spoil: spoil.__name__)
def test_an_fmu_in_an_ssp_is_refused(fmu: Members, ssp: Members, tmp_path: Path, spoil: Spoil) -> None:
    inner = packed(tmp_path / "a.fmu", fmu)
    spoil(inner)
    path = packed(tmp_path / "a.ssp", ssp | {"resources/probe.fmu": inner.read_bytes()})
    with pytest.raises((FmuError, SystemFileError)) as caught:
        System.from_ssp(path)
    assert "\n" not in str(caught.value)


def test_a_wrong_checksum_ends_the_run_before_anything_is_loaded(fmu: Members, tmp_path: Path) -> None:
    path = packed(tmp_path / "a.fmu", fmu)
    wrong_checksum(path)
    with System([FmuPart("p", path)], start=CONSTANTS) as system, pytest.raises(FmuError) as caught:
        system.run(stop=1.0, step=0.5)
    assert "resources/extra.bin' is damaged" in sentence(caught.value, path)


def test_a_wrong_checksum_of_what_is_read(fmu: Members, ssp: Members, tmp_path: Path) -> None:
    path = packed(tmp_path / "a.fmu", fmu)
    path.write_bytes(path.read_bytes().replace(b'fmiVersion="2.0"', b'fmiVersion="2.1"'))
    with pytest.raises(FmuError) as caught:
        FmuPart("p", path)
    assert "modelDescription.xml' is damaged" in sentence(caught.value, path)
    path = packed(tmp_path / "a.ssp", ssp)
    path.write_bytes(path.read_bytes().replace(b'name="root"', b'name="rood"'))
    with pytest.raises(SystemFileError) as failed:
        System.from_ssp(path)
    assert "SystemStructure.ssd' is damaged" in sentence(failed.value, path)


@nightly
def test_a_bomb_inside_of_an_archive_counts_by_the_size_of_the_file(fmu: Members, ssp: Members, tmp_path: Path) -> None:
    """The FMU of 17 MB may unpack to 3 GB by itself; the SSP around it has 40 kB."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in fmu.items():
            archive.writestr(name, content)
        archive.writestr("resources/stored", ZEROS, zipfile.ZIP_STORED)
        with archive.open("resources/zeros", "w") as file:
            for _ in range(17):
                file.write(ZEROS)
    path = tmp_path / "a.ssp"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in (ssp | {"resources/probe.fmu": data.getvalue()}).items():
            archive.writestr(name, content)
    with pytest.raises(SystemFileError) as caught:
        System.from_ssp(path)
    assert "unpack to 302" in sentence(caught.value, path)


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("/dev/zero")], ids=["pipe", "device"])
def test_what_is_no_file_is_not_read(tmp_path: Path, make: Callable[[Path], object]) -> None:
    make(tmp_path / "a")
    for opened in (lambda path: FmuPart("p", path), System.from_ssp):
        with pytest.raises((FmuError, SystemFileError), match="not a regular file"):
            opened(tmp_path / "a")


def test_files_that_are_folders() -> None:
    assert find_clashes([("a", False), ("a!", False), ("a/b/c", False), ("ab/c", False)]) == ["a"]
    assert find_clashes([("a/b", False), ("a/b/c/d", False), ("a", True)]) == ["a/b"]
    assert find_clashes([("a", False), ("a", True)]) == ["a"]
    assert find_clashes([("", False)]) == [""]
    assert find_clashes([("a", True), ("a/b", True), ("a/c", False), ("a-b/c", False)]) == []
