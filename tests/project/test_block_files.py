"""What the files of blocks say: macros as tables, arithmetic that evaluates nothing else, and messages."""

from __future__ import annotations

from pathlib import Path

import pytest

from friction_fmus.blocks.arithmetic import evaluate, names_in
from friction_fmus.blocks.catalogue import catalogue, find
from friction_fmus.blocks.contact import Friction
from friction_fmus.blocks.macros import string, table
from friction_fmus.errors import FrictionError

LUGRE = catalogue()["LuGre"]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2 * Fc**2 / 4 - -1", 3.0),
        ("max(Fc, Fs) + min(1, 2)", 4.0),
        ("sum(k)", 3.0),
        ("either(none, Fs)", 3.0),
        ("vs * (shape == 0)", 0.0),
        ("round(2.6)", 3),
        ("k[i] * sqrt(4)", 4.0),
    ],
)
def test_arithmetic(text: str, value: float) -> None:
    known = {"Fc": 2.0, "Fs": 3.0, "vs": 1.0, "shape": 1, "N": 2, "k[1]": 1.0, "k[2]": 2.0, "k[3]": 9.0, "i": 2}
    assert evaluate(text, known) == value


@pytest.mark.parametrize(
    "text",
    ["__import__('os')", "Fc.real", "[Fc]", "lambda: 0", "Fc if Fs else 0", "k[0]", "f(Fc)", "'a'", "Fc +"],
)
def test_nothing_but_arithmetic_is_evaluated(text: str) -> None:
    with pytest.raises(FrictionError):
        names_in(text)


def test_a_name_without_a_value_is_named() -> None:
    with pytest.raises(FrictionError, match="reads Fs, which has no value"):
        evaluate("Fc + Fs", {"Fc": 1.0})


def test_macros_are_tables() -> None:
    code = '#define A \\\n    ROW(max(a, b), "x, (y) " "z") \\\n    OTHER()\n#define B "one, " "two"\n'
    assert table(code, "A", ("ROW", "OTHER")) == [("ROW", ("max(a, b)", "x, (y) z")), ("OTHER", ())]
    assert string(code, "B") == "one, two"
    assert table(code, "C", ("ROW",)) == []
    for wrong in ("RAW(a)", "ROW(a", "a"):
        with pytest.raises(FrictionError):
            table(f"#define A {wrong}\n", "A", ("ROW",))


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("COULOMB  (Fc)", "COULOMB  (F_c)", "reads F_c, which is not a variable"),
        ("COULOMB  (Fc)", "COLOUMB  (Fc)", r"CONTACT contains the unknown row COLOUMB \(did you mean COULOMB"),
        ("SLIDING(z, Fc / sigma0)", "SLIDING(z)", "has the malformed row"),
        ("SLIDING(z, Fc / sigma0)", "FIT(v_d, speed, quick)", "FIT.v_d. names the unknown experiment 'quick'"),
        ("SLIDING(z, Fc / sigma0)", "FIT(v_d, sped, slow)", "sped is not one of"),
    ],
)
def test_mistakes_in_a_file_are_named(before: str, after: str, message: str, tmp_path: Path) -> None:
    assert before in LUGRE.code
    path = tmp_path / "LuGre.c"
    path.write_text(LUGRE.code.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(FrictionError, match=message) as error:
        find(path)
    assert str(path) in str(error.value)


def test_a_backward_motion_has_its_own_parameters() -> None:
    friction = Friction("Fc", "Fs", "Fv", "vs")
    forward, backward = friction.levels({"Fc": 1.0, "Fs": 2.0, "Fv": 3.0, "vs": 4.0, "Fc_neg": 5.0, "asymmetric": 1.0})
    assert (forward.Fc, backward.Fc, backward.Fs, backward.viscous, backward.vs) == (1.0, 5.0, 2.0, 3.0, 4.0)
