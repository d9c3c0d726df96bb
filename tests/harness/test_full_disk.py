"""A disk that is full: one sentence with the name of the file, and nothing half-written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from thorough import nightly, some

from harness.results import FORMATS

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="limits the size of files as POSIX does")

ROOT = Path(__file__).parents[2]

# a process of its own: the limit is for good, and netCDF ended with a segmentation fault; without bytecode (-B), which
# Python 3.11 leaves truncated
LIMITED = """
import resource, sys
from pathlib import Path
import numpy as np, xarray as xr
import matplotlib.font_manager
from harness import OutputError, plot, save_result
values = np.random.default_rng(0).standard_normal(20000)
result = xr.Dataset({"a.x": ("time", values)}, coords={"time": np.arange(20000.0)})
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
for path in map(Path, sys.argv[1:]):
    try:
        plot(result, path) if path.suffix == ".png" else save_result(result, path)
    except OutputError as error:
        print(error, flush=True)
"""


@nightly
@pytest.mark.parametrize("there", some([False, True], [True]), ids=lambda there: "replaced" if there else "new")
def test_a_result_that_does_not_fit(there: bool, tmp_path: Path) -> None:
    paths = [tmp_path / f"out{suffix}" for suffix in (*FORMATS, ".png")]
    for path in paths if there else ():
        path.write_text("the last one")
    run = subprocess.run(
        [sys.executable, "-B", "-c", LIMITED, *map(str, paths)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stderr) == (0, "")
    reason = "File too large; free some space or give a path on another disk"
    assert run.stdout.splitlines() == [f"cannot write {path}: {reason}" for path in paths]
    assert {path: path.read_text() for path in tmp_path.iterdir()} == dict.fromkeys(
        paths if there else (), "the last one"
    )


COMMANDS = {
    "Viscous.fmu": ("build", "Viscous", "-o", "FOLDER"),
    "README.md": ("codegen", "CoulombFeedforward", "-o", "FOLDER"),
    "report.txt": ("check", "--static", "Viscous.fmu", "Viscous.fmu", "-o", "FOLDER/report.txt"),
    "report.json": ("check", "--static", "Viscous.fmu", "--format", "json", "-o", "FOLDER/report.json"),
}
FULL = """
import resource, sys
from friction_fmus import build
from friction_fmus.__main__ import main
build("Viscous", ".")
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
sys.exit(main(sys.argv[2:]))
"""


@nightly
@pytest.mark.parametrize("name", some([*COMMANDS], [*COMMANDS][:1]))
def test_what_a_command_writes_and_does_not_fit(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    arguments = [argument.replace("FOLDER", str(folder)) for argument in COMMANDS[name]]
    limit = "16" if name.startswith("report") else "2048"
    run = subprocess.run(
        [sys.executable, "-B", "-c", FULL, limit, *arguments],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT), "PATH": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 2
    assert f"cannot write {folder}/" in run.stderr
    assert run.stderr.endswith(": File too large; free some space or give a path on another disk\n")
    assert run.stderr.count("\n") == 1
    assert not (folder / name).exists()
    assert not list(folder.glob(".*"))


@nightly
@pytest.mark.skipif(os.name != "posix" or os.getuid() != 0, reason="only root may mount a small disk")
def test_an_fmu_that_does_not_fit_into_the_temporary_folder(probe: Path, tmp_path: Path) -> None:
    small = tmp_path / "small"
    small.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=4k", "tmpfs", small], check=False).returncode != 0:
        pytest.skip("this machine lets nobody mount")
    code = (
        "from harness import FmuPart, System\n"
        f"system = System([FmuPart('p', {str(probe)!r})], start={{'p.u': 1.0, 'p.n': 1, 'p.b': True}})\n"
        "try:\n    system.run(stop=1.0, step=0.1)\nexcept Exception as error:\n    print(type(error).__name__, error)\n"
    )
    try:
        environment = os.environ | {"TMPDIR": str(small), "PYTHONPATH": str(ROOT)}
        run = subprocess.run(
            [sys.executable, "-B", "-c", code], env=environment, capture_output=True, text=True, check=False
        )
        left = list(small.iterdir())
    finally:
        subprocess.run(["umount", small], check=True)
    assert run.stdout.startswith(f"FmuError cannot unpack {probe} to {small}/harness-")
    assert run.stdout.endswith(": No space left on device; make room there, or set TMPDIR to another folder\n")
    assert run.stderr == ""
    assert left == []
