"""Every command in an empty folder: what it leaves there and in the folder for temporary files."""

from __future__ import annotations

import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from thorough import some

from friction_fmus import fmu
from friction_fmus.cli.main import parser

EXAMPLES = Path(__file__).parents[2] / "examples"
STICK_SLIP = EXAMPLES / "stick_slip.toml"

# command -> its arguments, the statuses it may end with, and what it is asked to write
COMMANDS: dict[str, tuple[list[object], set[int], set[str]]] = {
    "list": ([], {0}, set()),
    "show": (["LuGre"], {0}, set()),
    "cite": (["LuGre"], {0}, set()),
    "help": (["run"], {0}, set()),
    "completion": ([], {0}, set()),
    "build": (["Viscous", "--platform", "darwin64", "-o", "out"], {0}, {"out"}),
    "check": (["Viscous.fmu"], {0}, set()),
    "run": ([STICK_SLIP, "--stop", "0.01", "--step", "1e-4", "-o", "out.csv"], {0}, {"out.csv"}),
    "compose": ([STICK_SLIP, "-o", "out.fmu"], {0}, {"out.fmu"}),
    "codegen": (["CoulombFeedforward", "-o", "out"], {0}, {"out"}),
    "sweep": (
        [STICK_SLIP, "--stop", "0.01", "--step", "1e-4", "--vary", "mass.m=1,2", "--workers", "1", "-o", "out"],
        {0},
        {"out"},
    ),
    "reference": (["build", "--case", "input_ramp", "-o", "out"], {0}, {"out"}),
    "export": (["--to", "modelica", "-o", "out"], {0}, {"out"}),
    "identify": (
        ["../data/axis.toml", "--model", "Stribeck", "--train", "0", "3", "--workers", "1", "-o", "out"],
        {0},
        {"out"},
    ),
    "study": (["../data/study.toml", "--workers", "1", "-o", "out"], {0}, {"out"}),
}

STUDY = """[identify]
models = ["Dahl"]

[data]
record = "tribometer"

[windows]
train = [60.0, 66.0]
validation = [120.0, 126.0]
"""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log file with its mapping, and a study."""
    folder = tmp_path_factory.mktemp("data")
    runpy.run_path(str(EXAMPLES / "identification" / "log_file.py"))["main"](folder)
    shutil.copy(EXAMPLES / "identification" / "axis.toml", folder)
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    return folder


def test_no_command_is_left_out() -> None:
    (commands,) = (action.choices for action in parser()._actions if isinstance(action.choices, dict))
    assert set(commands) == set(COMMANDS)


@pytest.mark.parametrize("command", some([*COMMANDS], [*COMMANDS][::4]))
def test_a_command_leaves_only_what_it_is_asked_for(command: str, data: Path, tmp_path: Path) -> None:
    arguments, statuses, written = COMMANDS[command]
    here, temporary, cache = (tmp_path / name for name in ("here", "temporary", "cache"))
    (tmp_path / "data").symlink_to(data)
    here.mkdir()
    temporary.mkdir()
    if command == "check":
        arguments = [fmu("Viscous")]
    # an empty cache for what is compiled for other platforms, the usual one for whatever takes long
    environment = os.environ | {"TMPDIR": str(temporary)}
    environment |= {"FRICTION_FMUS_CACHE": str(cache)} if command == "build" else {}
    run = subprocess.run(
        [sys.executable, "-m", "friction_fmus", command, *map(str, arguments)],
        cwd=here,
        env=environment,
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )
    assert run.returncode in statuses, run.stderr
    assert {path.name for path in here.iterdir()} == written
    assert [path.name for path in temporary.iterdir()] == []
