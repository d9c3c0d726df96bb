"""Laws with one wrong operation: the generated unit test finds at least 95 % of them."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from codegen.test_unit_test import LAWS, write
from thorough import some

from friction_fmus.codegen.export import make_export
from friction_fmus.codegen.sources import implementation

OPERATORS = {
    " + ": " - ",
    " - ": " + ",
    " * ": " / ",
    " / ": " * ",
    " < ": " > ",
    " > ": " < ",
    " && ": " || ",
    " || ": " && ",
}
EQUIVALENT = (
    r"(sign_|side)",  # a product with a sign, or a quotient
    r"_low\b",  # parts below the tolerance of single precision
    r"missed",  # a unit test has no missing samples
)
"""Lines whose mutants are not counted, with the reason."""


def mutants(body: str) -> Iterator[tuple[str, str]]:
    """Bodies with one other operator, or with a result that is not computed, and the line."""
    for line in body.split("\n"):
        if line.lstrip().startswith(("/*", "the ", "of ")) or any(re.search(text, line) for text in EQUIVALENT):
            continue
        for old, new in OPERATORS.items():
            for match in re.finditer(re.escape(old), line):
                yield body.replace(line, line[: match.start()] + new + line[match.end() :], 1), line + "  ->" + new
        if re.match(r"\s*(states|outputs)->\w+ = (?!0\.0f?;|false;).*;$", line):
            yield body.replace(line, re.sub(r"=.*;", "= 0;", line), 1), line + "  -> 0"


@pytest.mark.parametrize("name", some(LAWS, ["DisturbanceObserver"]))
def test_the_unit_test_finds_a_wrong_operation(name: str, tmp_path: Path) -> None:
    export = make_export(name, real="float")
    text = implementation(export)
    first = text.index("static void sample")
    last = text.index("\n}\n", first)
    write(export, tmp_path)
    test = ["gcc", "-w", "-DLAW_TEST_MAIN", "-c", "law_test.c"]
    subprocess.run(test, cwd=tmp_path, check=True)

    def found(body: str) -> bool | None:
        (tmp_path / "law.c").write_text(text[:first] + body + text[last:], encoding="utf-8")
        compiler = ["gcc", "-w", "law.c", "law_test.o", "-lm", "-o", "program"]
        if subprocess.run(compiler, cwd=tmp_path, check=False, capture_output=True).returncode:
            return None
        return subprocess.run([tmp_path / "program"], check=False).returncode != 0

    assert found(text[first:last]) is False
    results = [(line, found(body)) for body, line in mutants(text[first:last])]
    survivors = [line for line, killed in results if killed is False]
    count = sum(killed is not None for _, killed in results)
    assert len(survivors) <= 0.05 * count, "\n".join(survivors)
