"""Comparison of a study with a record that was taken with its recommendation."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from friction_fmus.axis.servo import Servo
from friction_fmus.errors import FrictionError
from friction_fmus.identification import Record
from friction_fmus.identification.fit.first_look import first_look
from friction_fmus.identification.fit.scores import rms

TRUE: Final = 0.15  # relative difference of claimed and measured error up to which the claim came true
CHANGED: Final = 0.1  # relative change of mass or friction that is named
SURE: Final = 3.0  # number of standard errors of a change that is named
MOVING: Final = 0.3  # part of the largest reference speed above which the axis slides
INVERTED: Final = 1.3  # friction that the servo sees, divided by that of the axis, above which the sign is wrong
ABSENT: Final = 0.7  # the same above which the compensation does not act


@dataclass(frozen=True)
class Verification:
    """Claimed and measured error of a law."""

    name: str  # recommended compensator
    claimed: float
    measured: float
    """Tracking error, rms, of the study and of the record, in `unit`."""
    unit: str  # unit of position of the axis
    reasons: tuple[str, ...]  # what differs between the record and the study, a sentence each

    @property
    def came_true(self) -> bool:
        """Whether the measured error is at most `TRUE` above the claimed one."""
        return self.measured <= (1.0 + TRUE) * self.claimed


def verify(folder: Path, records: Sequence[Record], servo: Servo | None = None) -> Verification:
    """Compare the claim of a study with a record taken with the recommended law."""
    try:
        study = json.loads((folder / "study.json").read_text(encoding="utf-8"))
        name = str(study["recommendation"]["name"])
        rows = {row["name"]: row for row in study["compensators"]}
        claimed = float(rows[name]["metrics"]["rms"])
        unit = str(study["units"]["position"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FrictionError(
            f"{folder} has no study with a recommended compensator; run friction-fmus study with -o {folder} first."
        ) from error
    errors = [
        record.reference - record.q for record in records if record.reference is not None and record.q is not None
    ]
    if not errors:
        raise FrictionError("The record has no reference or no position, so that its tracking error is unknown.")
    if unit != records[0].units.position:
        raise FrictionError(
            f"The record has its position in {records[0].units.position}, the study in {unit}; correct the units of "
            "the columns."
        )
    measured = rms(np.concatenate(errors))
    before = next((row for row in study["models"] if row["name"].startswith("Coulomb + viscous")), None)
    known = {} if before is None else {p["name"]: float(p["value"]) for p in before["parameters"]}
    reasons = (*_changes(records, known), *_direction(records, servo, known))
    return Verification(name, claimed, measured, unit, tuple(reasons))


def _changes(records: Sequence[Record], known: Mapping[str, float]) -> Iterator[str]:
    """Yield the changes of mass and friction."""
    words = {"M": "The {mass}", "Fc": "Coulomb friction", "Fv": "Viscous friction"}
    for name, now in first_look(records).items():
        old = known.get(name)
        if name not in words or not old:
            continue
        change = now.value / old - 1.0
        if abs(change) > CHANGED and abs(now.value - old) > SURE * now.standard_error:
            what = words[name].format(mass=records[0].units.words.mass)
            yield (
                f"{what} is {100.0 * abs(change):.0f} % {'higher' if change > 0.0 else 'lower'} than in the study: "
                f"{now.value:.4g} instead of {old:.4g} {now.unit}. Repeat the study with this record."
            )


def _direction(records: Sequence[Record], servo: Servo | None, known: Mapping[str, float]) -> Iterator[str]:
    """Yield what the part of the error that follows the direction of motion says of the compensation."""
    # In slow motion, a servo without integral action needs the error F/Kp for a force F that nothing compensates.
    if servo is None or servo.pid[2] or not known.get("Fc"):
        return
    columns, errors = [], []
    for record in records:
        if record.reference is None or record.q is None:
            continue
        rd = np.gradient(record.reference, record.Ts)
        rows = np.column_stack([np.sign(rd), rd, np.ones_like(rd)])  # without feedforward of rd, e is rd Kd/Kp
        moving = np.abs(rd) > MOVING * float(np.max(np.abs(rd)))
        columns.append(rows[moving])
        errors.append((record.reference - record.q)[moving])
    A, e = np.concatenate(columns), np.concatenate(errors)
    length = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    part = float((np.linalg.lstsq(A / length, e, rcond=None)[0] / length)[0]) * servo.pid[0] / known["Fc"]
    if part > INVERTED:
        yield (
            f"The servo works against {part:.2g} times the friction of the axis: the compensation has the wrong sign. "
            "Change its sign, or that of its velocity."
        )
    elif part > ABSENT:
        yield f"The servo works against {part:.2g} times the friction of the axis: the compensation does not act."
