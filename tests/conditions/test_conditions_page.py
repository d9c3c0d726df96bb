"""docs/conditions.md tells the truth."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from friction_fmus import conditions

ROOT = Path(__file__).parent.parent.parent
PAGE = (ROOT / "docs" / "conditions.md").read_text(encoding="utf-8")


def test_program_of_the_page(capsys: pytest.CaptureFixture[str]) -> None:
    (program,) = re.findall(r"<!-- python -->\n```python\n(.*?)^```$", PAGE, re.S | re.M)
    exec(program, {})
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("False 429 raise Kd above 428.5 N.s/m")
    assert "static friction, 1.5 N, is above Coulomb friction, 1 N" in second


def test_the_table_names_every_condition() -> None:
    named = {name for name in re.findall(r"`(\w+)`", PAGE) if hasattr(conditions, name)}
    types = {"PathDynamics", "Condition", "DrivenPlant", "SampledLaw"}
    helpers = types | {"closed_loop"}
    assert named | helpers >= set(conditions.__all__)
