"""Binaries of FMI 3.0 for other platforms: what they export and need, and what they compute under Wine and QEMU."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import fmpy
import lief
import numpy as np
import pytest
from foreign import RUNNERS, drive, missing
from shell.facade import facade
from shell.selection import built
from test_platforms import SYSTEM_DLLS, parsed
from thorough import nightly, some

from friction_fmus import build

NAMES = some(("GMS", "PID"), ("PID",))
"""With arrays, and with a clock."""
FOLDERS = {"x86_64-linux", "x86_64-windows", "x86_64-darwin", "aarch64-linux", "aarch64-darwin"}
OF_THE_LINKER = {"_mh_dylib_header", "__dso_handle"}
"""Symbols that the linker adds to a library for macOS."""
HEADER = (Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h").read_text(encoding="utf-8")
FUNCTIONS = {*re.findall(r"#define (fmi3\w+) +fmi3FullName", HEADER), "harness_SetInputDerivatives"}


@pytest.mark.parametrize("name", NAMES)
def test_every_platform_exports_the_functions_of_fmi_3(name: str, tmp_path: Path) -> None:
    with zipfile.ZipFile(build(name, tmp_path, platforms=["all"], fmi=3)) as archive:
        binaries = {entry.split("/")[1]: archive.read(entry) for entry in archive.namelist() if "binaries/" in entry}
    assert set(binaries) == FOLDERS
    assert len(FUNCTIONS) == 76
    for folder, content in binaries.items():
        found = parsed(content) if "darwin" not in folder else lief.MachO.parse(list(content))[0]
        if isinstance(found, lief.PE.Binary):
            exported = {str(entry.name) for entry in found.get_export().entries}
            assert all(str(each.name).lower().startswith(SYSTEM_DLLS) for each in found.imports)
        else:
            exported = {str(symbol.name) for symbol in found.exported_symbols}
        if isinstance(found, lief.MachO.Binary):
            exported = {text.removeprefix("_") for text in exported} - OF_THE_LINKER
        assert exported == FUNCTIONS, folder


@nightly
@pytest.mark.parametrize("platform", [name for name, (_, runner) in RUNNERS.items() if runner])
def test_other_platforms_compute_the_same(platform: str, tmp_path: Path) -> None:
    """As here, but for the last digits of exp and pow; through facade.c."""
    if reason := missing(platform):
        pytest.skip(reason)
    values = {}
    for place in ("linux64", platform):
        folder = tmp_path / place
        fmus = [facade(built(name, folder / "2"), folder / "3", place) for name in NAMES]
        values[place] = drive(place, fmus, folder)
    for name in NAMES:
        here, there = (values[place][name].view(np.float64) for place in ("linux64", platform))
        assert np.isfinite(here).all() and np.ptp(here, axis=0).any()
        assert (np.abs(here - there) <= 1e-11 * np.abs(here).max(axis=0)).all(), name
