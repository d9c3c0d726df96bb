"""The wheel as pip builds it, installed where there is no compiler."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from friction_fmus import catalogue
from harness.compiling.platforms import PLATFORMS

ROOT = Path(__file__).parents[2]

SESSION = """
import sys
from pathlib import Path
import friction_fmus
from harness import System
assert Path(friction_fmus.__file__).is_relative_to(sys.argv[1]), friction_fmus.__file__
assert friction_fmus.fmu("LuGre") == Path(sys.argv[1], "friction_fmus", "fmus", "LuGre.fmu")
copy = friction_fmus.build("PID", sys.argv[1] + "/copy")
assert copy.read_bytes() == friction_fmus.fmu("PID").read_bytes()
with System.from_toml(sys.argv[2], friction_fmus.fmu) as system:
    print(system.run().sizes["time"])
try:
    friction_fmus.build("LuGre", sys.argv[1] + "/own", {"Fc": 2.0})
except friction_fmus.BuildError as error:
    print(error)
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel's files, and a compiler that does nothing."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    command += ["--wheel-dir", str(folder), str(ROOT)]
    subprocess.run(command, check=True, timeout=590, env={k: v for k, v in os.environ.items() if k != "PYTHONPATH"})
    (wheel,) = folder.glob("friction_fmus-*-py3-none-any.whl")
    assert wheel.stat().st_size < 20e6
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def test_wheel_carries_engine_and_fmus_for_all_platforms(installed: Path) -> None:
    assert {path.stem for path in (installed / "friction_fmus" / "fmus").iterdir()} == set(catalogue())
    for platform in PLATFORMS.values():
        engine = installed / "harness" / "engine" / "binaries" / platform.folder / f"engine{platform.suffix}"
        assert engine.stat().st_size > 10_000
    for fmu in (installed / "friction_fmus" / "fmus").iterdir():
        with zipfile.ZipFile(fmu) as archive:
            entries = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
        assert entries == set(PLATFORMS)


def test_wheel_needs_no_compiler(installed: Path, tmp_path: Path) -> None:
    environment = os.environ | {
        "PYTHONPATH": str(installed),
        "CC": "/no/compiler",
        "FRICTION_FMUS_CACHE": str(tmp_path / "cache"),
    }
    command = [sys.executable, "-c", SESSION, str(installed), str(ROOT / "examples" / "stick_slip.toml")]
    run = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    rows, refusal = run.stdout.splitlines()
    assert int(rows) == 25_001
    assert refusal.startswith("The C compiler '/no/compiler' does not run")
