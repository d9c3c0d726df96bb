"""Unit names."""

from __future__ import annotations

import math
from time import process_time

import pytest
from thorough import THOROUGH

from harness import BaseUnit, parse_unit
from harness.units import stated_unit, units_agree


def base(kg: int = 0, m: int = 0, s: int = 0, A: int = 0, K: int = 0, rad: int = 0, factor: float = 1.0) -> BaseUnit:
    return BaseUnit((kg, m, s, A, K, 0, 0, rad), factor)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("m", base(m=1)),
        ("m/s", base(m=1, s=-1)),
        ("m.s-1", base(m=1, s=-1)),
        ("m/s2", base(m=1, s=-2)),
        ("m/s^2", base(m=1, s=-2)),
        ("N", base(kg=1, m=1, s=-2)),
        ("N.m", base(kg=1, m=2, s=-2)),
        ("N.m/rad", base(kg=1, m=2, s=-2, rad=-1)),
        ("N.s/m", base(kg=1, s=-1)),
        ("N/(m/s)", base(kg=1, s=-1)),
        ("N/(m/s)2", None),
        ("kg.m2", base(kg=1, m=2)),
        ("mm", base(m=1, factor=1e-3)),
        ("um/ms", base(m=1, s=-1, factor=1e-3)),
        ("kN", base(kg=1, m=1, s=-2, factor=1e3)),
        ("g", base(kg=1, factor=1e-3)),
        ("deg", base(rad=1, factor=math.pi / 180)),
        ("rev/min", base(rad=1, s=-1, factor=2 * math.pi / 60)),
        ("V.s/rad", base(kg=1, m=2, s=-2, A=-1, rad=-1)),
        ("1", base()),
        ("1/s", base(s=-1)),
        ("Hz", base(s=-1)),
        ("%", base(factor=0.01)),
        ("degC", BaseUnit((0, 0, 0, 0, 1, 0, 0, 0), 1.0, 273.15)),
        # 1 inch = 25.4 mm, 1 lb = 0.45359237 kg (1959), g = 9.80665 m/s2 (1901), 1 mile = 1609.344 m
        ("Nm", base(kg=1, m=2, s=-2)),
        ("kNm/rad", base(kg=1, m=2, s=-2, rad=-1, factor=1e3)),
        ("Ncm", base(kg=1, m=2, s=-2, factor=1e-2)),
        ("rpm", base(rad=1, s=-1, factor=math.pi / 30)),
        ("U/min", base(rad=1, s=-1, factor=math.pi / 30)),
        ("kmh", base(m=1, s=-1, factor=1 / 3.6)),
        ("km/h", base(m=1, s=-1, factor=1 / 3.6)),
        ("mph", base(m=1, s=-1, factor=0.44704)),
        ("inch", base(m=1, factor=0.0254)),
        ("in/s", base(m=1, s=-1, factor=0.0254)),
        ("ft", base(m=1, factor=0.3048)),
        ("mil", base(m=1, factor=2.54e-5)),
        ("lb", base(kg=1, factor=0.45359237)),
        ("lbf", base(kg=1, m=1, s=-2, factor=4.4482216152605)),
        ("lbf.in", base(kg=1, m=2, s=-2, factor=0.1129848290276167)),
        ("kgf", base(kg=1, m=1, s=-2, factor=9.80665)),
        ("psi", base(kg=1, m=-1, s=-2, factor=6894.757293168361)),
        ("°/s", base(rad=1, s=-1, factor=math.pi / 180)),
        ("kg·m²", base(kg=1, m=2)),
        ("m.s⁻¹", base(m=1, s=-1)),
        ("-", base()),
        ("°C", BaseUnit((0, 0, 0, 0, 1, 0, 0, 0), 1.0, 273.15)),
        ("degF", BaseUnit((0, 0, 0, 0, 1, 0, 0, 0), 5 / 9, 255.3722222222222)),
        ("kin", None),
        ("mrpm", None),
        ("spam", None),
        ("m/", None),
        ("m//s", None),
        ("(m", None),
        ("m)", None),
        ("m s", base(m=1, s=1)),
        ("square millimeter", base(m=2, factor=1e-6)),
        ("square m2", None),
        ("msec", base(s=1, factor=1e-3)),
        ("µsec", base(s=1, factor=1e-6)),
        ("degrees/second", base(rad=1, s=-1, factor=math.pi / 180)),
        ("Newton meters per second squared", base(kg=1, m=2, s=-4)),
        ("((m.s)/(kg.m))^2", base(s=2, kg=-2)),
        ("", None),
    ],
)
def test_parse(name: str, unit: BaseUnit | None) -> None:
    parsed = parse_unit(name)
    assert (parsed is None) == (unit is None)
    assert parsed is None or unit is None or parsed.agrees(unit)


def test_text() -> None:
    assert str(parse_unit("kN/mm")) == "1000000 * kg.s-2"
    assert str(parse_unit("1")) == "1"
    assert str(parse_unit("degC")) == "K + 273.15"


@pytest.mark.parametrize(
    "name",
    ["m" * 100_000, "m." * 50_000 + "m", "(" * 50_000, "m" + "9" * 50_000, "Gm99", "1/Gm99", "nm99.nm99.nm99", "9**9"],
    ids=lambda name: name[:12],
)
def test_a_name_that_is_no_unit_is_answered_at_once(name: str) -> None:
    start = process_time()
    assert parse_unit(name) is None
    assert units_agree(name, None, "m", None) is None
    assert not THOROUGH or process_time() - start < 0.5


@pytest.mark.parametrize(
    "name",
    [
        *("", "2", "2m", "m2e3", "m**2**2", "m..s", ".m", "m.", "m100", "m**(2)", "m**n", "m()", "()", "m)", "(m"),
        *("m**", "m^^2", "a=b", "m;s", "f(m)", "m" * 101, "m²2", "m²²²", "square", "square cubic m", "((rad99)99)99"),
    ],
)
def test_what_has_not_the_form_of_a_unit(name: str) -> None:
    assert parse_unit(name) is None


@pytest.mark.parametrize(
    ("exponents", "factor", "offset"),
    [
        ((0,) * 8, 0.0, 0.0),
        ((0,) * 8, math.inf, 0.0),
        ((0,) * 8, math.nan, 0.0),
        ((0,) * 8, 1.0, math.nan),
        ((100, *(0,) * 7), 1.0, 0.0),
    ],
)
def test_numbers_that_no_unit_has(exponents: tuple[int, ...], factor: float, offset: float) -> None:
    with pytest.raises(ValueError, match="its unit has"):
        stated_unit(exponents, factor, offset)
