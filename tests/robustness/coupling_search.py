"""Random masses, stiffnesses and steps on every friction model: is a run of an implicit master ever wrong in silence?

    python tests/robustness/coupling_search.py 520

Each system is run with a step drawn at random and with steps 16, 64 and, if these differ, 512 times shorter. The
finest is the reference; a system whose references differ is not counted. A run is wrong if the force or the position
is off by more than a tenth of its largest value in the mean, or if it moves twice as fast as the reference ever does. A
velocity that is off only because the step is longer than the period of a vibration, which the masters damp, is counted
separately.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from friction_fmus import fmu
from friction_fmus.blocks.catalogue import catalogue
from harness import FmuPart, HarnessError, StartValueError, System, Wire, open_archive

MODELS = [b.name for b in catalogue().values() if b.kind == "friction" and b.name != "LoadDependentDahl"]
"""Models in turn. LoadDependentDahl is Dahl here, as nothing drives its load."""
MASSES = {"KarnoppMass": "F_ext", "SwitchMass": "F_load", "FrenkelKontorova": "F_drive"}  # with a mass of their own
WRONG, DIFFERENT = 0.1, 0.02


@dataclass(frozen=True)
class Case:
    """A system, how it is run, and what is compared."""

    system: System
    step: float
    ticks: int
    record: tuple[str, ...]

    def run(self, master: str, finer: int = 1) -> dict[str, Any]:
        """Return the recorded values at the ticks of the coarse step, and the highest speed at any tick."""
        result = self.system.run(stop=self.ticks * self.step, step=self.step / finer, master=master, record=self.record)
        values = {name: result[name].to_numpy() for name in self.record}
        highest = float(np.abs(values[self.record[0]]).max())
        return {name: value[::finer] for name, value in values.items()} | {"highest": highest}


class Warned(logging.Handler):
    """Keeps the warnings of the harness."""

    def __init__(self) -> None:
        """Begin with none."""
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep one."""
        self.texts.append(record.getMessage())


def draw(seed: int) -> Case:
    """Make the system of a seed; the models take turns."""
    rng = np.random.default_rng(seed)
    name = MODELS[seed % len(MODELS)]
    step, ticks = _log(rng, -5, -2), int(rng.integers(200, 600))
    start = _parameters(rng, name) if rng.random() < 0.7 else {}
    friction = FmuPart("friction", fmu(name))
    if name in MASSES:
        start |= {f"friction.{port.name}": 0.0 for port in friction.inputs if port.name not in ("Fn", MASSES[name])}
        wires: list[str | Wire] = ["friction.v -> contact.v"]
        wires.append(Wire("contact.F", f"friction.{MASSES[name]}", gain=-1.0, offset=_log(rng, -0.7, 0.7)))
        if name != "FrenkelKontorova":
            start["friction.m"] = _log(rng, -7, 2)
        system = _system([friction, FmuPart("contact", fmu("LuGre"))], wires, start)
        return Case(system, step, ticks, ("friction.v", "contact.F"))
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    if "F_ext" in {port.name for port in friction.inputs}:
        wires.append("mass.F_ext -> friction.F_ext")
    m, k = _log(rng, -7, 2), _log(rng, 1, 6)
    start |= {"mass.m": m, "mass.k": k, "mass.F_drive": 0.0}
    start["mass.v_support"] = _log(rng, -0.7, 1) / (
        k * ticks * step
    )  # a fifth to ten times the usual force level of 1 N
    if rng.random() < 0.3:
        start["mass.d"] = _log(rng, -2, 0.5) * float(np.sqrt(k * m))
    system = _system([FmuPart("mass", fmu("Mass")), friction], wires, start)
    return Case(system, step, ticks, ("mass.v", "mass.x", "friction.F"))


def judge(case: Case, masters: Sequence[str]) -> dict[str, str]:
    """Return a verdict for each master; none if the system is not fit to judge by."""
    try:
        fine, reference = case.run("newton", 16), case.run("newton", 64)
        if not _close(fine, reference, case.record):
            fine, reference = reference, case.run("newton", 512)
    except HarnessError:
        return {}
    return (
        {master: _verdict(case, master, reference) for master in masters}
        if _close(fine, reference, case.record)
        else {}
    )


def _verdict(case: Case, master: str, reference: Mapping[str, Any]) -> str:
    warned = Warned()
    logging.getLogger("harness").addHandler(warned)
    try:
        values = case.run(master)
    except HarnessError:
        return "refused"
    finally:
        logging.getLogger("harness").removeHandler(warned)
    says = "warned" if warned.texts else "silent"
    speed = case.record[0]
    if any(_off(values[name], reference[name]) > WRONG for name in case.record[1:]):
        return f"wrong, {says}"
    if values["highest"] > 2.0 * reference["highest"]:
        return f"wrong, {says}"
    vibrates = _off(values[speed], reference[speed]) > WRONG
    return f"vibration damped, {says}" if vibrates else f"right, {says}"


def _close(a: Mapping[str, Any], b: Mapping[str, Any], names: Sequence[str]) -> bool:
    return all(_off(a[name], b[name]) < DIFFERENT for name in names)


def _off(a: Any, b: Any) -> float:
    """Mean deviation over the largest size of the reference."""
    size = float(np.abs(b).max())
    off = float(np.mean(np.abs(a - b)))
    return off / size if size > 0.0 else float(off > 0.0)


def _parameters(rng: np.random.Generator, name: str) -> dict[str, float]:
    """Return some of the parameters of a model, up to five times larger or smaller."""
    found = {}
    for variable in open_archive(fmu(name)).variables.values():
        start = float(variable.start or 0.0) if variable.causality == "parameter" and variable.type == "Real" else 0.0
        if start > 0.0 and "[" not in variable.name and variable.name != "Fn0" and rng.random() < 0.6:
            limit = float(variable.max) if variable.max is not None else np.inf
            found[f"friction.{variable.name}"] = min(start * _log(rng, -0.7, 0.7), limit)
    return found


def _system(parts: Sequence[FmuPart], wires: Sequence[str | Wire], start: Mapping[str, float]) -> System:
    return System(parts, wires, start)


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(10.0 ** rng.uniform(low, high))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the search; the status is the number of runs that were wrong in silence, at most 1."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("count", type=int, help="number of systems")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--masters", default="newton,adaptive", help="names, with commas")
    options = parser.parse_args(arguments)
    logging.getLogger("harness").addHandler(logging.NullHandler())
    masters = options.masters.split(",")
    counts: Counter[tuple[str, str]] = Counter()
    for seed in range(options.first, options.first + options.count):
        try:
            case = draw(seed)
        except StartValueError:
            continue
        with case.system:
            verdicts = judge(case, masters)
        counts.update(verdicts.items() or [(master, "no reference") for master in masters])
        for master, verdict in verdicts.items():
            if verdict.startswith("wrong"):
                print(f"{seed:6d} {MODELS[seed % len(MODELS)]:24s} {master:9s} {verdict}", flush=True)
    for (master, verdict), count in sorted(counts.items()):
        print(f"{master:9s} {verdict:26s} {count:5d}")
    return int(any(verdict == "wrong, silent" for _, verdict in counts))


if __name__ == "__main__":
    sys.exit(main())
