"""MISRA C:2012 by cppcheck: the rules from which exported laws deviate are those that their README lists."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Literal

import pytest
from thorough import nightly, some

from friction_fmus.axis.position_map import Grid, PositionMap
from friction_fmus.codegen.law_export import make_export, readme
from friction_fmus.codegen.sources import header, implementation, table_header, table_source

LOOP = str(Path(__file__).parents[2] / "examples" / "loop.toml")
LAWS = (
    "LuGreFeedforward",
    "GMSFeedforward",
    "GMSObserver",
    "ExtendedStateObserver",
    "DisturbanceObserver",
    "StaticFeedforward",
    LOOP,
)


@nightly
@pytest.mark.skipif(shutil.which("cppcheck") is None, reason="cppcheck is not installed")
@pytest.mark.parametrize("real", some(["double", "float"], ["float"]))
@pytest.mark.parametrize("name", some(LAWS, LAWS[:1]))
def test_the_readme_lists_the_deviations(name: str, real: Literal["double", "float"], tmp_path: Path) -> None:
    export = make_export(name, real=real, prefix="law")
    (tmp_path / "law.h").write_text(header(export), encoding="utf-8")
    (tmp_path / "law.c").write_text(implementation(export), encoding="utf-8")
    text = readme(export, ())
    command = re.search(r"`(cppcheck [^`]*)`", " ".join(text.split()))
    assert command
    run = subprocess.run(
        [*command[1].split(), "--quiet"], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=300
    )
    findings = set(re.findall(r"\[([\w.-]+)\]$", run.stderr, re.MULTILINE))
    listed = re.findall(r"^\* Rule (\d+\.\d+): ", text, re.MULTILINE)
    assert findings == {f"misra-c2012-{rule}" for rule in listed}


@pytest.mark.skipif(shutil.which("cppcheck") is None, reason="cppcheck is not installed")
@pytest.mark.parametrize("periodic", some([False, True], [True]))
def test_a_table_over_position_has_no_deviations(periodic: bool, tmp_path: Path) -> None:
    grid = Grid(-0.01, 0.004, 5, periodic)
    export = make_export("PID", prefix="loop")
    table = PositionMap(grid, (1.0, 0.0, -1.0, 0.5, 0.0), (0.1, 0.2, 0.0, 0.0, 0.0), 1e-3)
    (tmp_path / "loop_table.h").write_text(table_header(export), encoding="utf-8")
    (tmp_path / "loop_table.c").write_text(table_source(export, table), encoding="utf-8")
    command = ["cppcheck", "--addon=misra", "--std=c99", "--enable=style", "--quiet", "loop_table.c"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True, timeout=300)
    assert run.stderr == ""
