"""Random masses, springs, loads and steps, as in `coupling_search.py`, with the Modelica library as the reference.

    python tests/robustness/modelica_search.py 200

The equations were written from the papers, and rumoca, which simulates them, shares no code with this project. The
references of `coupling_search.py` are compared too. A system that rumoca does not solve, or whose answer changes where
friction is 0.3 % lower, is not counted.
"""

from __future__ import annotations

import argparse
import logging
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import rumoca

sys.path.insert(0, str(Path(__file__).parents[1]))

from accuracy.event_driven import Phase
from coupling_search import FAILURES, Case, Composites, References, draw, fits, judge
from modelica.library import Library, given

from friction_fmus.blocks.catalogue import source_folder
from friction_fmus.export.targets.modelica import write

LAWS = {file.stem for file in (source_folder() / "friction").glob("*.mo")}
TOLERANCE = 1e-8
AGREES = 1e-3  # of the range of a variable


def steps(phases: Sequence[Phase]) -> str:
    """Return a force that is constant between jumps as an expression."""
    text = repr(phases[-1].force)
    for phase, after in reversed(list(pairwise(phases))):
        text = f"if time < {after.begin!r} then {phase.force!r} else {text}"
    return f"({text})"


def system(case: Case, phases: Sequence[Phase], factor: float) -> str:
    """Return the mass, its spring and damper, and its contact in Modelica."""
    values: dict[str, Any] = {}
    for name, value in case.contact.items():
        if vector := re.match(r"(\w+)\[", name):
            values.setdefault(vector[1], []).append(value)
        else:
            values[name] = int(value) if name in ("N", "order", "shape") else value
    load = ""
    if case.model == "Viscous":
        values["Fv"] *= factor
    elif case.model == "LoadDependentDahl":
        values["useF_t"], load = True, f"friction.F_t = {factor * values.pop('F_t')!r};"
    else:
        values["useFn"], load = True, f"friction.Fn = {factor!r};"
    modifiers = given({name: value for name, value in values.items() if name != "theta"})
    modifiers += f", theta(start = {values['theta']!r})" if "theta" in values else ""
    m, k, d, speed, v0 = (case.mass[name] for name in ("m", "k", "d", "v_support", "v0"))
    mechanics = "Modelica.Mechanics.Translational"
    return f"""model Test
  {mechanics}.Components.Fixed ground;
  FrictionFMUs.Translational.{case.model} friction({modifiers});
  {mechanics}.Components.Mass mass(m = {m!r}, s(start = 0, fixed = true), v(start = {v0!r}, fixed = true));
  {mechanics}.Sources.Force force;
equation
  connect(ground.flange, friction.flange_a);
  connect(friction.flange_b, mass.flange_a);
  connect(force.flange, mass.flange_b);
  force.f = {steps(phases)} - {k!r}*(mass.s - {speed!r}*time) - {d!r}*(mass.v - {speed!r});
  {load}
end Test;"""


def in_modelica(case: Case, library: Library) -> Case:
    """Return the case with rumoca as its reference."""

    def solve(phases: Sequence[Phase], factor: float, t: np.ndarray, _strict: int) -> dict[str, np.ndarray]:
        try:
            result = library.run(system(case, phases, factor), float(t[-1]), float(t[1]), TOLERANCE, 1e-6)
        except rumoca.RumocaError as error:
            raise RuntimeError(str(error)) from error
        times = np.array(result.time)
        last = np.searchsorted(times, t * (1.0 + 1e-12), side="right") - 1
        rows = {"x": "mass.s", "v": "mass.v", "F": "friction.F"}
        return {name: np.array(result[row])[last] for name, row in rows.items()}

    return replace(case, solve=solve)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the search; the status tells whether a run was wrong without a word."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("count", type=int, help="number of seeds; a third of the models is not in the library")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--runs", default="newton,adaptive", help="masters and composite, with commas")
    options = parser.parse_args(arguments)
    logging.getLogger("harness").addHandler(logging.NullHandler())
    counts: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        made, library = Composites(Path(folder)), Library(write(Path(folder)))
        for seed in range(options.first, options.first + options.count):
            case = draw(seed)
            if case.model not in LAWS:
                continue
            case = in_modelica(case, library)
            answers = References(case)
            verdicts = {run: "no reference" for run in options.runs.split(",")}
            if answers.found:
                verdicts = {run: judge(case, answers, run, made) for run in verdicts}
            verdicts["other reference"] = compared(draw(seed), case)
            for run, verdict in verdicts.items():
                counts[run, verdict] += 1
                if verdict not in ("right", "warned"):
                    print(f"{seed:6d} {case.model:18s} {run:15s} {verdict}", flush=True)
    for (run, verdict), count in sorted(counts.items()):
        print(f"{run:15s} {verdict:15s} {count:5d}")
    return int(any(verdict == "WRONG" for _, verdict in counts))


def compared(other: Case, case: Case) -> str:
    """Return whether the reference of `coupling_search.py` agrees, also where the answer is sensitive."""
    try:
        right = case.solve(case.phases, 1.0, case.fine, 0)
    except FAILURES:
        return "rumoca fails"
    try:
        values = other.solve(other.phases, 1.0, case.fine, 0)
    except FAILURES:
        return "none"
    return "right" if fits(case, case.fine, values, right, 2.0 * case.step, AGREES) else "differs"


if __name__ == "__main__":
    sys.exit(main())
