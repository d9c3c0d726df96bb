"""Jobs for the importers that run in processes of their own, and what their answers are compared with."""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy import fmi2
from fmpy.logging import addLoggerProxy
from interop.loops import EVERY, STEP, STOP, Loop, Trajectories, description, ports, start_value, variables
from shell.instance import Instance, load

WORKERS = Path(__file__).parent / "workers"
SMALL = 1e-6
"""Differences are relative to what is larger than this: chains at rest show nothing but rounding."""
ALONE = "block"
"""Name of the only part of a system of one."""


def loop_job(name: str, loop: Loop, **more: Any) -> dict[str, Any]:
    """A job for a worker: the loop over all its steps."""
    return {
        "name": name,
        "fmus": {part: str(fmu) for part, fmu in loop.fmus.items()},
        "wires": loop.wires,
        "start": dict(loop.start),
        "outputs": loop.outputs(),
        "step": STEP,
        "count": round(STOP / STEP),
        "every": EVERY,
    } | more


def alone_job(name: str, fmu: Path, **more: Any) -> dict[str, Any]:
    """A job for a worker: the default experiment of one FMU."""
    experiment = description(fmu).defaultExperiment
    step = float(experiment.stepSize)
    count = round(float(experiment.stopTime) / step)
    return loop_job(name, Loop({ALONE: fmu}, (), {})) | {"step": step, "count": count, "every": count} | more


def in_worker(worker: str, jobs: Iterable[Mapping[str, Any]], python: str = sys.executable) -> dict[str, Any]:
    """The answer to each job by its name: a dict with ``rows``, or a text that says what went wrong."""
    jobs = list(jobs)
    run = subprocess.run(
        [python, str(WORKERS / f"{worker}.py")], input=json.dumps(jobs), capture_output=True, text=True, check=False
    )
    lines = [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]  # libcosim logs there, too
    answers: dict[str, Any] = {line["end"]: line.get("error", line) for line in lines if "end" in line}
    begun = [line["begin"] for line in lines if "begin" in line]
    end = f"{worker} ended with {run.returncode} in {begun[-1:]}: {run.stderr[-500:]}"
    return {job["name"]: answers.get(job["name"], end) for job in jobs}


def as_trajectories(job: Mapping[str, Any], rows: Iterable[Iterable[float]]) -> Trajectories:
    """The rows of a worker by the names of the outputs."""
    return dict(zip(job["outputs"], np.array(rows).T, strict=True))


def deviation(found: Trajectories, expected: Trajectories, names: Iterable[str]) -> float:
    """The largest difference of these outputs, each relative to its largest value."""
    return max(float(np.abs(found[n] - expected[n]).max() / max(np.abs(expected[n]).max(), SMALL)) for n in names)


def without_start(trajectories: Trajectories) -> Trajectories:
    """The trajectories without their first row."""
    return {name: values[1:] for name, values in trajectories.items()}


def default_experiment(fmu: Path) -> Trajectories:
    """The Real outputs at the end of the default experiment, inputs at their start values, called directly."""
    job = alone_job("", fmu)
    library = load(fmu)
    with Instance(library) as run:
        run.initialise()
        run.set({name: start_value(variables(fmu)[name]) for name in ports(fmu, "input")})
        for k in range(job["count"]):
            run.step(k * job["step"], job["step"])
        names = ports(fmu, "output", "Real")
        return {f"{ALONE}.{name}": np.array([value]) for name, value in zip(names, run.get(*names), strict=True)}


_LOGGER = fmi2.fmi2CallbackLoggerTYPE(fmi2.printLogMessage)


def kept_callbacks() -> fmi2.fmi2CallbackFunctions:
    """Callbacks with a logger that lives as long as the program.

    fmpy's own live as long as an instance, but its C proxy calls the last of them also for later instances.
    """
    made = fmi2.fmi2CallbackFunctions()
    made.logger = _LOGGER
    made.allocateMemory, made.freeMemory = fmi2.defaultCallbacks.allocateMemory, fmi2.defaultCallbacks.freeMemory
    addLoggerProxy(ctypes.byref(made))
    return made


@contextmanager
def slave(part: str, fmu: Path, folder: Path) -> Iterator[fmi2.FMU2Slave]:
    """An FMU in fmpy, unpacked and instantiated."""
    said = fmpy.read_model_description(str(fmu))
    fmpy.extract(str(fmu), str(folder))
    made = fmi2.FMU2Slave(
        guid=said.guid,
        unzipDirectory=str(folder),
        modelIdentifier=said.coSimulation.modelIdentifier,
        instanceName=part,
    )
    made.instantiate(callbacks=kept_callbacks())
    yield made
    made.freeInstance()
    shutil.rmtree(folder)


def in_fmpy(fmu: Path, folder: Path, **options: Any) -> np.ndarray:
    """The rows of `fmpy.simulate_fmu`."""
    with slave(fmu.stem, fmu, folder) as instance:
        rows: np.ndarray = fmpy.simulate_fmu(str(fmu), fmu_instance=instance, **options)
    return rows


def failures(
    jobs: Mapping[str, Mapping[str, Any]],
    answers: Mapping[str, Any],
    judge: Callable[[str, Mapping[str, Any]], float],
    tolerance: float,
) -> dict[str, Any]:
    """The answers that are errors, and the deviations above the tolerance, by the names of the jobs."""
    bad: dict[str, Any] = {}
    for name in jobs:
        answer = answers[name]
        if isinstance(answer, str):
            bad[name] = answer
        elif not (found := judge(name, answer)) < tolerance:
            bad[name] = found
    return bad
