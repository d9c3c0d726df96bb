"""Command lines on small files, many in one process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def run_cases(folder: Path, cases: list[tuple[str, str, str, list[str]]]) -> dict[str, int]:
    """All cases in a process of their own; nothing may be wrong with any."""
    with (folder / "cases.jsonl").open("w") as file:
        file.writelines(json.dumps(case) + "\n" for case in cases)
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, str(Path(__file__).with_name("odd_values.py")), str(folder)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=1500)
    bad = [json.loads(line) for line in (folder / "bad.jsonl").read_text().splitlines()]
    said = "\n".join(f"{label}: {status} {text}" for label, status, text in bad[:40])
    where = (folder / "current").read_text() if done.returncode else ""
    assert (done.returncode, bad) == (0, []), f"{len(bad)} bad; {where}\n{said}\n{done.stderr[-3000:]}"
    counts: dict[str, int] = json.loads((folder / "counts.json").read_text())
    return counts
