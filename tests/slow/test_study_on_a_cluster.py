"""The study on a dask cluster: a scheduler and two workers, each a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from thorough import nightly

from friction_fmus.cli.main import main

distributed = pytest.importorskip("distributed")

SETTINGS = """
[data]
record = "demo"
[servo]
law = "PID"
Kp = 12000.0
Kd = 190.0
Ki = 0.0
force_limit = 20.0
Ts = 1e-3
quantum = 1e-7
velocity_feedforward = true
[identify]
models = ["Coulomb", "Stribeck", "Viscous"]
[compensation]
compensators = ["StaticFeedforward", "DisturbanceObserver"]
duration = 2.0
"""


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[str]:
    """The address of a scheduler with two workers."""
    file = tmp_path / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    common = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with ExitStack() as stack:

        def start(*arguments: str) -> None:
            process = subprocess.Popen([*dask, *arguments, "--scheduler-file", str(file)], **common)  # type: ignore[call-overload]
            stack.callback(process.wait, 60)
            stack.callback(process.terminate)

        start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        for _ in range(2):
            start("worker", "--nthreads", "1", "--no-dashboard", "--local-directory", str(tmp_path))
        deadline = time.monotonic() + 120.0
        while not file.is_file() or not file.read_text(encoding="utf-8"):
            assert time.monotonic() < deadline
            time.sleep(0.1)
        address = json.loads(file.read_text(encoding="utf-8"))["address"]
        with distributed.Client(address, timeout=60) as client:
            client.wait_for_workers(2, timeout=120)
        yield str(address)


def numbers(folder: Path) -> dict[str, Any]:
    """The result of a study without measured times."""
    result = json.loads((folder / "study.json").read_text(encoding="utf-8"))
    models = {row["name"]: row["parameters"] for row in result["models"]}
    metrics = {row["name"]: row["metrics"] for row in result["compensators"]}
    return {
        "models": models,
        "metrics": metrics,
        "ladder": result["ladder"],
        "winner": result["recommendation"]["name"],
    }


@nightly
def test_the_study_on_two_workers_is_that_of_one_process(tmp_path: Path, scheduler: str) -> None:
    settings = tmp_path / "demo.toml"
    settings.write_text(SETTINGS, encoding="utf-8")
    there, here = tmp_path / "there", tmp_path / "here"
    assert main(["study", str(settings), "-o", str(there), "--scheduler", scheduler]) == 0
    with distributed.Client(scheduler, timeout=60) as client:
        worked = client.run(lambda: "friction_fmus.study.model_ranking" in sys.modules)
    assert len(worked) == 2
    assert all(worked.values()), "one of the workers did nothing"
    assert main(["study", str(settings), "-o", str(here), "--workers", "1"]) == 0
    assert numbers(there) == numbers(here)
    assert (there / "report.html").stat().st_size > 100_000
