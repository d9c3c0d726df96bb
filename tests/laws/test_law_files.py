"""Reading law files: what is understood, and what is said about a bad one."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from friction_fmus.blocks.catalogue import find
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.law import DAMPING, FORCE, LENGTH, Kind, Output, discover_laws

GOOD = '''
from casadi import SX
from friction_fmus.lawkit.law import *

@law("P", "Proportional controller", source="textbook", Ts=1e-3, outputs={"u": Output(FORCE, "control force")})
def p(
    r: SX = Input(LENGTH, 0.0, "reference"),
    x: SX = Input(LENGTH, 0.0, "position"),
    last: SX = State(LENGTH, 0.0, "error of the last sample"),
    Kp: SX = Parameter(STIFFNESS, 10.0, "gain", min=0.0),
) -> dict[str, SX]:
    """Proportional control."""
    return {"u": Kp * (r - x) + last, "last": r - x}
'''


def load(folder: Path, text: str, name: str = "p.py"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return discover_laws(path)


def test_a_file_outside_the_package(tmp_path):
    (law,) = load(tmp_path, GOOD)
    assert (law.name, law.summary, law.source) == ("P", "Proportional controller", "textbook")
    assert law.documentation == "Proportional control."
    assert [variable.name for variable in law.variables] == ["r", "x", "u", "last", "Kp", "Ts"]
    assert law.function.name_in() == ["r", "x", "last", "Kp", "Ts"]
    assert law.function.name_out() == ["u", "last_next"]
    assert law.evaluate({"r": 2.0, "last": 0.5}) == {"u": 20.5, "last": 2.0}
    assert [variable.kind for variable in law.select(Kind.STATE)] == [Kind.STATE]
    assert list(tmp_path.iterdir()) == [tmp_path / "p.py"]
    with pytest.raises(dataclasses.FrozenInstanceError):
        law.name = "Q"


def test_a_users_file_is_a_model(tmp_path):
    (tmp_path / "p.py").write_text(GOOD, encoding="utf-8")
    block = find(tmp_path / "p.py")
    assert (block.name, block.kind) == ("P", "compensator")
    assert "#define SAMPLED" in block.code


def test_a_folder_is_read_in_the_order_of_names(tmp_path):
    (tmp_path / "_shared.py").write_text("raise RuntimeError", encoding="utf-8")
    (tmp_path / "b.py").write_text(GOOD.replace('"P"', '"B"'), encoding="utf-8")
    (tmp_path / "a.py").write_text(GOOD.replace('"P"', '"A"'), encoding="utf-8")
    assert [law.name for law in discover_laws(tmp_path)] == ["A", "B"]


def test_two_laws_of_one_name(tmp_path):
    (tmp_path / "a.py").write_text(GOOD, encoding="utf-8")
    (tmp_path / "b.py").write_text(GOOD, encoding="utf-8")
    with pytest.raises(FrictionError, match=r"^Two laws are called P: in a\.py and in b\.py$"):
        discover_laws(tmp_path)


def test_units_join_like_c_literals():
    assert (FORCE + "/(" + LENGTH + ".s)").c == 'FORCE "/(" LENGTH ".s)"'
    assert ("1/" + DAMPING).c == '"1/" DAMPING'
    assert Output("rad/s", "speed").unit.c == '"rad/s"'


def test_values_of_unknown_variables_are_refused(tmp_path):
    (law,) = load(tmp_path, GOOD)
    with pytest.raises(FrictionError, match=r"P has no variable 'kp' to set \(did you mean Kp"):
        law.evaluate({"kp": 1.0})
    with pytest.raises(FrictionError, match="Kp has the length 1, but 2 numbers are given"):
        law.evaluate({"Kp": (1.0, 2.0)})


BAD = {
    "a next value is missing": (', "last": r - x}', "}", "does not return a next value of the state last"),
    "an output is missing": ('"u": Kp * (r - x) + last, ', "", "does not return the output u"),
    "an unknown result": (
        '"u": Kp',
        '"U": Kp',
        "'U', which is neither a declared output nor a state (did you mean u",
    ),
    "not a dict": ('{"u": Kp * (r - x) + last, "last": r - x}', "Kp", "returns a SX; return a dict"),
    "a vector as result": (
        '"last": r - x',
        '"last": SX.ones(2) * r',
        "last has the shape (2, 1); return a scalar",
    ),
    "text as result": ('"last": r - x', '"last": "r"', "last is a str, not an SX expression"),
    "a foreign symbol": ('"last": r - x', '"last": SX.sym("q")', "uses the symbols q, which are not its variables"),
    "an if": ("    return", "    if r > 0: pass\n    return", "write a decision as if_else(...)"),
    "a mistake": ("    return", "    1 / 0\n    return", "its equations raise ZeroDivisionError"),
    "a C keyword": ("Kp", "double", "the variable double is reserved by C; choose another"),
    "a Bessel function": ("Kp", "y0", "the variable y0 is reserved by <math.h>; choose another"),
    "gamma": ("Kp", "gamma", "the variable gamma is reserved by <math.h>"),
    "a Windows name": ("Kp", "near", "the variable near is reserved by Windows"),
    "a macro": ("Kp", "INF", "the variable INF is reserved by block.h"),
    "an underscore first": ("Kp", "_K", "must consist of letters, digits and single underscores"),
    "no default": ('r: SX = Input(LENGTH, 0.0, "reference")', "r: SX", "the argument r needs one of Input(...)"),
    "a plain default": (
        'Parameter(STIFFNESS, 10.0, "gain", min=0.0)',
        "10.0",
        "the argument Kp needs one of Input(...)",
    ),
    "Output as argument": (
        'Parameter(STIFFNESS, 10.0, "gain", min=0.0)',
        'Output("N", "gain")',
        "the argument Kp needs one of",
    ),
    "start out of range": ("min=0.0", "min=20.0", "the start value 10.0 of Kp lies outside [20, inf]"),
    "start not finite": ("STIFFNESS, 10.0", 'STIFFNESS, float("inf")', "the start value of Kp must be finite"),
    "an empty vector": ("STIFFNESS, 10.0", "STIFFNESS, ()", "the start value of Kp must be finite, not ()"),
    "nominal": (
        '"error of the last sample"',
        '"error of the last sample", nominal=0.0',
        "the nominal value of last must be positive",
    ),
    "no description": ('"gain"', '""', "the description of Kp must be one line of text"),
    "two lines": ('"gain"', '"gain\\n"', "the description of Kp must be one line of text"),
    "no docstring": ('"""Proportional control."""', "", "has no docstring"),
    "no source": ('source="textbook"', 'source=""', "the source must be one line"),
    "a bad name": ('"P"', '"P-I"', "the name 'P-I' must consist of letters"),
    "a bad sample time": ("Ts=1e-3", "Ts=0.0", "the sample time Ts = 0.0 must be positive"),
    "no output": ('{"u": Output(FORCE, "control force")}', "{}", "has no output"),
    "output and input of one name": ('{"u"', '{"r": Output(FORCE, "r"), "u"', "the name r is declared twice"),
    "a vector's element": (
        "Kp: SX",
        'k_1: SX = Switch(True, "a"), k: SX = Parameter("1", (1.0,), "b"), Kp: SX',
        "the name k_1 is declared twice",
    ),
    "a next value's name": (
        "Kp: SX",
        'last_next: SX = Switch(True, "a"), Kp: SX',
        "last_next is the next value of the state last",
    ),
    "a vector state without its elements": (
        "Kp: SX",
        'line: SX = State("m", (0.0, 0.0), "a"), Kp: SX',
        "does not return a next value of the state line",
    ),
    "Ts as parameter": (
        "Kp: SX",
        'Ts: SX = Switch(True, "a"), Kp: SX',
        "SampleTime() declares the argument Ts and no other; correct the declaration of Ts",
    ),
    "another sample time": (
        "Kp: SX",
        "T: SX = SampleTime(), Kp: SX",
        "SampleTime() declares the argument Ts and no other; correct the declaration of T",
    ),
    "a syntax error": ("return", "retrun", "p.py cannot be loaded: SyntaxError"),
}


@pytest.mark.parametrize(("old", "new", "message"), BAD.values(), ids=BAD)
def test_bad_files_get_one_sentence(old, new, message, tmp_path):
    assert old in GOOD
    with pytest.raises(FrictionError) as caught:
        load(tmp_path, GOOD.replace(old, new))
    text = str(caught.value)
    assert message in text
    assert text.startswith("p.py")
    assert "\n" not in text


@pytest.mark.parametrize("returned", ["r - x", "[r - x]", "[r, x, r]"])
def test_the_next_value_of_a_vector_is_a_list_of_its_length(returned, tmp_path):
    text = GOOD.replace('LENGTH, 0.0, "error', 'LENGTH, (0.0, 1.0), "error').replace("+ last", "+ last[0]")
    with pytest.raises(FrictionError, match=r"law P: return the next last as a list of 2 expressions"):
        load(tmp_path, text.replace('"last": r - x', f'"last": {returned}'))


def test_missing_and_foreign_files(tmp_path):
    with pytest.raises(FrictionError, match="There is no law file or folder"):
        discover_laws(tmp_path / "nothing.py")
    (tmp_path / "law.txt").write_text(GOOD, encoding="utf-8")
    with pytest.raises(FrictionError, match="is not a Python file"):
        discover_laws(tmp_path / "law.txt")
