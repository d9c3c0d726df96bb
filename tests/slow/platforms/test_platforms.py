"""Binaries of other platforms: their structure, and what they compute under Wine and QEMU."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import lief
import numpy as np
import pytest
from foreign import RUNNERS, drive, missing
from robustness.test_damaged_cache import check_end_of_library
from thorough import nightly, some

from friction_fmus import BuildError, build, catalogue
from harness.compiling.platforms import PLATFORMS, select, universal

CO_SIMULATION, BOTH = 34, 44
"""Numbers of functions of FMI 2.0: for co-simulation, and also for model exchange."""
OURS = {"block_rows", "block_evaluate", "block_violated", "blockDirect"}
"""What the packager and the harness read from a library."""
SYSTEM_DLLS = ("kernel32.dll", "api-ms-win-crt-")
NOT_NUMERIC = {
    "strcmp",
    "strcpy",
    "strncpy",
    "strlen",
    "snprintf",
    "vsnprintf",
    "bcmp",
    "memcpy",
    "memset",
    "calloc",
    "free",
}
EXACT = {"floor", "ceil", "fmod", "round", "ldexp", "nextafter"}
"""Functions of the C library with one right result."""


def exports(name: str) -> int:
    """Return the number of functions that a block has."""
    return CO_SIMULATION if catalogue()[name].no_exchange else BOTH


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Each night every block, for every platform."""
    folder = tmp_path_factory.mktemp("all")
    return {name: build(name, folder, platforms=["all"]) for name in some((*catalogue(),), ("LuGre", "PID"))}


