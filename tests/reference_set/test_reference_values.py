"""The reference values of the cases are those of programs that do not use the code under test."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

from flint import arb, ctx
from reference_set.values import CASES, PROGRAMS, written

from friction_fmus.reference.case import BOUND, REFERENCE, read_case, read_cases
from friction_fmus.reference.tool_runs import read_results


def test_values_are_those_of_the_programs() -> None:
    changed = [
        f"{name}/{file}"
        for name, program in PROGRAMS.items()
        for file, content in written(name, program()).items()
        if (CASES / name / file).read_text(encoding="utf-8") != content
    ]
    assert changed == [], "run python tests/reference_set/values.py"


def test_each_case_has_a_program_and_files_of_its_outputs() -> None:
    cases = read_cases(CASES)
    assert [case.name for case in cases] == sorted(PROGRAMS)
    assert len(cases) >= 36
    for case in cases:
        for file in (REFERENCE, BOUND):
            assert [*read_results(case.folder / file)] == ["time", *case.outputs], case.name
        assert (case.folder / "inputs.csv").is_file() == case.inputs, case.name


def test_the_files_of_all_cases_are_small() -> None:
    assert sum(file.stat().st_size for file in CASES.rglob("*.*")) < 1_000_000


def test_a_second_library_of_intervals_encloses_the_oscillation() -> None:
    """The power series of x'' + 0.2 x' + x = 0 in balls of Arb, term by term, in place of exp and cos in mpmath."""
    ctx.prec = 200
    folder = CASES / "me_oscillator"
    reference, bound = read_results(folder / REFERENCE), read_results(folder / BOUND)
    for row, time in enumerate(reference["time"]):
        t = arb(Fraction(time).numerator) / arb(Fraction(time).denominator)
        a, b = arb(1), arb(0)  # coefficients of t^k and t^(k + 1)
        x, v, power, k = arb(0), arb(0), arb(1), 0
        while k < 400:
            x += a * power
            v += (k + 1) * b * power
            a, b = b, -(a + (k + 1) * b / 5) / ((k + 1) * (k + 2))
            power, k = power * t, k + 1
        # |terms| <= 1.2^k t^k / k! from k = 400 on, below 1e-300 for t <= 10
        for name, value in (("x", x), ("v", v)):
            written_value = arb(float(reference[name][row]))
            assert abs(written_value - value) < arb(2) ** -50, (name, time)
            assert float(bound[name][row]) < 2e-5


def test_a_bound_is_no_estimate_of_the_code_under_test() -> None:
    """No program imports it."""
    text = (Path(__file__).parent / "values.py").read_text(encoding="utf-8")
    assert "friction_fmus" not in text.replace('"friction_fmus" / "reference" / "cases"', "")
    assert "harness" not in text
    assert read_case(CASES / "me_oscillator").bound
