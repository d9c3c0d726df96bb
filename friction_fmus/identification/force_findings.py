"""Findings about a drive force that contradicts the motion: wrong sign, wrong unit, or no inertia force.

The force is fitted by F = M a + Fv v + Fc sgn(v) + OF, linear least squares without bounds, so that a wrong sign shows
as a negative mass and as friction that drives the axis. Identified masses do not show it: they are positive. The
gravity of an arm, G_sin sin(q) + G_cos cos(q), is part of the fit if it explains most of what is left without it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from friction_fmus.blocks.axis_units import AxisUnits, Words
from friction_fmus.errors import RecordError
from friction_fmus.identification.data.excitation import position_findings
from friction_fmus.identification.data.record import Array, Record, RecordFinding
from friction_fmus.identification.fit.contact_model import contact_model
from friction_fmus.identification.fit.first_look import solved
from friction_fmus.identification.fit.rests import unresolved_rest
from friction_fmus.identification.fit.scores import rms
from friction_fmus.identification.fit.simulation_data import prepare

NAMES: Final = ("M", "Fv", "Fc", "OF", "G_sin", "G_cos")  # coefficients of the columns of `DriveEquations`

MASSES: Final[Mapping[str, tuple[float, float]]] = {"m": (1e-6, 1e7), "rad": (1e-10, 1e7)}
"""Smallest and largest mass [kg] or moment of inertia [kg.m2] of a machine, by unit of the position."""

FORBIDDING: Final = (
    *("wrong-sign", "negative-mass", "driving-friction", "implausible-mass", "missing-force"),
    *("position-jumps", "position-clipped", "position-held", "force-clipped"),
    *("position-and-velocity-disagree", "implausible-motion"),
)
"""Findings after which identified parameters cannot be used."""

OUTSIDE: Final = 8.0  # number of robust standard deviations of the residual above which another force acts
MISSING: Final = 0.15  # fraction of the rms force above which a residual is another force

SWINGS: Final = 0.5  # residual with the gravity of an arm, relative to one without it, below which the axis is an arm

BESIDE: Final = 5
"""Number of decimated samples on either side of a reversal that are left out, and half of those at an end."""

PILED: Final = 0.005  # fraction of samples at exactly the largest or smallest force that may be clipped
FEW: Final = 10  # smallest number of such samples, after decimation, that are examined

VARIES: Final = 0.15
"""Deviation of the acceleration of such samples from a function of the velocity, relative to that of all samples."""

ITERATIONS: Final = 15  # iterations of the robust fit
SIGNIFICANT: Final = 3.0  # number of standard errors by which a negative mass must differ from zero

FALLING: Final = 0.2  # part of the top speed above which friction that falls has not left the Stribeck range
FALLEN, SURE = 0.05, 20.0  # fall over Coulomb friction that matters, and number of standard errors that make it sure
LATE: Final = 2.0  # delay of the force, which looks like viscous friction, that is allowed for [samples]
OPPOSED: Final = -0.9  # correlation of reference and position below which one of them has the wrong sign

DRIVING: Final = 0.02  # fraction of the mean power of the force with which friction drives an axis of wrong sign


@dataclass(frozen=True)
class DriveBalance:
    """Least squares of the drive force."""

    mass: float
    error: float
    """Mass and its standard error [kg or kg.m2]."""
    dissipated: float
    """Mean power of viscous and Coulomb friction over the mean magnitude of the power of the force without offset;
    negative if friction drives the axis."""


class DriveEquations(NamedTuple):
    """Filtered equations of the drive force of some records."""

    A: Array  # a, v, sgn(v), 1, and sin(q), cos(q) for an arm, shape (n, 4) or (n, 6)
    F: Array  # force
    t: Array  # time [s]
    ends: NDArray[np.bool_]  # which rows are ends of a record


def drive_balance(equations: DriveEquations) -> DriveBalance | None:
    """Fit mass and friction to the drive force."""
    A, F, *_ = equations
    found = solved(A, F, dict.fromkeys(NAMES[: A.shape[1]], "1"))
    if not found:
        return None
    v = A[:, 1]
    resting = A[:, 3:] @ [each.value for each in [*found.values()][3:]]
    power = float(np.mean(np.abs((F - resting) * v)))
    friction = float(np.mean((found["Fv"].value * v + found["Fc"].value * A[:, 2]) * v))
    return DriveBalance(found["M"].value, found["M"].standard_error, friction / power if power else 0.0)


def drive_equations(records: Sequence[Record]) -> DriveEquations | None:
    """Return the equations of the drive force; None without one, or if a record is too short for its filter."""
    rows, forces, times, ends = [], [], [], []
    for record in records:
        if record.force is None or record.friction is not None:
            return None
        try:
            segment = prepare(record, contact_model("Viscous", record.units), "force")
        except RecordError:
            return None
        assert segment.a is not None
        v = segment.inputs["v"]
        columns = [segment.a, v, np.sign(v), np.ones_like(v)]
        columns += [np.sin(record.q), np.cos(record.q)] if record.units.rotary and record.q is not None else []
        rows.append(segment.rows(np.column_stack(columns)))
        forces.append(segment.measured)
        times.append(segment.t)
        ends.append(np.minimum(np.arange(len(segment.t)), np.arange(len(segment.t))[::-1]) < 2 * BESIDE)
    A, F = np.concatenate(rows), np.concatenate(forces)
    scaled = A / np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    left = [rms(F - part @ np.linalg.lstsq(part, F, rcond=None)[0]) for part in (scaled[:, :4], scaled)]
    A = A if left[1] < SWINGS * left[0] else A[:, :4]
    return DriveEquations(A, F, np.concatenate(times), np.concatenate(ends))


def missing_force(equations: DriveEquations, u: Words) -> RecordFinding | None:
    """Return a finding if, in some intervals, the motion needs another force than the recorded one."""
    # Mass and friction are fitted robustly (Tukey's bisquare), so that these intervals do not count. Samples near a
    # reversal are left out, where a force that follows the sign of the velocity is smoothed by the filter.
    A, F, t, ends = equations
    if len(F) <= 2 * BESIDE + 1:  # too short to tell a disturbance from a reversal
        return None
    scaled = A / np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    weight = np.ones_like(F)
    for _ in range(ITERATIONS):
        root = np.sqrt(weight)
        rest = F - scaled @ np.linalg.lstsq(scaled * root[:, None], F * root, rcond=None)[0]
        core = max(float(np.median(np.abs(rest))) / 0.6745, 1e-12 * float(np.max(np.abs(F), initial=1e-300)))
        weight = np.square(np.maximum(1.0 - np.square(rest / (4.685 * core)), 0.0))
    v = A[:, 1]
    turns = np.append(v[1:] * v[:-1] <= 0.0, False) | (np.abs(v) < 0.02 * float(np.max(np.abs(v))))
    near = (np.convolve(turns, np.ones(2 * BESIDE + 1), "same") > 0.5) | ends
    level = rms(F)
    outside = (np.abs(rest) > max(OUTSIDE * core, MISSING * level)) & ~near
    starts = np.flatnonzero(np.diff(np.concatenate([[0], outside.astype(np.int8)])) == 1)
    if np.count_nonzero(outside) < 3 * len(starts) or not len(starts) or np.mean(outside) > 0.4:
        return None
    size = float(np.median(np.abs(rest[outside])))
    what = (
        f"In {len(starts)} intervals, the first one at {t[starts[0]]:.4g} s, the motion needs about {size:.3g} {u.N} "
        f"more or less than the recorded drive {u.force}."
    )
    change = f"Record the {u.force} that acts there and declare its column as injected, or choose windows without it."
    share = rms(np.where(outside, rest, 0.0)) / level
    return RecordFinding("missing-force" if share > 0.1 else "disturbed-force", what, change)


def clipped_force(records: Sequence[Record], equations: DriveEquations) -> RecordFinding | None:
    """Return a finding if the acceleration varies while the force has its largest value, at the same velocity."""
    # A drive that gives its largest force accelerates the axis by what friction leaves, a function of the velocity; a
    # measurement that is clipped does not.
    A, _, t, _ = equations
    force = np.concatenate([record.column("force") for record in records])
    at = np.concatenate([record.t for record in records])
    near = 1e-9 * float(np.max(np.abs(force)))
    for side in (1.0, -1.0):
        limit = side * force >= np.max(side * force) - near
        stuck = np.interp(t, at, limit.astype(float)) > 0.99
        alone = 2 * np.count_nonzero(limit[1:] & limit[:-1]) < np.count_nonzero(limit[:-1])
        if np.mean(limit) < PILED or alone or np.count_nonzero(stuck) < FEW:
            continue
        a, rest = A[stuck, 0], A[stuck, 1:] / np.maximum(np.linalg.norm(A[stuck, 1:], axis=0), 1e-300)
        varies = float(np.std(a - rest @ np.linalg.lstsq(rest, a, rcond=None)[0]))
        if varies > VARIES * float(np.std(A[:, 0])):
            u = records[0].units.words
            what = (
                f"{100 * np.mean(limit):.2g} % of the samples have exactly the {u.force} {force[limit][0]:.4g} {u.N}, "
                f"but their acceleration varies by {varies:.3g} {records[0].units.velocity}/s at the same velocity; "
                f"the {u.force} is clipped."
            )
            return RecordFinding("force-clipped", what, f"Record the whole {u.force}, or choose windows without it.")
    return None


def falling_friction(equations: DriveEquations, record: Record) -> RecordFinding | None:
    """Return a finding if the friction falls up to the largest speed, so that its viscous part is not determined."""
    speed, units = np.abs(equations.A[:, 1]), record.units
    top = float(np.max(speed))
    fast = (speed > FALLING * top) & ~equations.ends
    A = equations.A[fast]
    found = solved(A, equations.F[fast], dict.fromkeys(NAMES[: A.shape[1]], "1"))
    if not found:
        return None
    (M, Fv, Fc), error = (found[name].value for name in ("M", "Fv", "Fc")), found["Fv"].standard_error
    late = LATE * record.Ts * abs(M) * float(np.mean(A[:, 0] ** 2) / np.mean(A[:, 1] ** 2))
    if -Fv < SURE * error + late or not 0.0 < FALLEN * Fc < -Fv * top:
        return None
    what = (
        f"The friction falls up to the largest speed, {top:.3g} {units.velocity}, as in the Stribeck range: least "
        f"squares above {FALLING * top:.2g} {units.velocity} give Fv = {Fv:.3g} ± {error:.2g} {units.viscous}. The "
        "record does not determine viscous and Coulomb friction, however small their intervals."
    )
    change = "Record faster strokes, too, at which the friction grows with the speed, or give Fv as fixed."
    return RecordFinding("stribeck-range-not-left", what, change)


def opposed_reference(record: Record) -> tuple[RecordFinding, ...]:
    """Return the finding that the reference moves against the position, if it does."""
    q, r = record.q, record.reference
    if q is None or r is None or not np.ptp(q) or not np.ptp(r) or np.corrcoef(q, r)[0, 1] > OPPOSED:
        return ()
    what = "The reference moves against the position; one of them has the wrong sign."
    change = "Set sign = -1 for the reference in [columns], or for position and force, whichever is inverted."
    return (RecordFinding("reference-opposed", what, change),)


def stuck(records: Sequence[Record]) -> RecordFinding | None:
    """Return a finding about rests in which the drive force changes although the position does not."""
    if any(record.force is None or record.friction is not None for record in records):
        return None
    share = float(np.mean(np.concatenate([unresolved_rest(record) for record in records])))
    if share == 0.0:
        return None
    u = records[0].units.words
    what = (
        f"In {100.0 * share:.2g} % of the samples the axis sticks: the {u.force} changes and the position does not, "
        "within the resolution. The models are fitted to the other samples."
    )
    change = "Record slow motion with a finer position, if presliding matters."
    return RecordFinding("presliding-not-resolved", what, change)


def contradictions(records: Sequence[Record]) -> tuple[RecordFinding, ...]:
    """Return findings about a motion that no axis makes, and a force that no mass with friction needs for it."""
    about_position = (*position_findings(records), *opposed_reference(max(records, key=len)))
    equations = drive_equations([record.without_load() for record in records])
    balance = None if equations is None else drive_balance(equations)
    if equations is None or balance is None:
        return about_position
    about_force = (
        missing_force(equations, records[0].units.words),
        clipped_force(records, equations),
        falling_friction(equations, records[0]),
    )
    about_mass = _about_mass(balance, records[0].units)
    return (*about_position, *about_mass, *(each for each in about_force if each is not None))


def _about_mass(balance: DriveBalance, units: AxisUnits) -> tuple[RecordFinding, ...]:
    """Return the finding about sign and size of mass and friction."""
    u = units.words
    low, high = MASSES[units.position] if units.known else (0.0, np.inf)
    shown = f"{balance.mass:.3g} ± {balance.error:.2g} {u.kg}"
    fits = f"{u.a_mass} of {shown}"
    negative = balance.mass < -SIGNIFICANT * balance.error
    driving = balance.dissipated < -DRIVING
    if negative and driving:
        what = f"The drive {u.force} has the wrong sign: it fits {fits}, and friction that drives the axis."
        return (RecordFinding("wrong-sign", what, f"Set sign = -1 for the {u.force} in [columns]."),)
    if negative:
        what = f"The drive {u.force} fits {fits}, which is negative."
        change = (
            f"Check units and times of {u.force} and position; a spring or a load that depends on position does the "
            "same."
        )
        return (RecordFinding("negative-mass", what, change),)
    if driving:
        what = (
            f"Friction would drive the axis: its power is {100.0 * balance.dissipated:.3g} % of the power of the drive."
        )
        change = f"Check the sign of the {u.force}, and that {u.force} and position are logged in the same sample."
        return (RecordFinding("driving-friction", what, change),)
    if balance.mass < balance.error:
        what = f"The record does not determine the {u.mass} ({shown})."
        return (RecordFinding("mass-not-identified", what, f"Record faster motion, or give the {u.mass}."),)
    if not low <= balance.mass <= high:
        what = f"The drive {u.force} fits {fits}; machines have {low:g} to {high:g} {u.kg}."
        return (RecordFinding("implausible-mass", what, f"Correct the unit of the {u.force} or of the position."),)
    return ()
