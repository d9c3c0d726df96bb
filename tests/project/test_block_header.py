"""Python follows block.h: the struct of a row, roles and types, and the arguments of the row macros."""

from __future__ import annotations

import ctypes

import pytest

from friction_fmus.blocks import probe
from friction_fmus.blocks.macros import block_header, constants, row_fields, si_units, start_arguments


def changed(old: str, new: str) -> str:
    text = block_header()
    assert text.count(old) == 1
    return text.replace(old, new)


def test_rows_have_the_fields_of_the_struct_in_its_order() -> None:
    names = [name for name, _ in row_fields(changed("double start, min, max, nominal;", "double max, min, start;"))]
    assert names[3:6] == ["max", "min", "start"]
    assert probe._Row.starts.offset == 3 * ctypes.sizeof(ctypes.c_char_p) + 4 * ctypes.sizeof(ctypes.c_double)
    assert probe._Row.type.size == 4


def test_roles_and_types_have_the_numbers_of_their_enumerations() -> None:
    text = changed("enum role { ROLE_TIME, ROLE_INPUT,", "enum role { ROLE_INPUT, ROLE_TIME,")
    assert (constants("role", text)["INPUT"], constants("role", text)["TIME"]) == (0, 1)
    assert constants("type", text) == {"REAL": probe.REAL, "INTEGER": probe.INTEGER, "BOOLEAN": probe.BOOLEAN}


def test_the_start_value_is_found_by_its_name_among_the_arguments() -> None:
    text = changed("#define PARAMETER(name, unit, start,", "#define PARAMETER(name, start, unit,")
    assert start_arguments(text)["PARAMETER"] == (1, False)
    assert start_arguments(block_header())["PARAMETERS"] == (3, True)
    assert not {"OUTPUT", "FLAG", "STATE_OUTPUT", "LOCALS"} & start_arguments(block_header()).keys()


@pytest.mark.parametrize(("rotary", "stiffness"), [(False, "N/m"), (True, "N.m/rad")])
def test_units_of_both_builds(rotary: bool, stiffness: str) -> None:
    assert si_units(rotary=rotary)["STIFFNESS"] == stiffness
    assert si_units(rotary=rotary)["TIME"] == "s"
