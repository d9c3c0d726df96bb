"""The page on drives: its commands are run, its errors are theirs."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from thorough import nightly

from friction_fmus.export.targets import targets

PAGE = (Path(__file__).parents[2] / "docs" / "drives.md").read_text(encoding="utf-8")


def test_the_page_has_all_drives() -> None:
    rows = re.findall(r"^\| `([\w-]+)` \|", PAGE, re.M)
    assert set(rows) == {name for name, target in targets("axis").items() if target.summary.startswith("a sheet")}


@nightly
def test_the_commands_give_the_errors_of_the_page(tmp_path: Path) -> None:
    (commands,) = re.findall(r"<!-- commands -->\n```\w+\n(.*?)^```$", PAGE, re.S | re.M)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for command in commands.splitlines():
        subprocess.run(shlex.split(command), cwd=tmp_path, env=os.environ | {"PATH": path}, check=True)
    said = dict(re.findall(r"^\| `([\w-]+)` \|[^|]*\| ([\d.]+) µm \|", PAGE, re.M))
    assert len(said) == 5
    units = {"nm": 1e-3, "µm": 1.0}
    for name, error in said.items():
        page = (tmp_path / "sheets" / f"{name}.md").read_text(encoding="utf-8")
        ((number, unit),) = re.findall(r"^\| this sheet \| ([\d.]+) (\S+) \|", page, re.M)
        assert float(number) * units[unit] == pytest.approx(float(error), rel=0.05), name
