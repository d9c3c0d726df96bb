"""The benchmarks run, and docs/performance.md has their rows."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from thorough import nightly, some

ERRORS = ("Stick-slip", "Servo loop", "Stuck mass", "Two masses")
MISSED = ("Stick-slip: error of the period at 1 ms, newton / MuJoCo RK4 (four evaluations a step)",)
ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "performance.md").read_text(encoding="utf-8")
BENCHMARKS = re.findall(r"^\$ python benchmarks/(\w+)\.py --json", PAGE, flags=re.M)


def names() -> set[str]:
    """The names of the rows: a table is headed by their subject or by their quantity."""
    found, heading = set(), ""
    for first, second in re.findall(r"^\| *(.*?) *\| *(.*?) *\|", PAGE, flags=re.M):
        if second == "value":
            heading = first
        found |= {f"{heading}: {first}", f"{first}: {heading}"} if heading else {first}
    return found


def test_the_page_names_every_benchmark() -> None:
    helpers = {
        "rows",
        "page",
        "pairs",
        "peers",
        "step_cost",
        "stick_slip_errors",
        "sampled_loop",
        "linear_loops",
        "law_runs",
        "effects",  # has a page of its own
        "law_variants",
        "cycles",  # its table belongs to the study
        "identification",  # its figures stand in the page of identification
    }
    assert set(BENCHMARKS) == {path.stem for path in (ROOT / "benchmarks").glob("*.py")} - helpers


@nightly
@pytest.mark.parametrize("name", some(BENCHMARKS, BENCHMARKS[:1]))
def test_benchmark_runs_and_its_rows_stand_in_the_page(name: str, tmp_path: Path) -> None:
    """Times depend on the machine: the page says whether their targets are met. Errors do not."""
    file = tmp_path / f"{name}.json"
    command = [sys.executable, f"benchmarks/{name}.py", "--short", "--json", str(file)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    rows = json.loads(file.read_text(encoding="utf-8"))
    assert rows
    for row in rows:
        assert row.keys() == {"name", "value", "unit", "target", "ok"}
        assert row["name"] in run.stdout.replace("│", " ") or len(row["name"]) > 30
        assert (row["name"] in names()) == (row["unit"] not in ("ns", "ms", "runs/s", "million/s")), row["name"]
        if row["name"].startswith(ERRORS) and row["name"] not in MISSED:
            assert row["ok"], row
    command = [sys.executable, "benchmarks/page.py", str(file)]
    written = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert written.startswith("# Performance")
