"""Models of friction under load on a measured servo: errors of the simulated angle on records that were not fitted.

The twelve records in examples/identification/servo_pendulum are divided into three groups with each motion and each
gain; each group is predicted with what the other eight give, from its reference and its first angle. A model starts
from the values of a simpler one.

    python tests/slow/servo_pendulum.py [--groups 1 2 3] [--models M1 M3 ...]
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np

from friction_fmus.identification import ROTARY, Joint, JointIdentification, JointRecord, Record, identify_joint

DATA = Path(__file__).parents[2] / "examples" / "identification" / "servo_pendulum"
MASS, LENGTH, GRAVITY = 0.49, 0.1, 9.80665  # [kg], [m], [m/s2]
JOINT = Joint(MASS * LENGTH**2, MASS * LENGTH * GRAVITY)
COUNTS, DIVISOR, FULL = 4096.0, 256.0, 885.0  # encoder counts of a turn; duty cycle: counts * gain / 256 / 885

GROUPS = (
    ("kp100_sin_sin", "kp400_lift_and_drop", "kp800_up_and_down", "kp100_sin_time_square"),
    ("kp400_sin_sin", "kp800_lift_and_drop", "kp100_up_and_down", "kp400_sin_time_square"),
    ("kp800_sin_sin", "kp100_lift_and_drop", "kp400_up_and_down", "kp800_sin_time_square"),
)

#: Name, friction model, load, and the row whose values it starts from.
ROWS = (
    ("M1", "Stribeck", "M1", ""),
    ("M2", "Stribeck", "M2", "M1"),
    ("M3", "Stribeck", "M3", "M1"),
    ("M4", "Stribeck", "M4", "M3"),
    ("M5", "Stribeck", "M5", "M4"),
    ("M6", "Stribeck", "M6", "M5"),
    ("LuGre", "LuGre", "M1", "M1"),
    ("LuGre with M5", "LuGre", "M5", "M5"),
    ("GMS with M5", "GMS", "M5", "M5"),
)

#: Parameters that the authors published for another unit of this servo (repository `bam` of Rhoban).
PUBLISHED = {
    "M1": {"K": 0.3867, "R": 4.017, "inertia": 0.001814, "q0": 0.0, "base": 0.01283, "Fv": 0.003662},
    "M6": {
        **{"K": 0.3660, "R": 2.811, "inertia": 0.001808, "q0": 0.0, "base": 0.004771, "at_rest": 0.004676},
        **{"a_drive": 0.2668, "a_external": 8.5e-6, "b_drive": 1.1e-5, "b_external": 0.0808, "vs": 2.890},
        # quadratic terms: of the motor, if its torque is larger, and external
        **{"c_external": 0.00997, "c_drive": 0.00490, "delta": 8.683, "Fv": 0.005360},
    },
}


def record(name: str) -> JointRecord:
    """Read a record."""
    t, goal, q, _, _, volts, _, on = np.loadtxt(DATA / f"{name}.csv", delimiter=",", skiprows=1).T
    gain = float(name[2:5]) * COUNTS / (2.0 * pi) / DIVISOR / FULL
    return JointRecord(Record(name, t, q=q, reference=goal, units=ROTARY), volts, gain, on)


def published(load: str) -> JointIdentification:
    """Return the identification with published values."""
    empty = JointIdentification("Stribeck", load, {}, 0.0, 0.0, True, JOINT)
    return replace(empty, parameters={name: Given(value) for name, value in PUBLISHED[load].items()})  # type: ignore


class Given:
    """Value without an error."""

    def __init__(self, value: float) -> None:
        self.value = value


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--groups", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--models", nargs="+", default=[name for name, *_ in ROWS])
    options = parser.parse_args()
    records = {path.stem: record(path.stem) for path in sorted(DATA.glob("*.csv"))}
    for group in options.groups:
        held = [records[name] for name in GROUPS[group - 1]]
        fitted = [each for name, each in records.items() if name not in GROUPS[group - 1]]
        for load in PUBLISHED:
            print(f"group {group}: published {load}: predicted {published(load).error(held):.4f} rad", flush=True)
        values: dict[str, dict[str, float]] = {}
        for name, model, load, before in ROWS:
            if name not in options.models:
                continue
            found = identify_joint(fitted, JOINT, model=model, load=load, start=values.get(before))
            values[name] = found.values()
            end = "" if found.converged else ", not converged"
            shown = ", ".join(f"{key} {value:.3g}" for key, value in found.values().items())
            print(
                f"group {group}: {name}: fitted {found.rms:.4f}, predicted {found.error(held):.4f} rad; "
                f"{found.seconds:.0f} s{end}; {shown}",
                flush=True,
            )


if __name__ == "__main__":
    main()
