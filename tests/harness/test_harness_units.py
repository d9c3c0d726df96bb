"""Unit names."""

from __future__ import annotations

import math

import pytest

from harness import BaseUnit, parse_unit


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
        ("spam", None),
        ("m/", None),
        ("m//s", None),
        ("(m", None),
        ("m)", None),
        ("m s", None),
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
