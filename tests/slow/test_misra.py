"""MISRA C:2012 by cppcheck: the rules from which exported laws deviate are those that their README lists."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Literal

import pytest

from friction_fmus.codegen.export import make_export
from friction_fmus.codegen.readme import readme
from friction_fmus.codegen.sources import header, implementation

LOOP = str(Path(__file__).parents[2] / "examples" / "loop.toml")
LAWS = (
    "LuGreFeedforward",
    "GMSFeedforward",
    "GMSObserver",
    "FrictionResidual",
    "ExtendedStateObserver",
    "DisturbanceObserver",
    "StaticFeedforward",
    LOOP,
)


@pytest.mark.skipif(shutil.which("cppcheck") is None, reason="cppcheck is not installed")
@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("name", LAWS)
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
