"""docs/ssp.md tells the truth."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from thorough import nightly

from harness import System

ROOT = Path(__file__).parent.parent.parent


@nightly
def test_program_of_the_page(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "ssp.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"<!-- python -->\n```python\n(.*?)^```$", text, re.S | re.M)
    check = "assert system.start['mass.k'] == 2.0 and 'friction.F' in result\n"
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    result = subprocess.run(
        [sys.executable, "-c", program + check],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    with System.from_ssp(tmp_path / "stick_slip.ssp") as system:
        changed = system.with_parameters(tmp_path / "soft.ssv", prefix="friction.")
    assert changed.start["friction.sigma0"] == 20000.0  # N/m
