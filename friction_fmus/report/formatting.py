"""Formatting of numbers and units; names, axes and time spans used by several sections of the report."""

import math
from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from friction_fmus.identification import Array
from friction_fmus.study.study_result import Picture

MINUS = "−"
_DASH = "–"
NO_BREAK = "\u00a0"
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

#: Units in which a unit is displayed, largest first, each with its conversion factor.
SHOWN = {
    "m": (("m", 1.0), ("mm", 1e3), ("µm", 1e6), ("nm", 1e9)),
    "rad": (("rad", 1.0), ("mrad", 1e3), ("µrad", 1e6)),
    "m/s": (("m/s", 1.0), ("mm/s", 1e3), ("µm/s", 1e6)),
    "rad/s": (("rad/s", 1.0), ("mrad/s", 1e3)),
    "s": (("s", 1.0), ("ms", 1e3), ("µs", 1e6), ("ns", 1e9)),
}


def number(value: float | None, digits: int = 3) -> str:
    """Return a number, with a power of ten outside of 0.001 to 99 999; a dash for None and NaN."""
    if value is None or math.isnan(value):
        return _DASH
    if math.isinf(value):
        return "∞" if value > 0 else f"{MINUS}∞"
    if value == 0.0:
        return "0"
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    exponent = int(power)
    if -3 <= exponent < 5:
        return _signed(f"{round(value, digits - 1 - exponent):.{max(0, digits - 1 - exponent)}f}")
    return f"{_signed(mantissa)}·{ten(exponent)}"


def brief(value: float | None) -> str:
    """Return a user-given number, such as a gain, not rounded."""
    return _DASH if value is None else _signed(f"{value:.6g}")


def with_error(value: float, error: float | None) -> str:
    """Return value ± standard error, of which two digits are shown; without an error, the value with four digits."""
    if error is None or not math.isfinite(error) or error <= 0.0 or not math.isfinite(value):
        return number(value, 4)
    last = int(f"{error:.1e}".partition("e")[2]) - 1  # power of ten of the last digit
    first = int(f"{max(abs(value), error):.1e}".partition("e")[2])
    if -3 <= first < 5 and last >= -6:
        decimals = max(0, -last)
        return f"{_signed(f'{round(value, -last):.{decimals}f}')} ± {round(error, -last):.{decimals}f}"
    scale, decimals = 10.0**first, max(0, first - last)
    return f"({_signed(f'{value / scale:.{decimals}f}')} ± {error / scale:.{decimals}f})·{ten(first)}"


def unit(name: str) -> str:
    """Return the printed form of a unit: N·s/m for N.s/m, kg·m² for kg.m2, empty for 1."""
    if name == "1":
        return ""
    printed = name.replace(".", "·").replace("um", "µm")
    return "".join(
        character.translate(SUPERSCRIPT) if before.isalpha() and character.isdigit() else character
        for before, character in zip(" " + printed, printed, strict=False)
    )


def quantity(value: float | None, name: str, digits: int = 3) -> str:
    """Return a number with the multiple of its unit in which it is between 1 and 1000."""
    if value is None or not math.isfinite(value):
        return number(value)
    shown, factor = multiple(name, value)
    return f"{number(factor * value, digits)}{NO_BREAK}{shown}".rstrip()


def multiple(name: str, values: float | Array) -> tuple[str, float]:
    """Return the multiple of a unit in which values are easy to read."""
    choices = SHOWN.get(name)
    finite = np.abs(np.asarray(values, dtype=float))
    largest = float(np.max(finite[np.isfinite(finite)], initial=0.0))
    if choices is None or largest == 0.0:
        return unit(name), 1.0
    for shown, factor in choices:
        if largest * factor >= 1.0:
            return shown, factor
    return choices[-1]


def ten(exponent: int) -> str:
    """Return a power of ten."""
    return "10" + str(exponent).translate(SUPERSCRIPT)


def _signed(text: str) -> str:
    """Return a number with a typographic minus sign, and without a sign if it is zero."""
    if text.startswith("-"):
        return MINUS + text[1:] if any(digit in "123456789" for digit in text) else text[1:]
    return text


NONE = "none"
NO_COMPENSATION = "no compensation"


def label(name: str) -> str:
    """Return the name of a compensator in the report."""
    return NO_COMPENSATION if name == NONE else name


def axes(picture: Picture) -> tuple[tuple[str, str], tuple[float, float]]:
    """Return the titles of the axes, and the factors that convert the curves to the units of the titles."""
    curves = [*picture.data.values(), *picture.models.values()]
    titles, factors = [], []
    for text, unit, columns in (
        (picture.x_label, picture.x_unit, [curve.x for curve in curves]),
        (picture.y_label, picture.y_unit, [curve.y for curve in curves]),
    ):
        shown, factor = multiple(unit, np.concatenate([np.asarray(column, dtype=float) for column in columns]))
        if unit == "s":
            shown, factor = "s", 1.0
        titles.append(f"{text} [{shown}]" if shown else text)
        factors.append(factor)
    return (titles[0], titles[1]), (factors[0], factors[1])


def reversal(record: Sequence[Picture], end: float = math.inf) -> tuple[float, float] | None:
    """Return a time span around the reversal nearest to the middle of a record; None without one before the end [s]."""
    for picture in record:
        curve = next((curve for name, curve in picture.data.items() if "reference" in name), None)
        count = 0 if curve is None else bisect_right(curve.x, end)
        if curve is None or count < 3:
            continue
        x, y = np.asarray(curve.x[:count]), np.asarray(curve.y[:count])
        moving = np.flatnonzero(np.diff(y))
        turns = x[moving[1:][np.diff(np.sign(np.diff(y)[moving])) != 0]]
        if turns.size:
            centre = float(turns[np.argmin(np.abs(turns - 0.5 * (x[0] + x[-1])))])
            half = 0.02 * float(x[-1] - x[0])
            return centre - half, centre + half
    return None
