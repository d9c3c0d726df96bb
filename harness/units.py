"""Units as in FMI 2.0: exponents of eight base units, a factor and an offset (FMI 2.0, 2.2.2)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from harness.errors import UnitError

BASE_SYMBOLS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
LARGEST_POWER = 99  # largest exponent of a base unit


@dataclass(frozen=True)
class BaseUnit:
    """A unit expressed in base units: value in base units = factor * value + offset.

    Parameters
    ----------
    exponents : tuple of 8 int
        Exponents of kg, m, s, A, K, mol, cd, rad.
    factor, offset : float
        Conversion to base units.
    """

    exponents: tuple[int, ...] = (0,) * 8
    factor: float = 1.0
    offset: float = 0.0

    def agrees(self, other: BaseUnit) -> bool:
        """Return whether a number means the same in both units.

        Factors are compared with a relative tolerance of 1e-9, because modelDescription.xml files round them.

        Parameters
        ----------
        other : BaseUnit
            The other unit.

        Returns
        -------
        bool
            True if exponents, factor and offset agree.
        """
        return (
            self.exponents == other.exponents
            and math.isclose(self.factor, other.factor, rel_tol=1e-9)
            and math.isclose(self.offset, other.offset, rel_tol=1e-9, abs_tol=1e-12)
        )

    def __str__(self) -> str:
        powers = zip(BASE_SYMBOLS, self.exponents, strict=True)
        product = ".".join(name + (str(power) if power != 1 else "") for name, power in powers if power)
        text = product or "1"
        if not math.isclose(self.factor, 1.0, rel_tol=1e-12):
            text = f"{self.factor:.12g} * {text}"
        return text + (f" + {self.offset:.12g}" if self.offset else "")


def stated_unit(exponents: Iterable[int], factor: float, offset: float) -> BaseUnit:
    """Return the unit with these numbers from a file."""
    powers = tuple(exponents)
    if not (0.0 < factor < math.inf and math.isfinite(offset)):
        raise ValueError(f"its unit has the factor {factor} and the offset {offset}")
    if any(abs(power) > LARGEST_POWER for power in powers):
        raise ValueError(f"its unit has an exponent larger than {LARGEST_POWER}")
    return BaseUnit(powers, factor, offset)


def _unit(text: str, factor: float = 1.0, offset: float = 0.0) -> BaseUnit:
    """Return the entry of the table for ``"kg.m.s-2"``."""
    exponents = dict.fromkeys(BASE_SYMBOLS, 0)
    for name, power in re.findall(r"([A-Za-z]+)(-?\d*)", text):
        exponents[name] += int(power or 1)
    return BaseUnit(tuple(exponents.values()), factor, offset)


# units of mechanical and electrical drives as files and people write them; any other name is unknown
_INCH, _POUND, _KILOPOND, _TURN = 0.0254, 0.45359237, 9.80665, 2.0 * math.pi
_SYMBOLS = {
    **dict.fromkeys(("1", "-"), _unit("")),
    "%": _unit("", 0.01),
    "g": _unit("kg", 1e-3),
    **{symbol: _unit(symbol) for symbol in BASE_SYMBOLS if symbol != "kg"},
    "N": _unit("kg.m.s-2"),
    "Nm": _unit("kg.m2.s-2"),
    "Pa": _unit("kg.m-1.s-2"),
    "bar": _unit("kg.m-1.s-2", 1e5),
    "J": _unit("kg.m2.s-2"),
    "W": _unit("kg.m2.s-3"),
    "V": _unit("kg.m2.s-3.A-1"),
    **dict.fromkeys(("Ohm", "ohm", "Ω"), _unit("kg.m2.s-3.A-2")),
    "C": _unit("A.s"),
    "F": _unit("kg-1.m-2.s4.A2"),
    "H": _unit("kg.m2.s-2.A-2"),
    "T": _unit("kg.s-2.A-1"),
    "Hz": _unit("s-1"),
    "min": _unit("s", 60.0),
    "sec": _unit("s"),
    **dict.fromkeys(("h", "hr"), _unit("s", 3600.0)),
    "deg": _unit("rad", math.pi / 180.0),
    "rev": _unit("rad", _TURN),
}
# these take no prefix; most are full texts such as rev/min, whose symbols mean something else alone
_WHOLE = {
    **dict.fromkeys(("degC", "°C"), _unit("K", 1.0, 273.15)),
    **dict.fromkeys(("degF", "°F"), _unit("K", 5.0 / 9.0, 459.67 * 5.0 / 9.0)),
    **dict.fromkeys(("°", "degree", "degrees"), _unit("rad", math.pi / 180.0)),
    "arcmin": _unit("rad", math.pi / 10_800.0),
    "arcsec": _unit("rad", math.pi / 648_000.0),
    **dict.fromkeys(("turn", "turns", "revs"), _unit("rad", _TURN)),
    **dict.fromkeys(("rpm", "RPM", "r/min", "U/min", "Upm", "UPM"), _unit("rad.s-1", _TURN / 60.0)),
    "rps": _unit("rad.s-1", _TURN),
    **dict.fromkeys(("kmh", "kph", "km/hr"), _unit("m.s-1", 1.0 / 3.6)),
    "mph": _unit("m.s-1", 1609.344 / 3600.0),
    **dict.fromkeys(("in", "inch", "inches", '"'), _unit("m", _INCH)),
    **dict.fromkeys(("mil", "thou"), _unit("m", 1e-3 * _INCH)),
    **dict.fromkeys(("ft", "foot", "feet"), _unit("m", 12.0 * _INCH)),
    **dict.fromkeys(("micron", "microns"), _unit("m", 1e-6)),
    "lb": _unit("kg", _POUND),
    "oz": _unit("kg", _POUND / 16.0),
    "lbf": _unit("kg.m.s-2", _POUND * _KILOPOND),
    "ozf": _unit("kg.m.s-2", _POUND / 16.0 * _KILOPOND),
    **dict.fromkeys(("kgf", "kp"), _unit("kg.m.s-2", _KILOPOND)),
    "Ncm": _unit("kg.m2.s-2", 1e-2),
    "Nmm": _unit("kg.m2.s-2", 1e-3),
    "psi": _unit("kg.m-1.s-2", _POUND * _KILOPOND / _INCH**2),
}
_PREFIXES = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "c": 1e-2, "d": 0.1, "k": 1e3, "M": 1e6, "G": 1e9}
LONGEST_UNIT = 100  # largest length of a unit name [characters]
_LETTER = r"[^\W\d_²³¹⁰⁴-⁹]"  # the module re does not count superscripts as digits
_POWER = r"[-+]?[0-9]{1,2}(?![0-9])|⁻?[²³¹⁰⁴-⁹]{1,2}(?![²³¹⁰⁴-⁹])"
_PIECE = re.compile(
    rf"(?P<space>\s*)(?:(?P<symbol>(?:{_LETTER}|[°%])(?:{_LETTER}|_)*|1(?![0-9]))(?P<power>(?:\^|\*\*)?(?:{_POWER}))?"
    rf"|(?P<open>\()|(?P<close>\))(?P<outer>(?:\^|\*\*)(?:{_POWER}))?|(?P<operator>[./*·]))"
)
_NAMES = {
    **{"meter": "m", "metre": "m", "gram": "g", "second": "s", "minute": "min", "hour": "h", "newton": "N"},
    **{"radian": "rad", "revolution": "rev", "hertz": "Hz", "pascal": "Pa", "joule": "J", "watt": "W"},
    **{"ampere": "A", "amp": "A", "volt": "V"},
}
_NAMES_OF_PREFIXES = {"nano": "n", "micro": "u", "milli": "m", "centi": "c", "kilo": "k", "mega": "M"}
_PHRASES = (
    (re.compile(r"\b(?:square|sq)\s+([^\W\d_]+)(?!\w)"), r"\1^2"),
    (re.compile(r"\bcubic\s+([^\W\d_]+)(?!\w)"), r"\1^3"),
    (re.compile(r"\s+squared\b"), "^2"),
    (re.compile(r"\s+per\s+"), "/"),
)

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


def _unit_pieces(text: str) -> list[dict[str, str]] | None:
    """Return symbols, brackets and operators in order, or None if the text does not have the form of a unit name."""
    found, position, text = [], 0, text.strip()
    if len(text) > LONGEST_UNIT:
        return None
    for phrase, short in _PHRASES:
        text = phrase.sub(short, text)
    while position < len(text):
        match = _PIECE.match(text, position)
        if match is None:
            return None
        found.append(match.groupdict(default=""))
        position = match.end()
    return found


def _symbol(name: str) -> BaseUnit | None:
    """Return a symbol of the table, with or without an SI prefix."""
    whole = _SYMBOLS.get(name) or _WHOLE.get(name)
    if whole is not None:
        return whole
    base = _SYMBOLS.get(name[1:]) if name[:1] in _PREFIXES else None
    if base is not None:
        return BaseUnit(base.exponents, base.factor * _PREFIXES[name[0]])
    word = name.lower().removesuffix("s")
    prefix = next((prefix for prefix in _NAMES_OF_PREFIXES if word.startswith(prefix)), "")
    symbol = _NAMES.get(word.removeprefix(prefix))
    return _symbol(_NAMES_OF_PREFIXES.get(prefix, "") + symbol) if symbol else None


def _times(a: BaseUnit, b: BaseUnit, power: int) -> BaseUnit | None:
    """Return the product a * b**power, or None if it is too large; an offset has no meaning in a product."""
    exponents = tuple(i + power * j for i, j in zip(a.exponents, b.exponents, strict=True))
    try:
        factor = a.factor * b.factor**power
    except (OverflowError, ZeroDivisionError):
        return None
    small = 0.0 < factor < math.inf and max(map(abs, exponents)) <= LARGEST_POWER
    return BaseUnit(exponents, factor) if small else None


def _power(text: str) -> int:
    return int(text.lstrip("^*").translate(_SUPERSCRIPTS) or 1)


def _product(pieces: list[dict[str, str]], nested: bool) -> BaseUnit | None:
    """Evaluate pieces from the left to the end or to the closing bracket, and remove them; a space multiplies."""
    total = BaseUnit()
    sign, expect_symbol = 1, True
    while pieces:
        piece = pieces.pop(0)
        if piece["close"]:
            return _times(BaseUnit(), total, _power(piece["outer"])) if nested and not expect_symbol else None
        if piece["operator"]:
            if expect_symbol:
                return None
            sign, expect_symbol = (-1 if piece["operator"] == "/" else 1), True
            continue
        factor = _product(pieces, nested=True) if piece["open"] else _symbol(piece["symbol"])
        begins = expect_symbol or piece["space"]
        product = _times(total, factor, sign * _power(piece["power"])) if factor is not None and begins else None
        if product is None:
            return None
        total = product
        sign, expect_symbol = 1, False
    return None if nested or expect_symbol else total


def parse_unit(text: str) -> BaseUnit | None:
    """Return the base unit for a unit name such as ``N.m/s``, ``kg.m2``, ``mm``, ``N/(m/s)``.

    Parameters
    ----------
    text : str
        Unit name: symbols with optional SI prefix, or their English names, with integer exponents of at most two digits
        (``m2``, ``m^2``, ``m**2``, ``m²``, ``square meter``), joined by ``.``, ``*``, ``/``, a space or ``per``
        (evaluated from the left), with brackets.

    Returns
    -------
    BaseUnit or None
        None if the name is not understood.
    """
    alone = _WHOLE.get(text.strip()) or _SYMBOLS.get(text.strip())
    if alone is not None:
        return alone  # keeps the offset of degC
    pieces = _unit_pieces(text)
    return _product(pieces, nested=False) if pieces else None


def needed_unit(name: str | None, base: BaseUnit | None, where: str) -> BaseUnit | None:
    """Return the unit with this name, as defined or else derived from the name; None if no unit is stated."""
    unit = base or (parse_unit(name) if name else None)
    if unit is None and name:
        raise UnitError(
            f"{where} is in '{name[:LONGEST_UNIT]}', which is not a known unit: correct it (N.m, km/h, rev/min, inch "
            "are known), or define it by its base units"
        )
    return unit


_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S.*?)\s*")


def is_quantity(text: str) -> bool:
    """Return whether a text is a number with a unit, such as ``0.002 kN``."""
    return _QUANTITY.fullmatch(text) is not None


def in_unit(value: Any, name: str | None, base: BaseUnit | None, where: str) -> Any:
    """Return a quantity such as ``0.002 kN`` as a number in another unit; any other value is returned as it is."""
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        return value
    own, target = needed_unit(match[2], None, f"the value of {where}"), needed_unit(name, base, where)
    numbers = conversion(own, target) if own and target else None
    if numbers is None:
        raise UnitError(f"{where} is given in [{match[2]}] but has the unit [{name or 1}]: give a value in this unit")
    return numbers[0] * float(match[1]) + numbers[1]


def units_agree(a: str | None, base_a: BaseUnit | None, b: str | None, base_b: BaseUnit | None) -> bool | None:
    """Return whether two units agree: True, False, or None if this is unknown."""
    # A missing unit name (in FMI, no attribute ``unit``) is unknown. A missing base unit is looked up by name.
    if a is None or b is None:
        return None
    base_a = base_a or parse_unit(a)
    base_b = base_b or parse_unit(b)
    if base_a is None or base_b is None:
        return True if a == b else None
    return base_a.agrees(base_b)


def conversion(source: BaseUnit, target: BaseUnit) -> tuple[float, float] | None:
    """Return factor and offset that convert a number to another unit, or None for different quantities."""
    if source.agrees(target):
        return 1.0, 0.0
    if source.exponents != target.exponents:
        return None
    return source.factor / target.factor, (source.offset - target.offset) / target.factor
