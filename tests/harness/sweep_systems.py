"""Systems and measures for the tests of sweeps, at module level so that workers can import them."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from harness import CallablePart, Experiment, System
from harness.parts.part import StartValue
from harness.result import Result

ONE_TICK = Experiment(stop=1.0, step=1.0)


class Counted(CallablePart):
    """y = number; notes every run with its process, takes its time, and kills its process if told so.

    ``kill`` 1: the first time that it is run, 2: every time.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__("p", square, ["number", "wait", "kill", "fail"], ["y"])
        self.folder = folder

    def enter_initialisation(
        self, start: float, stop: float, tolerance: float | None, values: Mapping[str, StartValue]
    ) -> None:
        super().enter_initialisation(start, stop, tolerance, values)
        number = int(values["number"])
        with (self.folder / "log").open("a") as log:
            log.write(f"{number} {os.getpid()}\n")
        time.sleep(float(values["wait"]))
        before = self.folder / f"killed-{number}"
        if values["kill"] == 2 or (values["kill"] == 1 and not before.exists()):
            before.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        if values["fail"]:
            raise ValueError(f"number {number} is out of order")


def square(t: float, u: object, x: object) -> float:
    return float(u[0]) ** 2  # type: ignore[index]


def make_counted(folder: Path) -> System:
    start = {"p.number": 0, "p.wait": 0.0, "p.kill": 0, "p.fail": 0}
    return System([Counted(folder)], start=start, experiment=ONE_TICK)


def counted(folder: Path) -> partial[System]:
    """Makes such systems, in any process."""
    return partial(make_counted, folder)


def log_of(folder: Path) -> list[tuple[int, int]]:
    """Number and process of every run that was begun."""
    lines = (folder / "log").read_text().splitlines()
    return [(int(number), int(process)) for number, process in (line.split() for line in lines)]


def root(result: Result) -> dict[str, float]:
    return {"root": float(result["p.y"][-1]) ** 0.5}


def picky(result: Result) -> dict[str, float]:
    """Another name for the run 2, an error for the run 3."""
    number = round(float(result["p.y"][-1]) ** 0.5)
    if number == 3:
        raise ZeroDivisionError("no three")
    return {"other" if number == 2 else "root": float(number)}
