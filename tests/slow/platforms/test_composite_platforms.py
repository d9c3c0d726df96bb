"""A composite FMU for other platforms: the same values under Wine and QEMU, nothing but the system is needed."""

from __future__ import annotations

import zipfile
from pathlib import Path

import lief
import numpy as np
import pytest
from foreign import RUNNERS, drive, missing
from test_platforms import BOTH, SYSTEM_DLLS, binary, parsed
from thorough import nightly

from friction_fmus import fmu
from harness import System
from harness.compiling.platforms import PLATFORMS

EXAMPLE = Path(__file__).parents[3] / "examples" / "compensated_axis.toml"

pytestmark = nightly


@pytest.fixture(scope="module")
def servo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("composite") / "Servo.fmu"
    with System.from_toml(EXAMPLE, resolve=fmu) as system:
        system.to_fmu(path, inputs=["axis.F_load"], platforms=["all"])
    return path


def test_every_platform_is_there_and_exports_fmi_only(servo: Path) -> None:
    with zipfile.ZipFile(servo) as archive:
        found = {entry for entry in archive.namelist() if entry.startswith("binaries/")}
    assert found == {f"binaries/{p.folder}/Servo{p.suffix}" for p in PLATFORMS.values()}
    windows = parsed(binary(servo, "win64"))
    assert isinstance(windows, lief.PE.Binary)
    assert all(str(each.name).lower().startswith(SYSTEM_DLLS) for each in windows.imports)
    exported = {str(entry.name) for entry in windows.get_export().entries}
    assert len(exported) == BOTH
    assert all(name.startswith("fmi2") for name in exported)
    for folder in ("darwin64", "aarch64-darwin"):
        slices = lief.MachO.parse(list(binary(servo, folder)))  # its parts do not outlive it
        assert slices
        for each in slices:
            names = {str(symbol.name).removeprefix("_") for symbol in each.exported_symbols}
            assert len([name for name in names if name.startswith("fmi2")]) == BOTH


@pytest.mark.parametrize("platform", [name for name, (_, runner) in RUNNERS.items() if runner])
def test_other_platforms_compute_the_same(platform: str, servo: Path, tmp_path: Path) -> None:
    """But for exp and sin, which each C library rounds in its own way; iterations multiply that."""
    if reason := missing(platform):
        pytest.skip(reason)
    here = drive("linux64", [servo], tmp_path)["Servo"].view(np.float64)
    (tmp_path / "there").mkdir()
    there = drive(platform, [servo], tmp_path / "there")["Servo"].view(np.float64)
    assert np.isfinite(here).all()
    assert np.ptp(here, axis=0).any()
    assert (np.abs(here - there) <= 1e-6 * np.abs(here).max(axis=0)).all()
