"""Columns of a data file found by physics: names and units propose, the motion decides, and doubt is asked about."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations
from typing import Final

import numpy as np

from friction_fmus.identification.data.column_headings import TIMES, ColumnMeaning, about, epoch_unit
from friction_fmus.identification.data.mapping import UNKNOWN, Column, axis_of
from friction_fmus.identification.data.motion_tests import (
    DERIVATIVE,
    MOST,
    SAME,
    DriveShare,
    SampledColumns,
    longest_run,
    without_gaps,
    without_jumps,
)
from friction_fmus.identification.data.record import Array, RecordFinding, axis_units, factor, fits, unit_of
from friction_fmus.identification.data.tables import DataTable
from harness.units import BaseUnit

EXPLAINED: Final = 0.5, 0.7  # least share of the variance of a drive signal with and without a name
CLEARER: Final = 2.0  # ratio of what is left unexplained above which the better of two guesses is clear
SLOWEST: Final = {"s": 2.0, "ms": 10.0, "us": 10.0, "ns": 10.0}  # sample rates [Hz]; a computer polls slowly, in s
FASTEST: Final = 5e4  # sample rate of an axis; a time without unit is only read if one unit leads to such rates [Hz]
EVEN: Final = 0.1  # share of the samples below which the longest run of equal intervals says too little about them
LATE: Final = 0.3  # share of the difference of two signals that a lag explains if one is the command of the other
CLOSE: Final = 0.03  # relative difference of a factor between two columns that rounding and noise can cause
CERTAIN: Final = 0.995  # correlation with a derivative that no force has, in spite of inertia
DERIVED: Final = "actual position"  # heading of a position computed from reference and error
UNNAMED: Final = 40  # most columns without a name that are tried


@dataclass(frozen=True)
class MotionColumns:
    """Columns that describe the motion of one axis."""

    position: str
    velocity: str
    axis: str = ""
    slope: float = 0.0  # velocity over derivative of the position, in the units of the file
    correlation: float = 0.0

    @property
    def main(self) -> str:
        """Column that identifies the motion."""
        return self.position or self.velocity


@dataclass(frozen=True)
class ForceFit:
    """A motion, the force that it explains, and how well."""

    motion: MotionColumns
    force: str
    drive: DriveShare


@dataclass(frozen=True)
class ColumnCandidate:
    """A mapping that fits, with its reasons."""

    columns: Mapping[str, Column]
    reasons: Mapping[str, str] = field(default_factory=dict)  # by role


@dataclass(frozen=True)
class Guessed:
    """Mappings that agree with names, units and physics."""

    candidates: tuple[ColumnCandidate, ...]
    problems: tuple[str, ...] = ()  # why none of them is used; empty if the only one is
    notes: tuple[str, ...] = ()  # what else was found


class Guesser:
    """Search of the columns of a table; columns that are given are not searched."""

    def __init__(self, table: DataTable, given: Mapping[str, Column] | None = None) -> None:
        self.table, self.given = table, dict(given or {})
        self.about: dict[str, ColumnMeaning] = {}
        self.problems: list[str] = []
        self.notes: list[str] = []
        for name, values in table.columns.items():
            finite = values[np.isfinite(values)]
            if len(finite) > 0.5 * len(values) and np.ptp(finite) > 0.0:
                self.about[name] = about(name, table.units.get(name, ""))
        for role, column in self.given.items():
            kind = {"reference": "position"}.get(role, role)
            if role != "reference":
                self.about = {
                    name: ColumnMeaning("other") if each.kind == kind and not each.qualifier else each
                    for name, each in self.about.items()
                }
            if column.column in table.columns:
                self.about[column.column] = ColumnMeaning(
                    kind, role if role == "reference" else "", "", column.unit, True
                )

    def guess(self) -> Guessed:
        """Return the mappings that fit."""
        clock = self._clock() if self.about else None
        if clock is None:
            return Guessed((), tuple(self.problems) or ("no column has numbers that change",))
        rows = len(next(iter(self.table.columns.values()), ()))
        t = without_jumps(self.table.columns[clock]) if clock else np.arange(float(rows))
        run = longest_run(t)
        names = [name for name, each in self.about.items() if name != clock and each.kind not in ("time", "other")]
        steps = np.diff(t[:MOST])
        uneven = len(t[run]) < EVEN * len(t[:MOST]) and bool(steps.min() > 0.0 and steps.max() < 20.0 * steps.mean())
        part = slice(0, MOST) if uneven else run
        dt = float(np.ptp(t[part])) / max(len(t[part]) - 1, 1)  # stamps that jitter have another median
        values = {name: without_gaps(self.table.columns[name][part]) for name in names}
        if uneven:
            values = {name: np.interp(t[0] + dt * np.arange(len(v)), t[part], v) for name, v in values.items()}
        self.data = SampledColumns(values, dt)
        names = self._without_copies(names)
        motions = self._motions(names)
        every = [fit for motion in motions for fit in self._fits(motion, names)]
        fits_found = self._decided(every)
        if not motions:
            self.problems.append("no column is recognised as a position or velocity")
        elif not fits_found:
            moved = " or ".join(list(dict.fromkeys(repr(motion.main) for motion in motions))[:3])
            named = [fit for fit in every if (each := self.about[fit.force]).named and each.axis == fit.motion.axis]
            if named:
                self.problems.append(f"no force, torque or current explains half of the motion of {moved}")
                fits_found = sorted(named, key=lambda fit: fit.drive.share, reverse=True)
            else:
                self.problems.append(f"no column is recognised as the force, torque or current that moves {moved}")
                fits_found = [ForceFit(motion, "", DriveShare(0.0, 0.0, False)) for motion in motions[:3]]
        candidates = []
        for fit in fits_found:
            for time in self._times(clock, fit.motion):
                candidates.append(self._candidate(time, fit))
        if len(candidates) > 1 and not self.problems:
            self.problems.append("more than one mapping fits")
        return Guessed(tuple(candidates), tuple(self.problems), tuple(self.notes))

    # time ------------------------------------------------------------------------------------------------------------

    def _clock(self) -> str | None:
        """Return the column of the time; empty if the file states its sample time, None if neither is known."""
        if "time" in self.given:
            return self.given["time"].column
        named = [*self.table.clocks] or [name for name, each in self.about.items() if each.kind == "time"]
        found = [name for name in named if name in self.table.columns and _increases(self.table.columns[name])]
        if not found and self.table.period <= 0.0:
            free = [name for name, each in self.about.items() if not each.kind]
            found = [name for name in free if _increases(self.table.columns[name], even=True)]
        found = [name for name in found if not self._is_counter(name, found)]
        distinct = [name for i, name in enumerate(found) if not any(self._ticks(name, each) for each in found[:i])]
        united = [name for name in distinct if self.about[name].unit or name in self.table.clocks]
        if len(united) == 1 and len(distinct) > 1:
            self.notes.append(f"other times, not used: {', '.join(repr(n) for n in distinct if n not in united)}")
            distinct = united
        if len(distinct) == 1:
            return distinct[0]
        if distinct:
            self.problems.append(f"{' and '.join(map(repr, distinct))} could both be the time")
            return None
        if self.table.period > 0.0:
            return ""
        self.problems.append("no column is recognised as the time; state the sample time, such as period=1 ms")
        return ""

    def _ticks(self, name: str, other: str) -> bool:
        """Return whether two times in one unit never differ by more than a sample."""
        t, same = self.table.columns[other], self.table.units.get(name) == self.table.units.get(other)
        late = np.abs(self.table.columns[name] - t)
        return same and bool(np.nanmax(late) <= np.nanmedian(np.diff(t)))

    def _is_counter(self, name: str, found: Sequence[str]) -> bool:
        """Return whether a column counts the rows beside another column that is a time."""
        steps = np.diff(self.table.columns[name])
        return len(found) > 1 and bool(np.all(steps == 1.0)) and not self.about[name].unit

    def _times(self, clock: str, motion: MotionColumns) -> list[tuple[Column, str]]:
        """Return the mappings of the time with their reasons; several if its unit is open."""
        if "time" in self.given:
            return [(self.given["time"], "as given")]
        if not clock:
            period = self.table.period
            text = f"{period:.9g} s" if period > 0.0 else "?"
            return [(Column("", period=text), "sample time that the file states" if period > 0.0 else "sample time")]
        unit = self.about[clock].unit or self.table.units.get(clock, "") or epoch_unit(self.table.columns[clock])
        if unit_of(unit) is not None and fits("time", unit_of(unit) or BaseUnit()):
            return [(Column(clock, unit), "")]
        dt = self.data.dt
        if self.table.period > 0.0:
            by_period = [name for name, each in TIMES.items() if abs(dt * each / self.table.period - 1.0) < CLOSE]
            if by_period:
                return [(Column(clock, by_period[0]), f"in {by_period[0]}, as the file states its sample time")]
        usual = [name for name, each in TIMES.items() if SLOWEST[name] <= 1.0 / (dt * each) <= FASTEST]
        agreeing = [name for name in TIMES if self._agrees(motion, TIMES[name])]
        known = unit_of(self.about[motion.position].unit) if motion.slope else None
        if len(agreeing) == 1 and (agreeing == usual or (known is not None and agreeing[0] in usual)):
            why = "so that the velocity is that of the position"
            if not self.about[motion.position].unit:
                turn = 2.0 ** round(math.log2(60.0 / (motion.slope * TIMES[agreeing[0]])))
                why = f"with which {motion.velocity!r} is in rpm at {turn:.0f} counts a turn"
            return [(Column(clock, agreeing[0]), f"has no unit; taken as {agreeing[0]}, {why}")]
        if len(usual) == 1 and (self.about[clock].named or abs(motion.slope - 1.0) < CLOSE):
            rate = 1.0 / (dt * TIMES[usual[0]])
            return [(Column(clock, usual[0]), f"has no unit; only {usual[0]} gives a usual sample rate, {rate:.4g} Hz")]
        self.problems.append(f"the time {clock!r} has no unit")
        counter = not self.about[clock].named and bool(np.all(np.diff(self.table.columns[clock]) == 1.0))
        return [(Column(clock, name), "") for name in (["?"] if counter else usual or TIMES)]

    def _agrees(self, motion: MotionColumns, seconds: float) -> bool:
        """Return whether velocity and position agree if the time is in this unit."""
        if not motion.slope:
            return False
        p, v = (unit_of(self.about[name].unit) for name in (motion.position, motion.velocity))
        if p is not None and v is not None and fits("position", p) and fits("velocity", v):
            return abs(motion.slope * v.factor * seconds / p.factor - 1.0) < CLOSE
        turn = 60.0 / (motion.slope * seconds)  # counts of a turn if the velocity is in rpm
        return turn > 200.0 and abs(turn / 2.0 ** round(math.log2(turn)) - 1.0) < 0.003

    # motion ----------------------------------------------------------------------------------------------------------

    def _named(self, names: Sequence[str], kind: str, qualifiers: Sequence[str] = ("", "actual")) -> list[str]:
        """Return the columns of a kind: those with a name, or otherwise those with a unit."""
        found = [name for name in names if self.about[name].kind == kind and self.about[name].qualifier in qualifiers]
        named = [name for name in found if self.about[name].named] or found
        actual = {self.about[name].axis for name in named if self.about[name].qualifier == "actual"}
        return [n for n in named if self.about[n].qualifier == "actual" or self.about[n].axis not in actual]

    def _without_copies(self, names: Sequence[str]) -> list[str]:
        """Return the columns without those that repeat another one; columns with a name are kept."""
        kept: list[str] = []
        for name in sorted(names, key=lambda each: not self.about[each].named):
            if not any(np.array_equal(self.data.values[name], self.data.values[other]) for other in kept):
                kept.append(name)
        return [name for name in names if name in kept]

    def _motions(self, names: Sequence[str]) -> list[MotionColumns]:
        """Return the motions in a file."""
        positions, velocities = self._named(names, "position"), self._named(names, "velocity")
        if not positions and not velocities:
            positions = velocities = [name for name in names if not self.about[name].kind][:UNNAMED]
        free = positions is velocities
        found = []
        followed: set[str] = set()
        for p in positions:
            others = [v for v in velocities if v != p]
            axis = self.about[p].axis
            scores = dict(zip(others, self.data.derivatives(p, others), strict=True))
            own = {v: each for v, each in scores.items() if axis and self.about[v].axis == axis and not free} or scores
            best = max(own, key=lambda v: own[v][0], default="")
            followed |= {v for v, (r, _) in scores.items() if r > 0.8 and not free}
            if best and own[best][0] >= DERIVATIVE:
                found.append(MotionColumns(p, best, axis, own[best][1], own[best][0]))
            elif not free or not scores:
                found.append(MotionColumns(p, "", axis))
            if free:
                found += [MotionColumns(p, "", axis), MotionColumns("", p, axis)]
        if not free:
            found += [MotionColumns("", v, self.about[v].axis) for v in velocities if v not in followed]
        pairs = [motion for motion in found if motion.correlation > CERTAIN]
        if free and pairs:  # other columns may be the same motion, but no motion of their own
            found = [m for m in found if any(m is p or abs(self._together(m, p)) > SAME for p in pairs)]
        return list(dict.fromkeys(found))

    def _fits(self, motion: MotionColumns, names: Sequence[str]) -> list[ForceFit]:
        """Return the forces that a motion may explain."""
        left = [name for name in names if name not in (motion.position, motion.velocity)]
        forces = self._named(left, "force") or self._named(left, "force", ("reference",))
        named = bool(forces)
        if not named:
            forces = [name for name in left if not self.about[name].kind][:UNNAMED]
        own = [name for name in forces if motion.axis and self.about[name].axis == motion.axis]
        if named and own and len({self.about[name].axis for name in forces}) > 1:
            forces = own
        drives = self.data.explained(motion.position, motion.velocity, forces)
        found = [ForceFit(motion, name, drive) for name, drive in zip(forces, drives, strict=True)]
        if named:
            return found
        return [fit for fit in found if fit.drive.share >= EXPLAINED[1] and fit.drive.right and fit.drive.friction]

    # decision --------------------------------------------------------------------------------------------------------

    def _decided(self, fits_found: Sequence[ForceFit]) -> list[ForceFit]:
        """Return the fit to use, or several between which physics does not decide."""
        pairs = [fit.motion for fit in fits_found if fit.motion.correlation > CERTAIN]
        paired = {name for motion in pairs for name in (motion.position, motion.velocity)}  # what moves is no force
        good = [fit for fit in fits_found if fit.drive.share >= EXPLAINED[0] and fit.force not in paired]
        if not good:
            return list(fits_found) if len(fits_found) == 1 else []
        by_force: dict[str, list[ForceFit]] = {}
        for fit in good:
            by_force.setdefault(fit.force, []).append(fit)
        chosen = [fit for fits_of in by_force.values() for fit in self._best_motions(fits_of)]
        by_motion: dict[str, list[ForceFit]] = {}
        for fit in chosen:
            by_motion.setdefault(fit.motion.main, []).append(fit)
        chosen = [fit for fits_of in by_motion.values() for fit in self._best_forces(fits_of)]
        axes = list(dict.fromkeys(fit.motion.main for fit in chosen))
        if len(axes) < 2 or len(chosen) > len(axes) or len({self.about[name].unit for name in axes}) > 1:
            return chosen
        if len({fit.force for fit in chosen}) < len(chosen) or any(
            abs(self._together(chosen[0].motion, fit.motion)) > SAME for fit in chosen[1:]
        ):
            return chosen
        plain = [fit for fit in chosen if not fit.motion.axis]
        widest = max(
            plain if len(plain) == 1 else chosen,
            key=lambda fit: float(np.ptp(without_jumps(self.data.values[fit.motion.main]))),
        )
        rest = ", ".join(f"{fit.motion.main!r} with {fit.force!r}" for fit in chosen if fit is not widest)
        why = "has no number" if len(plain) == 1 else "moves furthest"
        self.notes.append(f"{widest.motion.main!r} {why}; other axes, not used: {rest}")
        return [widest]

    def _best_motions(self, fits_of: Sequence[ForceFit]) -> list[ForceFit]:
        """Return the motion that explains a force best, and those that explain it about as well."""
        best = max(fits_of, key=lambda fit: (fit.drive.share, bool(fit.motion.velocity)))
        close = [fit for fit in fits_of if _left(fit) < CLEARER * _left(best)]
        whole = [fit for fit in close if fit.motion.position and fit.motion.velocity]
        # a part of a motion is not another motion
        parts = {part for fit in whole for part in (("", fit.motion.velocity), (fit.motion.position, ""))}
        close = [fit for fit in close if (fit.motion.position, fit.motion.velocity) not in parts]
        kept = list(close)
        for fit, other in permutations(close, 2):
            a, b = fit.motion, other.motion
            both = fit in kept and other in kept and a.position and b.position
            if both and abs(self._together(a, b)) > SAME and self._leads(a.position, b.position):
                kept.remove(fit)
                self.notes.append(f"{a.main!r} leads {b.main!r}: it is the reference")
        return kept

    def _best_forces(self, fits_of: Sequence[ForceFit]) -> list[ForceFit]:
        """Return the force of a motion: in a unit of force, then a current, then others; several if that is open."""
        first = min(self._rank(fit.force) for fit in fits_of)
        ranked = [fit for fit in fits_of if self._rank(fit.force) == first]
        best = max(ranked, key=lambda fit: fit.drive.share)
        close = [fit for fit in ranked if _left(fit) < CLEARER * _left(best) or not self.about[fit.force].kind]
        kept = list(close)
        for fit, other in permutations(close, 2):
            a, b = fit.force, other.force
            both = fit in kept and other in kept and self.about[a].kind and self.about[b].kind
            if both and abs(self.data.same(a, b)) > SAME and self._leads(a, b):
                kept.remove(fit)
        unused = [fit.force for fit in fits_of if fit not in kept]
        if unused and len(kept) == 1:
            self.notes.append(f"other signals of the drive, not used: {', '.join(map(repr, dict.fromkeys(unused)))}")
        return kept

    def _leads(self, a: str, b: str) -> bool:
        """Return whether column b lags behind column a, as an actual value does behind its reference."""
        late, share = self.data.lag(a, b)
        return share > LATE and late > 0.02

    def _rank(self, name: str) -> int:
        """Return the order in which signals of a drive are preferred."""
        unit = unit_of(self.about[name].unit)
        if unit is None or not self.about[name].unit:
            return 2
        if fits("force", unit):
            return 0
        exponents = [known.exponents for known in map(unit_of, ("A", "V")) if known is not None]
        return {0: 1, 1: 3}.get(exponents.index(unit.exponents) if unit.exponents in exponents else 2, 2)

    def _together(self, a: MotionColumns, b: MotionColumns) -> float:
        """Return the correlation of two velocities."""
        x, y = (
            self.data.smooth([motion.velocity or motion.position], 2.0, 0 if motion.velocity else 1)[:, 0]
            for motion in (a, b)
        )
        return float(np.corrcoef(x, y)[0, 1]) if np.ptp(x) and np.ptp(y) else 0.0

    # mapping ---------------------------------------------------------------------------------------------------------

    def _candidate(self, time: tuple[Column, str], fit: ForceFit) -> ColumnCandidate:
        """Return the mapping of a guess, with its reasons."""
        column, why = time
        columns, reasons = {"time": column}, {"time": why}
        seconds = unit_of(column.unit) or BaseUnit()
        columns |= self._motion_columns(fit.motion, 1.0 if column.period else seconds.factor, reasons)
        if fit.force:
            own, main = unit_of(self.about[fit.force].unit), "position" if "position" in columns else "velocity"
            known = columns[main].gain != UNKNOWN
            valid = own is not None and known and factor("force", own, axis_of(columns)) is not None
            free = own is not None and not known and fits("force", own)
            unit = self.about[fit.force].unit
            columns["force"] = Column(fit.force, unit if unit else "1", "" if valid or free else UNKNOWN)
            reasons["force"] = (
                f"explains the motion: {100.0 * fit.drive.share:.0f} % of its variance by inertia, direction and speed"
            )
        for role, given in self.given.items():
            columns[role] = given
        return ColumnCandidate(columns, reasons)

    def _motion_columns(self, motion: MotionColumns, seconds: float, reasons: dict[str, str]) -> dict[str, Column]:
        """Return the columns of position, velocity and reference."""
        p, v = (unit_of(self.about[name].unit) if name else None for name in (motion.position, motion.velocity))
        columns: dict[str, Column] = {}
        speed = v is not None and fits("velocity", v)
        if not motion.position:
            unit = self.about[motion.velocity].unit
            return {"velocity": Column(motion.velocity, unit if unit else "1", "" if speed else UNKNOWN)}
        unit = self.about[motion.position].unit
        if motion.velocity:
            speed_unit = self.about[motion.velocity].unit
            per = f" {speed_unit} per {unit}/s" if unit and speed_unit else " times"
            reasons["position"] = (
                f"its derivative matches {motion.velocity!r} (correlation {motion.correlation:.4f}, "
                f"{motion.slope * seconds:.3g}{per})"
            )
        if p is not None and fits("position", p):
            columns["position"] = Column(motion.position, unit)
            if v is not None and speed and abs(motion.slope * v.factor * seconds / p.factor - 1.0) < CLOSE:
                columns["velocity"] = Column(motion.velocity, self.about[motion.velocity].unit)
        elif v is not None and speed:
            step = motion.slope * v.factor * seconds  # [m or rad]
            axis = axis_units("velocity", v)
            turn = 2.0 * math.pi / step
            whole = 2.0 ** round(math.log2(abs(turn))) if turn > 0.0 else 0.0
            whole = whole if abs(turn / (whole or 1.0) - 1.0) < 0.01 else float(f"{turn:.6g}")
            if axis is not None and axis.rotary and turn > 0.0:
                columns["position"] = Column(motion.position, "1", f"{1.0 / whole:.12g} rev")
                reasons["position"] += f": {whole:.6g} {unit or 'units'} a turn"
            elif axis is not None:
                columns["position"] = Column(motion.position, "1", f"{step:.6g} m")
            columns["velocity"] = Column(motion.velocity, self.about[motion.velocity].unit)
        else:
            columns["position"] = Column(motion.position, unit if unit else "1", UNKNOWN)
        self._reference(motion, columns)
        return columns

    def _reference(self, motion: MotionColumns, columns: dict[str, Column]) -> None:
        """Add the reference of the position."""
        found = [
            name
            for name in self._named([*self.data.values], "position", ("reference",))
            if self.about[name].axis in (motion.axis, "")
            and self.about[name].unit == self.about[motion.position].unit
            and self.data.same(name, motion.position) > 0.8
        ]
        if len(found) == 1:
            given = columns["position"]
            columns["reference"] = Column(found[0], given.unit, given.gain)


def with_actual_position(table: DataTable) -> DataTable:
    """Return the table with the position that a reference and a following error give, if it has no other."""
    # The error is added or subtracted so that the position lags behind the reference.
    kinds = {name: about(name, table.units.get(name, "")) for name in table.columns}
    signals = {
        qualifier: [name for name, each in kinds.items() if (each.kind, each.qualifier) == ("position", qualifier)]
        for qualifier in ("", "actual", "reference", "error")
    }
    if signals[""] or signals["actual"] or len(signals["reference"]) != 1 or len(signals["error"]) != 1:
        return table
    (r,), (e,) = signals["reference"], signals["error"]
    if kinds[r].unit != kinds[e].unit or not kinds[r].unit or any(each.kind == "velocity" for each in kinds.values()):
        return table
    reference, error = (without_gaps(table.columns[name][: 4 * MOST]) for name in (r, e))
    data = SampledColumns({"r": reference, "-": reference - error, "+": reference + error}, 1.0)
    late = {sign: data.lag("r", sign) for sign in "-+"}
    sign = max(late, key=lambda each: late[each][0])
    if late[sign][0] <= 0.0 or late[sign][1] < LATE:
        return table
    values = table.columns[r] + (-1.0 if sign == "-" else 1.0) * table.columns[e]
    what = f"The position is {r!r} {'−' if sign == '-' else '+'} {e!r}."
    note = RecordFinding("derived-position", what, "Log the actual position.")
    return replace(
        table,
        columns={**table.columns, DERIVED: values},
        units={**table.units, DERIVED: kinds[r].unit},
        notes={**table.notes, DERIVED: note},
    )


def _left(fit: ForceFit) -> float:
    """Return what a fit leaves unexplained."""
    return max(1.0 - fit.drive.share, 1e-4)


def _increases(t: Array, even: bool = False) -> bool:
    """Return whether a column increases, apart from a few faults; if wanted, at nearly equal steps."""
    steps = np.diff(without_jumps(t))
    if len(steps) < 20 or np.mean(steps > 0.0) < 0.98:
        return False
    usual = float(np.median(steps))
    return not even or bool(np.mean(np.abs(steps / usual - 1.0) < 0.5) > 0.95)
