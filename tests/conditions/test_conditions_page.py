"""docs/conditions.md tells the truth."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from friction_fmus import conditions
from friction_fmus.__main__ import main

ROOT = Path(__file__).parent.parent.parent
PAGE = (ROOT / "docs" / "conditions.md").read_text(encoding="utf-8")


def block(mark: str) -> str:
    (text,) = re.findall(rf"<!-- {mark} -->\n```\w+\n(.*?)^```$", PAGE, re.S | re.M)
    return str(text)


def run(command: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    program, *arguments = shlex.split(command)
    assert program == "friction-fmus"
    return main(arguments), capsys.readouterr().out


def test_commands_of_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("hunting.toml").write_text(block("file: hunting.toml"), encoding="utf-8")
    assert run(block("command: hunting"), capsys) == (1, block("output: hunting"))
    plain, full = block("commands").splitlines()
    status, text = run(plain, capsys)
    assert (status, text) == (0, "hunting.toml: 9 conditions evaluated, no problem\n")
    status, text = run(full, capsys)
    assert status == 0
    assert [found["ok"] for found in json.loads(text)] == [True] * 9


def test_program_of_the_page() -> None:
    result = subprocess.run(
        [sys.executable, "-c", block("python")], cwd=ROOT, capture_output=True, text=True, check=True
    )
    first, second = result.stdout.splitlines()
    assert first.startswith("False 429 raise Kd above 428.5 N.s/m")
    assert second == "316"


def test_the_table_names_every_condition() -> None:
    named = {name for name in re.findall(r"`(\w+)`", PAGE) if hasattr(conditions, name)}
    types = {"PathDynamics", "Condition", "DrivenPlant", "SampledLaw"}
    helpers = types | {"closed_loop"}
    assert named | helpers >= set(conditions.__all__)
