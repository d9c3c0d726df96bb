"""Laws with one wrong operation: the generated unit test finds at least 95 % of them."""

from __future__ import annotations

import random
import re
import subprocess
from itertools import accumulate
from pathlib import Path

import pytest
from codegen.test_unit_test import LAWS, write
from thorough import some

from friction_fmus.codegen.law_export import make_export
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
    r"\* active > 0",  # `active` is -1 or 1 in this branch
    r"- floor\(r_per_pitch",  # whole turns of an angle
    r"states->way = way_or_0;",  # matters only for slipping elements, and none slips after a sample at rest
)
"""Lines whose mutants are not counted, with the reason."""
SHARE = 0.05
"""Largest share of the mutants that pass the unit test of a law.

Some pass because they are right. Adding 1 to a divisor that is 0, or subtracting it, makes no difference, as its
quotient is not used (DiscreteInverse) or the dividend is 0, too (ImplicitSuperTwisting). `path != 0 || size != 0` in
DahlFeedforward is right: a path or a size of 0 moves nothing. PreviewPrefilter only asks whether `seen` is 0.
"""
MOST = 150
"""Mutants of a law, drawn from all of them."""
MAIN = """
#include <stdio.h>
#include <sys/wait.h>
#include <unistd.h>
extern int mutant;
int main(void)
{
    for (; mutant < COUNT; mutant++) {
        int status = 0;
        const pid_t child = fork();
        if (child == 0) {
            alarm(10);
            _exit(law_test() != 0);
        }
        waitpid(child, &status, 0);
        if (status == 0)
            printf("%d\\n", mutant);
    }
    return 0;
}
"""
"""Prints the mutants that pass the unit test; a crash and an endless loop are found."""


def mutants(body: str) -> list[tuple[str, str]]:
    """Bodies with one other operator, or with a result that is not computed, and the line."""
    found = []
    lines = body.split("\n")
    comments = accumulate(line.count("/*") - line.count("*/") for line in lines)
    for number, (line, inside) in enumerate(zip(lines, comments, strict=True)):
        if inside or "*/" in line or any(re.search(text, line) for text in EQUIVALENT):
            continue
        changed = [
            (line[: match.start()] + new + line[match.end() :], f"{line.strip()}  ->{new}at {match.start()}")
            for old, new in OPERATORS.items()
            for match in re.finditer(re.escape(old), line)
        ]
        if re.match(r"\s*(states|outputs)->\w+ = (?!0\.0f?;|false;).*;$", line):
            changed.append((re.sub(r"=.*;", "= 0;", line), f"{line.strip()}  -> 0"))
        found += [("\n".join([*lines[:number], other, *lines[number + 1 :]]), what) for other, what in changed]
    return found


@pytest.mark.parametrize("name", some(LAWS, ["DisturbanceObserver"]))
def test_the_unit_test_finds_a_wrong_operation(name: str, tmp_path: Path) -> None:
    export = make_export(name, real="float")
    if export.pairs:  # the errors of their lower parts are below the tolerance
        export = make_export(name, real="double")
    text = implementation(export)
    begin = text.index("static void sample(")
    end = text.index("\n}\n", begin) + 3
    every = mutants(text[begin:end])
    drawn = [(text[begin:end], "none"), *random.Random(name).sample(every, min(MOST, len(every)))]
    heading = text[begin : text.index("{", begin)]
    names = [argument.split("*")[-1].strip() for argument in heading[heading.index("(") :].rstrip(" \n)").split(",")]
    bodies = [body.replace("sample(", f"sample_{k}(", 1) for k, (body, _) in enumerate(drawn)]
    calls = [f"case {k}: sample_{k}({', '.join(names)}); break;" for k in range(len(drawn))]
    chosen = f"int mutant;\n{heading}{{ switch (mutant) {{ {' '.join(calls)} }} }}\n"
    write(export, tmp_path, text[:begin] + "\n".join(bodies) + chosen + text[end:])
    test = tmp_path / "law_test.c"
    test.write_text(test.read_text(encoding="utf-8") + MAIN, encoding="utf-8")
    compiler = ["gcc", "-w", "-O0", f"-DCOUNT={len(drawn)}", "law.c", "law_test.c", "-lm", "-o", "program"]
    subprocess.run(compiler, cwd=tmp_path, check=True)
    printed = subprocess.run([tmp_path / "program"], check=True, capture_output=True, text=True).stdout
    passed = [int(line) for line in printed.split()]
    assert passed[0] == 0, "the law itself fails"
    survivors = [drawn[k][1] for k in passed[1:]]
    assert len(survivors) <= SHARE * (len(drawn) - 1), "\n".join(survivors)
