"""A command that is ended while its workers identify models leaves no process behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from thorough import landing, some

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")


def descendants(parent: int) -> set[int]:
    """Processes that a process and its children started."""
    owners = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            owners[int(path.parent.name)] = int(path.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
    found = {parent}
    while more := {process for process, owner in owners.items() if owner in found} - found:
        found |= more
    return found - {parent}


def running(process: int) -> bool:
    """Whether a process exists and is not a dead one that nobody waited for."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record that takes much longer to identify than the test."""
    t = np.arange(0.0, 20.0, 1e-3)
    q, v = 0.1 * np.sin(5.0 * t), 0.5 * np.cos(5.0 * t)
    noise = np.random.default_rng(1).normal(0.0, 0.1, len(t))
    force = -2.0 * 25.0 * q + 3.0 * np.sign(v) + 4.0 * v + noise
    path = tmp_path_factory.mktemp("log") / "axis.csv"
    rows = np.column_stack([t, q, force])
    np.savetxt(path, rows, "%.8g", ",", header="t [s],position [m],force [N]", comments="")
    return path


@landing
@pytest.mark.parametrize("ended_by", some([signal.SIGTERM, signal.SIGINT], [signal.SIGTERM]))
def test_no_worker_outlives_the_command(log: Path, tmp_path: Path, ended_by: signal.Signals) -> None:
    models = [option for name in ("Coulomb", "LuGre", "GMS", "Leuven") for option in ("--model", name)]
    command = [sys.executable, "-m", "friction_fmus", "identify", str(log), *models, "--workers", "2"]
    with subprocess.Popen(
        [*command, "-o", str(tmp_path / "out")],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # tests in the background ignore it
    ) as started:
        assert started.stderr is not None
        assert "Coulomb" in started.stderr.readline()  # so the others are being identified
        workers = descendants(started.pid)
        assert len([each for each in workers if running(each)]) >= 2
        os.kill(started.pid, ended_by)  # only the process itself, as a job scheduler does
        limit = time.monotonic() + 3.0
        while time.monotonic() < limit and (any(map(running, workers)) or started.poll() is None):
            time.sleep(0.05)
        left = [each for each in workers if running(each)]
        for each in left:
            os.kill(each, signal.SIGKILL)
        assert left == []
        assert started.poll() == (130 if ended_by == signal.SIGINT else -signal.SIGTERM)