@pytest.fixture(scope="module")
def here(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    """What the blocks return on Linux."""
    return drive("linux64", fmus.values(), tmp_path_factory.mktemp("linux64"))


def binary(fmu: Path, folder: str) -> bytes:
    with zipfile.ZipFile(fmu) as archive:
        (name,) = (name for name in archive.namelist() if name.startswith(f"binaries/{folder}/"))
        return archive.read(name)


def parsed(content: bytes) -> lief.ELF.Binary | lief.PE.Binary | lief.MachO.Binary:
    found = lief.parse(list(content))
    assert isinstance(found, (lief.ELF.Binary, lief.PE.Binary, lief.MachO.Binary))
    return found


def library_functions(fmu: Path) -> set[str]:
    found = parsed(binary(fmu, "linux64"))
    assert isinstance(found, lief.ELF.Binary)
    return {str(symbol.name) for symbol in found.imported_symbols if symbol.name}


def test_every_fmu_has_every_platform(fmus: dict[str, Path]) -> None:
    for name, fmu in fmus.items():
        with zipfile.ZipFile(fmu) as archive:
            found = {entry for entry in archive.namelist() if entry.startswith("binaries/")}
        assert found == {f"binaries/{p.folder}/{name}{p.suffix}" for p in PLATFORMS.values()}


@pytest.mark.parametrize("folder", ["linux64", "aarch64-linux"])
def test_linux_binaries_need_an_old_glibc_only(fmus: dict[str, Path], folder: str) -> None:
    for name, fmu in fmus.items():
        found = parsed(binary(fmu, folder))
        assert isinstance(found, lief.ELF.Binary)
        assert set(found.libraries) <= {"libc.so.6", "libm.so.6"}, name
        needed = {
            str(auxiliary.name)
            for requirement in found.symbols_version_requirement
            for auxiliary in requirement.get_auxiliary_symbols()
        }
        for version in needed:
            assert tuple(map(int, version.removeprefix("GLIBC_").split("."))) <= (2, 17), (name, version)
        exported = {str(symbol.name) for symbol in found.exported_symbols}
        assert exported >= OURS and len(exported - OURS) == exports(name), name
        assert all(symbol.startswith("fmi2") for symbol in exported - OURS)
        assert not found.has(lief.ELF.DynamicEntry.TAG.RUNPATH) and not found.has(lief.ELF.DynamicEntry.TAG.RPATH)


def test_windows_binaries_need_nothing_but_the_system(fmus: dict[str, Path]) -> None:
    for name, fmu in fmus.items():
        found = parsed(binary(fmu, "win64"))
        assert isinstance(found, lief.PE.Binary)
        assert all(str(each.name).lower().startswith(SYSTEM_DLLS) for each in found.imports), name
        exported = {str(entry.name) for entry in found.get_export().entries}
        assert exported >= OURS and len(exported - OURS) == exports(name), name


def test_mac_binaries_are_signed_where_the_system_asks_for_it(fmus: dict[str, Path]) -> None:
    processors = {
        "darwin64": {lief.MachO.Header.CPU_TYPE.X86_64, lief.MachO.Header.CPU_TYPE.ARM64},
        "aarch64-darwin": {lief.MachO.Header.CPU_TYPE.ARM64},
    }
    for name, fmu in fmus.items():
        for folder, expected in processors.items():
            slices = lief.MachO.parse(list(binary(fmu, folder)))
            assert slices and {each.header.cpu_type for each in slices} == expected, name
            for each in slices:
                if each.header.cpu_type == lief.MachO.Header.CPU_TYPE.ARM64:
                    assert each.has_code_signature, name
                libraries = [str(library.name) for library in each.libraries]
                assert libraries == [f"@rpath/{name}.dylib", "/usr/lib/libSystem.B.dylib"]
                exported = {str(symbol.name).removeprefix("_") for symbol in each.exported_symbols}
                assert exported >= OURS and len([s for s in exported if s.startswith("fmi2")]) == exports(name), name


@pytest.mark.parametrize("platform", [name for name, (_, runner) in RUNNERS.items() if runner])
def test_other_platforms_compute_the_same(
    platform: str, fmus: dict[str, Path], here: dict[str, np.ndarray], tmp_path: Path
) -> None:
    """Bit by bit, but for blocks with exp, pow, sin and the like, which each C library rounds in its own way.

    There a difference in the last digit stays one, or is multiplied by iterations and by differences of nearly equal
    numbers: it is measured against the largest value of the variable. A flag, as that of an element that slips, may be
    a sample late where its bound is reached but for such a digit.
    """
    if reason := missing(platform):
        pytest.skip(reason)
    there = drive(platform, fmus.values(), tmp_path)
    assert there.keys() == here.keys() == fmus.keys()
    exact = 0
    for name, expected in here.items():
        a, b = expected.view(np.float64), there[name].view(np.float64)
        assert np.isfinite(a).all() and np.ptp(a, axis=0).any(), name
        rounded = library_functions(fmus[name]) - EXACT - NOT_NUMERIC
        if not rounded:
            assert np.array_equal(expected, there[name]), name
            exact += 1
        flags, far = np.all(a == np.rint(a), axis=0), np.abs(a - b) > 1e-11 * np.abs(a).max(axis=0)
        assert not far[:, ~flags].any(), (name, rounded)
        assert far[:, flags].any(axis=1).mean() < 0.01, (name, rounded)
    assert exact > len(fmus) / 3.5


@nightly
def test_same_bytes_from_another_folder_at_another_time(tmp_path: Path) -> None:
    """From scratch: no cache, another working directory, other temporary folders, another clock."""
    made = []
    for k in range(2):
        folder = tmp_path / ("short" if k else "a/much/longer/path")
        folder.mkdir(parents=True)
        environment = os.environ | {
            "FRICTION_FMUS_CACHE": str(folder / "cache"),
            "TMPDIR": str(folder),
            "TZ": "Pacific/Auckland" if k else "UTC",
            "PYTHONHASHSEED": str(k),
        }
        command = [sys.executable, "-m", "friction_fmus", "build", "LuGre", "PID", "--platform", "all"]
        command += ["-o", str(folder)]
        subprocess.run(command, cwd=folder, env=environment, check=True, timeout=300, stdout=subprocess.DEVNULL)
        made.append([(folder / f"{name}.fmu").read_bytes() for name in ("LuGre", "PID")])
    assert made[0] == made[1]


def test_platforms_are_selected_by_name() -> None:
    assert [platform.folder for platform in select(("win64", "linux64", "win64"))] == ["win64", "linux64"]
    assert {platform.folder for platform in select(("all",))} == set(PLATFORMS)
    with pytest.raises(BuildError, match="There is no platform 'win46'; did you mean 'win64'"):
        select(("win46",))


def test_refused_platform_builds_nothing(tmp_path: Path) -> None:
    with pytest.raises(BuildError, match="There is no platform"):
        build("LuGre", tmp_path / "fmus", platforms=["amiga"])
    assert not (tmp_path / "fmus").exists()


def test_slices_of_a_universal_binary_are_mach_o() -> None:
    with pytest.raises(ValueError, match="begins with 0x464c457f and is not a 64-bit Mach-O file"):
        universal([b"\x7fELF" + bytes(60)])
    with pytest.raises(ValueError, match="not a 64-bit Mach-O file"):
        universal([b""])


def test_fmu_with_one_platform_has_no_other(build_fmu: Callable[..., Path], tmp_path: Path) -> None:
    fmu = build("Coulomb", tmp_path, platforms=["win64"])
    with zipfile.ZipFile(fmu) as archive:
        assert [n for n in archive.namelist() if n.startswith("binaries/")] == ["binaries/win64/Coulomb.dll"]
    with zipfile.ZipFile(build_fmu("Coulomb")) as native, zipfile.ZipFile(fmu) as foreign:
        name = "modelDescription.xml"
        assert native.read(name) == foreign.read(name)


@pytest.mark.parametrize("platform", some(["win64", "darwin64", "aarch64-linux"], ["win64"]))
def test_the_end_of_a_library_is_where_lief_sees_it(platform: str, tmp_path: Path) -> None:
    check_end_of_library(PLATFORMS[platform], tmp_path)
