"""Simulated arms with and without load, direction, gravity and drift in their friction: truth against identified.

Each arm follows a sum of sines under a PD servo. The terms are chosen by cross-validation.

    python tests/slow/axes_under_load.py [--axes 30] [--model Stribeck]
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from friction_fmus.identification import identify

sys.path.insert(0, str(Path(__file__).parents[1] / "identification"))
from arms import drawn, moved

HALF = 1.645  # half of an interval of 90 %, over the standard error


def main() -> None:
    """Print a line for each axis, and the sums."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--axes", type=int, default=30)
    parser.add_argument("--model", default="Stribeck")
    options = parser.parse_args()
    inside = counted = false = missed = there = absent = 0
    for number in range(options.axes):
        arm = drawn(number)
        found = identify(options.model, moved(arm, number), terms="auto")
        # a difference of the directions is an offset, unless the level of the friction changes
        if not (arm.a or arm.drift):
            arm = replace(arm, OF=arm.OF + arm.Fc * arm.direction, direction=0.0)
        names = ("M", "Fc", "Fv", "OF", "G_sin", "G_cos", "a", "direction", "drift")
        row = []
        for name in names:
            true, estimate = getattr(arm, name), found.parameters.get(name)
            if name not in ("M", "Fc", "Fv", "OF", "G_cos"):
                there, absent = there + (true != 0.0), absent + (true == 0.0)
                false += estimate is not None and true == 0.0
                missed += estimate is None and true != 0.0
            if estimate is not None:
                covered = abs(estimate.value - true) <= HALF * estimate.standard_error
                inside, counted = inside + covered, counted + 1
                row.append(f"{name} {estimate.value:.4g} ({true:.4g}{'' if covered else ', outside'})")
            elif true != 0.0:
                row.append(f"{name} missed ({true:.4g})")
        print(f"{number:3d} {found.train.relative_percent:.2f} %: {', '.join(row)}", flush=True)
    print(
        f"{inside} of {counted} intervals of 90 % contain the truth; {false} of {absent} absent terms found, ", end=""
    )
    print(f"{missed} of {there} missed")


if __name__ == "__main__":
    main()
