"""Each failure of a tool has a report for its maintainers, and the table of the page is that of the results."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from reference_set.tool_table import BEGIN, END, PAGE, read, table

from friction_fmus.reference.tool_runs import FAILED, INACCURATE

REPORTS = {
    path.stem: path.read_text(encoding="utf-8") for path in sorted((Path(__file__).parent / "reports").glob("*.md"))
}
WORDS = {
    "FMPy": "FMPy",
    "OMSimulator": "OMSimulator",
    "libcosim": "libcosim",
    "ecos": "ecospy",
    "CoFMPy": "CoFMPy",
    "FMU Toolbox": "fmu-manipulation-toolbox",
    "casadi": "casadi",
    "PathSim": "pathsim-fmi",
}
"""How a report names the tool of a column."""


def of(text: str, entry: str) -> str:
    """An entry in the head of a report."""
    (found,) = re.findall(rf"^\* {entry}: (.*(?:\n  .*)*)$", text, re.M)
    return " ".join(found.split())


def test_each_failure_has_a_report_of_this_version() -> None:
    missing = []
    for tool, found in read().items():
        for case, (state, detail) in found["cases"].items():
            explained = any(
                case in of(text, "Cases").split(", ") and WORDS.get(tool, tool) in of(text, "Tool")
                and found["version"] in of(text, "Tool")
                for text in REPORTS.values()
            )  # fmt: skip
            if state in (FAILED, INACCURATE) and not explained:
                missing.append(f"{tool} {found['version']}: {case} {state}: {detail}")
    assert missing == []


@pytest.mark.parametrize("name", REPORTS)
def test_a_report_has_a_short_program_and_says_what_is_expected(name: str) -> None:
    text = REPORTS[name]
    (program,) = re.findall(r"```python\n(.*?)```", text, re.S)
    ast.parse(program)
    assert len(program.splitlines()) <= 20
    heads = re.findall(r"^## (.*)$", text, re.M)
    assert heads == ["What happens", "Reproduce", "What the standard says", "Expected"]


def test_the_table_of_the_page_is_that_of_the_results() -> None:
    """`tool_table.py` without arguments writes it."""
    text = PAGE.read_text(encoding="utf-8")
    assert text.partition(BEGIN)[2].partition(END)[0].strip() == table().strip()
