"""The C block of a law: its variables as the table for block.h, its expressions as the function `sample`."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from casadi import Function

from friction_fmus.lawkit.declarations import FAULT, c_string
from friction_fmus.lawkit.emit.c_text import kernel
from friction_fmus.lawkit.emit.names import comment
from friction_fmus.lawkit.law import BOOLEANS, VECTORS, Kind, Law, Variable


def block_source(law: Law) -> str:
    """Return the C file of a law's block for block.h."""
    writes = [f"model->{name}" for variable in law.results for name in _elements(variable)]
    body = _statements(law.function, law.given, writes)
    last_output = max(i for i, variable in enumerate(law.variables) if variable.kind is Kind.OUTPUT)
    table = (*law.variables[: last_output + 1], FAULT, *law.variables[last_output + 1 :])
    texts, skipped = law.conditions.texts, _skip(law)
    origin = f"Generated from the law file {law.path.name}: change that file, not this one."
    return "\n".join(
        [
            comment(f"{law.documentation}\n\n{origin}"),
            "",
            f"#define MODEL   {law.name}",
            f"#define SUMMARY {c_string(law.summary)}",
            f"#define SOURCE  {c_string(law.source)}",
            "#define SAMPLED",
            "#define GUARDED",
            *(["#define SKIPS_BY skip"] if skipped else []),
            *(["#define REQUIRES relations"] if texts else []),
            "",
            "/* clang-format off */",
            *_table(table),
            "/* clang-format on */",
            "",
            '#include "block.h"',
            "",
            "/* The operations of the law in casadi's order of evaluation; the results are stored at the end. */",
            "static void sample(Model *model)",
            "{",
            "    GIVEN(model)",
            *(f"    {line}" for line in body),
            "}",
            *skipped,
            *(_relations(law) if texts else []),
            "",
        ]
    )


def _statements(function: Function, given: Sequence[Variable], writes: Sequence[str]) -> tuple[str, ...]:
    """Return the C statements of a function of these variables, which are available as constants."""
    # GIVEN copies scalars, but has only pointers to vectors: a state vector is named as where results are stored
    places = [("model->" if variable.kind is Kind.STATES else "", variable) for variable in given]
    reads = [f"{prefix}{name}" for prefix, variable in places for name in _elements(variable)]
    scalars = [variable for variable in given for _ in variable.starts]
    booleans = [i for i, variable in enumerate(scalars) if variable.kind in BOOLEANS]
    taken = [*(variable.name for variable in given), *(re.findall(r"\w+", " ".join(writes)))]
    positive = [i for i, variable in enumerate(scalars) if variable.min >= 0.0]
    return kernel(function, reads, writes, conditions=booleans, positive=positive, taken=taken, unrolls=True).lines


def _skip(law: Law) -> list[str]:
    """Return the C function in place of a sample with an invalid input: it counts, and a disabled law is at rest."""
    function, results = law.disabled()
    lines = [f"model->{variable.name} += 1.0;" for variable in law.given if variable.tally]
    if results:
        writes = [f"model->{name}" for variable in results for name in _elements(variable)]
        rest = _statements(function, law.given, writes)
        lines += ["if (!enable) {", *(f"    {line}" for line in rest), "}"]
    body = [f"    {line}" for line in lines]
    return ["", "static void skip(Model *model)", "{", "    GIVEN(model)", *body, "}"] if lines else []


def _relations(law: Law) -> list[str]:
    """Return the C function that returns the text of a violated condition."""
    texts = law.conditions.texts
    held = [f"holds[{i}]" for i in range(len(texts))]
    return [
        "",
        "static const char *relations(const Model *model)",
        "{",
        "    GIVEN(model)",
        f"    double holds[{len(texts)}];",
        *(f"    {line}" for line in _statements(law.conditions.function, law.conditions.parameters, held)),
        *(f"    if (holds[{i}] == 0.0)\n        return {c_string(text)};" for i, text in enumerate(texts)),
        "    return NULL;",
        "}",
    ]


def _elements(variable: Variable) -> list[str]:
    """Return the C names of the scalars of a variable."""
    if variable.kind in VECTORS:
        return [f"{variable.name}[{i}]" for i in range(len(variable.starts))]
    return [variable.name]


def _limit(value: float) -> str:
    """Return a number for the table, where the macro INF is infinity."""
    return repr(float(value)) if math.isfinite(value) else "INF" if value > 0.0 else "-INF"


def _table(variables: Sequence[Variable]) -> list[str]:
    """Return the rows of VARIABLES in columns."""
    rows = [_row(variable) for variable in variables]
    widths = [max(len(cells[column]) for _, cells, _ in rows) for column in range(len(rows[0][1]))]
    longest = max(len(kind) for kind, _, _ in rows)
    lines = ["#define VARIABLES"]
    for kind, cells, text in rows:
        columns = [cell.ljust(width) for cell, width in zip(cells, widths, strict=True) if width]
        lines.append(f"    {kind.ljust(longest)}({' '.join(columns)} {text})")
    width = max(map(len, lines))
    return [*(f"{line.ljust(width)} \\" for line in lines[:-1]), lines[-1]]


def _row(variable: Variable) -> tuple[str, list[str], str]:
    """Return macro, cells (name, number of elements, unit, start, min or nominal, max) and text of a variable."""
    kind = variable.kind
    unit = "" if kind in (*BOOLEANS, Kind.FLAG) else variable.unit.c
    count = low = high = ""
    if kind in VECTORS:
        count, start = str(len(variable.starts)), f"({', '.join(map(_limit, variable.starts))})"
    elif kind in BOOLEANS:
        start = str(int(variable.starts[0]))
    else:
        start = "" if kind in (Kind.OUTPUT, Kind.FLAG) else _limit(variable.starts[0])
    if kind in (Kind.PARAMETER, Kind.VECTOR, Kind.SAMPLE_TIME):
        low, high = _limit(variable.min), _limit(variable.max)
    elif kind in (Kind.STATE, Kind.STATES):
        low = _limit(variable.nominal)
    cells = [f"{cell}," if cell else "" for cell in (variable.name, count, unit, start, low, high)]
    return kind.value, cells, c_string(variable.text)
