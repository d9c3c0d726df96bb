"""Beckhoff TF5200: a table of the motor current over the velocity."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from friction_fmus.export.targets import RATED, Option, Target

if TYPE_CHECKING:
    from friction_fmus.export.axis_fit import AxisFit
    from friction_fmus.export.identified_axis import Array, IdentifiedAxis

MANUAL: Final = (
    "Beckhoff, TF5200 CNC, Friction compensation, Compensation values",
    "https://infosys.beckhoff.com/content/1033/tf5200_axis_compensation/352414091.html",
)
MOST_ROWS: Final = 20
PLACES: Final = 120  # speeds among which those of the rows are chosen
CHOICES: Final = {"position_delay": (0, 1, 2, 5, 10), "delay_cycles": range(4), "reversal_lookahead": range(5)}
"""Values that are tried, within the ranges of the device."""


def best_places(v: Array, f: Array, weights: Array, rows: int) -> list[int]:
    """Return the places of the rows whose linear interpolation follows f over v best, first and last included.

    Dynamic programming: the least weighted square error up to each place with each number of rows.
    """
    import numpy as np

    n = len(v)
    cost = np.full((n, n), np.inf)
    for i in range(n):
        for j in range(i + 1, n):
            chord = f[i] + (f[j] - f[i]) * (v[i:j] - v[i]) / (v[j] - v[i])
            cost[i, j] = np.sum(weights[i:j] * (f[i:j] - chord) ** 2)
    least, before = np.where(np.arange(n) == 0, 0.0, np.inf), []
    for _ in range(min(rows, n) - 1):
        total = least[:, None] + cost
        before.append(np.argmin(total, axis=0))
        least = np.min(total, axis=0)
    places = [n - 1]
    for choice in reversed(before):
        places.append(int(choice[places[-1]]))
    return places[::-1]


def shaped(fit: AxisFit, force: Array, position_delay: float, delay_cycles: int, reversal_lookahead: int) -> Array:
    """Return the current that builds up over a distance [m] after a start, decays before a reversal, and is late."""
    import numpy as np

    from friction_fmus.export.axis_fit import signs

    sign, n = signs(fit.motion), np.arange(len(force))
    starts = np.flatnonzero(np.diff(sign, prepend=0.0))
    begin = np.maximum.accumulate(np.where(np.diff(sign, prepend=0.0) != 0.0, n, 0))
    turns = starts[sign[starts] * sign[starts - 1] < 0.0]
    left = np.append(turns, len(n) + reversal_lookahead)[np.searchsorted(turns, n, side="right")] - n
    factor = np.minimum(left / (1.0 + reversal_lookahead), 1.0)
    if position_delay:
        factor = factor * np.minimum(np.abs(fit.motion.r - fit.motion.r[begin]) / position_delay, 1.0)
    return np.concatenate([np.zeros(delay_cycles), factor * force])[: len(n)]


def write(axis: IdentifiedAxis, folder: Path, rated: str = "", rows: str = str(MOST_ROWS)) -> list[Path]:
    """Write the sheet."""
    import numpy as np

    from friction_fmus.errors import BuildError
    from friction_fmus.export.axis_fit import AxisFit, signs
    from friction_fmus.export.drive_sheet import Row, in_percent, lost, text, write_sheet

    if not rows.isdecimal() or not 2 <= int(rows) <= MOST_ROWS:
        raise BuildError(f"--rows {rows}: the table has 2 to {MOST_ROWS} rows.")
    fit = AxisFit(axis)
    sign, speed = signs(fit.motion), np.abs(fit.motion.rd)
    scale, length = (180e3 / np.pi, np.pi / 1.8e6) if axis.rotary else (1e6, 1e-7)
    moving = speed[sign != 0.0]
    most = float(np.max(moving))
    edges = np.append(np.quantile(moving, np.linspace(0.0, 1.0, PLACES)), np.geomspace(1e-3 * most, most, PLACES))
    bins = np.searchsorted(np.unique(edges)[1:-1], moving, side="right")
    counts = np.bincount(bins).astype(float)
    v, f = (np.bincount(bins, each)[counts > 0.0] for each in (moving, (sign * fit.friction)[sign != 0.0]))
    weights = counts[counts > 0.0]
    v, f = v / weights, f / weights
    v[0], v[-1] = 0.0, most
    at = np.unique(np.round(scale * v[best_places(v, f, weights, int(rows))]))
    hats = np.column_stack([sign * np.interp(scale * speed, at, each) for each in np.eye(len(at))])
    forces = {f"frict_comp.table[{i}].out": force for i, force in enumerate(fit.fit(hats, axis.offset))}
    percent, out, note = in_percent(axis, rated, forces, 0.1)

    def formed(given: dict[str, int]) -> Array:
        delay, *cycles = given.values()
        return shaped(fit, hats @ out, length * delay, *cycles) + axis.offset

    chosen = dict.fromkeys(CHOICES, 0)
    for name, tried in CHOICES.items() if axis.loop is not None else ():
        chosen = min(({**chosen, name: value} for value in tried), key=lambda given: fit.tracking(formed(given)))
    short, turn = ("0.0001 deg", "0.001 deg/s") if axis.rotary else ("0.1 um", "um/s")
    entries: list[tuple[str, float, str, str]] = [
        ("mode", 3, "", "00041"),
        ("table_entries", len(at), "", "00042"),
        ("position_delay", chosen["position_delay"], short, "00043"),
        ("reversal_lookahead", chosen["reversal_lookahead"], "cycles", "00044"),
        ("scaling_factor", 1000, "0.1 %", "00045"),
        ("delay_cycles", chosen["delay_cycles"], "cycles", "00058"),
    ]
    for i, (each, current) in enumerate(zip(at, percent, strict=True)):
        entries += [(f"table[{i}].in", each, turn, "00046"), (f"table[{i}].out", 10.0 * current, "0.1 %", "00047")]
    lines = [Row(f"frict_comp.{name}", text(x, 1.0), of, f"P-COMP-{number}", MANUAL) for name, x, of, number in entries]
    notes = [
        f"{note} The unit of the current depends on the drive; 0.1 % of rated is that of CANopen drives.",
        "lr_param.frict_comp = 1 (P-AXIS-00522) activates the compensation. It does not contain the constant force.",
        "A cycle is taken as a sample of the servo. Between rows, the current is interpolated; it is 0 at rest.",
        "position_delay is within the documented range, 0 to 10, although an example of the documentation has 30.",
        *lost(axis, {"table"}),
    ]
    return write_sheet(fit, folder, "tf5200", "Beckhoff TF5200", lines, formed(chosen), notes)


ROWS = Option("rows", f"number of rows of the table, 2 to {MOST_ROWS} (default)", metavar="N")
TARGET = Target("a sheet for Beckhoff TF5200", "axis", write, options=(RATED, ROWS))
