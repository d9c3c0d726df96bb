"""Numbers, texts and arrays as C source."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence


def c_number(value: float) -> str:
    """Return a constant of type double, the same to the last bit."""
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return repr(float(value))


def c_string(text: str) -> str:
    """Return a C string; octal escapes hold what C99 does not, and break trigraphs."""
    plain = (chr(byte) if 32 <= byte < 127 and chr(byte) not in '"\\?' else f"\\{byte:03o}" for byte in text.encode())
    return '"' + "".join(plain) + '"'


def c_reals(name: str, values: Iterable[float]) -> list[str]:
    """Return the lines of an array of doubles; one without values gets a zero, as C has no empty arrays."""
    texts = [c_number(float(value)) for value in values] or ["0.0"]
    return _array(f"double {name}", texts)


def c_integers(name: str, values: Iterable[int], kind: str = "int64_t") -> list[str]:
    """Return the lines of an array of integers, as `c_reals`."""
    return _array(f"{kind} {name}", [str(int(value)) for value in values] or ["0"])


def _array(declaration: str, texts: Sequence[str]) -> list[str]:
    rows = [f"    {', '.join(texts[i : i + 12])}," for i in range(0, len(texts), 12)]
    return [f"static const {declaration}[] = {{", *rows, "};"]


def c_rows(declaration: str, rows: Sequence[str], empty: str) -> list[str]:
    """Return the lines of an array of these rows; without rows, `empty` is its only one."""
    return [f"static const {declaration}[] = {{", *(rows or [f"    {empty},"]), "};"]
