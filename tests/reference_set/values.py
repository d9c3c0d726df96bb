"""Reference values of the cases and their bounds, computed without the code under test.

``python tests/reference_set/values.py`` writes ``reference.csv`` and ``bound.csv`` of each case.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path

CASES = Path(__file__).parents[2] / "friction_fmus" / "reference" / "cases"

Number = float | Fraction
Value = tuple[Number, Number]  # value and bound
Rows = list[tuple[Number, Mapping[str, Value]]]

PROGRAMS: dict[str, Callable[[], Rows]] = {}

ULP = Fraction(1, 2**53)  # relative rounding of one operation


def case(name: str) -> Callable[[Callable[[], Rows]], Callable[[], Rows]]:
    """Register the program of a case."""

    def register(program: Callable[[], Rows]) -> Callable[[], Rows]:
        PROGRAMS[name] = program
        return program

    return register


def between(low: Number, high: Number, extra: Number = Fraction(0)) -> Value:
    """The middle of an interval, and half its width with an allowance."""
    low, high = min(low, high), max(low, high)
    return (low + high) / 2, (high - low) / 2 + extra


def write(name: str, rows: Rows) -> None:
    """Write the files of a case."""
    names = [*rows[0][1]]
    for place, file in enumerate(("reference.csv", "bound.csv")):
        with (CASES / name / file).open("w", newline="", encoding="utf-8") as target:
            writer = csv.writer(target, lineterminator="\n")
            writer.writerow(["time", *names])
            writer.writerows([text(t), *(text(row[each][place]) for each in names)] for t, row in rows)


def text(value: Number | str) -> str:
    return value if isinstance(value, str) else repr(float(value))


# ---- co-simulation ---------------------------------------------------------------------------------------------------


@case("step_force")
def step_force() -> Rows:
    h, rows = Fraction(1, 8), []
    held_x = held_v = Fraction(0)
    for n in range(9):
        t = n * h
        line_v, line_x = 8 * t**2 / 2, 8 * t**3 / 6
        slack = 32 * ULP * 8
        rows.append((t, {"x": between(held_x, line_x, slack), "v": between(held_v, line_v, slack)}))
        F = 8 * t
        held_x, held_v = held_x + h * held_v + h * h * F / 2, held_v + h * F
    return rows


@case("mass_coulomb_stop")
def mass_coulomb_stop() -> Rows:
    DV, rows = Fraction(1, 1000), []
    end = 1 - DV
    slack = Fraction(1, 10**5)
    for n in range(41):
        t = Fraction(n, 20)
        s = min(t, end)
        rows.append((t, {"x": (s - s * s / 2, slack), "v": (1 - t if t < end else Fraction(0), slack)}))
    return rows


@case("chain_ssp")
def chain_ssp() -> Rows:
    rows = []
    h = Fraction(1, 8)
    for n in range(9):
        t = n * h
        # exact t^2/2; held at the beginning or the end of each step: h t/2 less or more
        rows.append((t, {"second.x_support": (t * t / 2, h * t / 2 + 64 * ULP), "first.x": (t * t / 2, 64 * ULP)}))
    return rows


@case("saved_state")
def saved_state() -> Rows:
    slack = 64 * ULP
    q = Fraction(1, 4)
    values = [(1, Fraction(1, 2), 1), (2 * q, Fraction(1, 8), Fraction(1, 2)), (1, None, None), (q, q * q / 2, q)]
    x, v = Fraction(1, 8), Fraction(1, 2)
    values[2] = (1, x + v * Fraction(1, 2) - Fraction(1, 8), v - Fraction(1, 2))
    values += [(1, Fraction(1, 2), 1), (q, 0, 0)]
    return [(Fraction(t), {"x": (x, slack), "v": (v, slack)}) for t, x, v in values]


if __name__ == "__main__":
    for name, program in PROGRAMS.items():
        write(name, program())
