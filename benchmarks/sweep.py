"""Runs per second of a sweep of closed loops: profile, PID, Mass and LuGre, 1 s in steps of 0.1 ms.

One worker process, two of them, and the same loop in Python over fmpy.FMU2Slave take turns; the fastest round of each
counts. All instances are reset and used again. Where others use the machine, two workers gain what two plain processes
gain at that time. The ratio of these gains (the median over the rounds counts) and the overhead of the workers beside
their runs depend on that less. A run of a single step shows what set-up and end take. Then one of two workers is killed
with kill -9 in the middle of a sweep.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).parents[1])  # in this folder harness.py would hide the package

import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping
from typing import Any

import fmpy
import fmpy.fmi2
import numpy as np
import xarray as xr

from benchmarks.rows import Row, arguments, report
from friction_fmus import build
from harness import Experiment, FmuPart, System, latin_hypercube, read_sweep, sweep

PARTS = {"profile": "Profile", "pid": "PID", "mass": "Mass", "friction": "LuGre"}
WIRES = [
    *(f"profile.{name} -> pid.{name}" for name in ("r", "rd", "rdd")),
    *("mass.x -> pid.x", "mass.v -> pid.v", "pid.u -> mass.F_drive"),
    *("mass.v -> friction.v", "friction.F -> mass.F_friction"),
]
ORDER = ("pid", "profile", "mass", "friction")
"""The sampled controller first; everything behind what it reads."""

STEP = 1e-4
BOUNDS = {"friction.Fc": (0.5, 1.4), "mass.m": (0.8, 1.2)}


def worker(result: xr.Dataset) -> dict[str, float]:
    """The worker and its resident memory [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return {"process": os.getpid(), "resident": pages * os.sysconf("SC_PAGE_SIZE") / 1e6}


class FmpyLoop:
    """The closed loop as one writes it with fmpy: every value and every step a call from Python.

    Parameters
    ----------
    fmus : mapping of str to Path
        The FMU of each part.
    folder : Path
        Where to unpack.
    """

    def __init__(self, fmus: Mapping[str, Path], folder: Path) -> None:
        """Instantiate, once for all runs."""
        self.slaves, references = {}, {}
        for name, path in fmus.items():
            description = fmpy.read_model_description(str(path))
            references |= {f"{name}.{v.name}": v.valueReference for v in description.modelVariables}
            self.slaves[name] = fmpy.fmi2.FMU2Slave(
                guid=description.guid,
                modelIdentifier=description.coSimulation.modelIdentifier,
                unzipDirectory=fmpy.extract(str(path), str(folder / name)),
                instanceName=name,
            )
            self.slaves[name].instantiate()
        self.references = references
        wires = [wire.split(" -> ") for wire in WIRES]
        sources = list(dict.fromkeys(source for source, _ in wires))
        self.plan = []
        for name in ORDER:
            inputs = [(source, target) for source, target in wires if target.startswith(f"{name}.")]
            outputs = [source for source in sources if source.startswith(f"{name}.")]
            get, put = [references[o] for o in outputs], [references[target] for _, target in inputs]
            self.plan.append((self.slaves[name], put, [source for source, _ in inputs], get, outputs))

    def run(
        self, values: Mapping[str, float], ticks: int, begin: Callable[[int, dict[str, float]], None] | None = None
    ) -> float:
        """Final position [m]; `begin` may change values before a tick."""
        for name, slave in self.slaves.items():
            slave.reset()
            slave.setupExperiment(startTime=0.0)
            for dotted, value in values.items():
                if dotted.startswith(f"{name}."):
                    slave.setReal([self.references[dotted]], [value])
            slave.enterInitializationMode()
        signals: dict[str, float] = {}
        for _ in range(2):  # once for what the controller reads, once for the rest
            for slave, put, sources, get, outputs in self.plan:
                slave.setReal(put, [signals.get(source, 0.0) for source in sources])
                signals.update(zip(outputs, slave.getReal(get), strict=True))
        for slave in self.slaves.values():
            slave.exitInitializationMode()
        for tick in range(ticks):
            if begin:
                begin(tick, signals)
            for slave, put, sources, get, outputs in self.plan:
                slave.setReal(put, [signals[source] for source in sources])
                slave.doStep(tick * STEP, STEP)
                signals.update(zip(outputs, slave.getReal(get), strict=True))
        return float(signals["mass.x"])


class Killer:
    """Kills one of the workers once some runs are done.

    Parameters
    ----------
    folder : Path
        Of the sweep.
    after : int
        Runs.
    """

    def __init__(self, folder: Path, after: int) -> None:
        """Nothing is killed yet."""
        self.folder = folder
        self.after = after
        self.killed = False

    def update(self, done: int, total: int) -> None:
        """Called by the sweep."""
        if done >= self.after and not self.killed:
            os.kill(int(read_sweep(self.folder)["process"][done - 1]), signal.SIGKILL)
            self.killed = True


def seconds(function: Callable[..., object], *values: object, **options: object) -> float:
    """Seconds that a call takes."""
    begin = time.perf_counter()
    function(*values, **options)
    return time.perf_counter() - begin


def timed_sweep(*values: Any, workers: int, **options: Any) -> tuple[float, float]:
    """Seconds of a sweep, and time of its workers relative to that in their runs."""
    begin = time.perf_counter()
    result = sweep(*values, workers=workers, **options)
    passed = time.perf_counter() - begin
    return passed, workers * passed / float(result["wall_time"].sum())


def gain_of_two(n: int) -> float:
    """Work of two plain processes relative to that of one in the same time."""

    def together(count: int) -> None:
        command = [sys.executable, "-S", "-c", f"for k in range({n}): pass"]
        for process in [subprocess.Popen(command) for _ in range(count)]:
            process.wait()

    return 2.0 * seconds(together, 1) / seconds(together, 2)


def main() -> None:
    """Prints the table."""
    options = arguments(__doc__ or "")
    rounds, runs = (1, 100) if options.short else (5, 1000)
    samples = latin_hypercube(BOUNDS, runs, seed=1)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        fmus = {name: build(model, folder) for name, model in PARTS.items()}
        loop = FmpyLoop(fmus, folder)
        experiment = Experiment(stop=1.0, step=STEP)
        with System([FmuPart(name, path) for name, path in fmus.items()], WIRES) as system:
            common = {"measure": ["final(mass.x)", worker], "experiment": experiment}

            sweep(system, samples[:4], **common, workers=2)  # the server from which the workers are forked
            one, two, fmpy_loop, gain = [], [], [], []
            for _ in range(rounds):
                one.append(timed_sweep(system, samples, **common, workers=1))
                two.append(timed_sweep(system, samples, **common, workers=2))
                fmpy_loop.append(seconds(loop.run, samples[0], experiment.ticks))
                gain.append(gain_of_two(20_000_000))
            tick = Experiment(stop=STEP, step=STEP)
            serially = {"measure": "final(mass.x)", "executor": "serial"}
            whole, short = (
                float(sweep(system, samples, experiment=each, **serially)["wall_time"].min())
                for each in (experiment, tick)
            )

            serial = sweep(system, samples, **common, executor="serial")
            alone = sweep(system, samples, **common, workers=1)
            killer = Killer(folder / "out", runs // 3)
            killed = sweep(system, samples, **common, workers=2, output=killer.folder, progress=killer)
        x = serial["final(mass.x)"].to_numpy()
        if not np.isclose(loop.run(samples[0], experiment.ticks), x[0], rtol=1e-9):
            raise SystemExit("the loop over fmpy does not do the same as the sweep")
        lost = runs - int((killed["final(mass.x)"].to_numpy() == x).sum()) if killer.killed else runs
        memory = alone["resident"].to_numpy()
    growth = float(memory[-1] - memory[runs // 5])
    ratios = [plain * s2 / s1 for plain, (s1, _), (s2, _) in zip(gain, one, two, strict=True)]
    (seconds_1, beside_1), (seconds_2, beside_2) = (np.min(times, axis=0).tolist() for times in (one, two))
    rows = [
        Row("one worker", runs / seconds_1, "runs/s"),
        Row("two workers", runs / seconds_2, "runs/s"),
        Row("two workers: time / one", seconds_2 / seconds_1, "x", 1.0 / 1.8),
        Row("gain of two plain processes then", max(gain), "x"),
        Row("gain of two plain processes relative to that of two workers", float(np.median(ratios)), "x", 1.0 / 0.9),
        Row("two workers: overhead / one", beside_2 / beside_1, "x", 2.0 / 1.8),
        Row("a loop over fmpy", 1.0 / min(fmpy_loop), "runs/s"),
        Row("one worker: time / fmpy", seconds_1 / runs / min(fmpy_loop), "x", 1.0 / 15.0),
        Row("a run in the sweep", 1e3 * whole, "ms"),
        Row("of it set-up and end", 1e3 * short, "ms", 0.5),
        Row("memory growth, last 80 % of runs", growth, "MB", 3.0),
        Row("lost by kill -9 of a worker", float(lost), "runs", 0.0),
    ]
    report(f"Sweep of {runs} closed loops, 1 s at {1e-3 / STEP:g} kHz", rows, options.json)


if __name__ == "__main__":
    main()
