"""The unit test of an exported law, which its user runs on the target."""

import math
from collections.abc import Sequence
from itertools import accumulate

import numpy as np

from friction_fmus.codegen.layout import INPUTS, Export
from friction_fmus.codegen.sources import number
from friction_fmus.codegen.vectors import EXACT, LOST, N, Vectors, parts
from friction_fmus.lawkit.emit.c_text import DOUBLE
from friction_fmus.lawkit.emit.syntax import comment, wrapped
from friction_fmus.lawkit.law import BOOLEANS, VECTORS, Kind, LawVariable
from friction_fmus.version import VERSION


def unit_test(export: Export, samples: Vectors) -> str:
    """Return the text of ``PREFIX_test.c``."""
    p, real = export.prefix, export.real.name
    inputs, outputs = export.law.select(*INPUTS), export.law.select(Kind.OUTPUT)
    given = [
        [cell for v in inputs for cell in _cells(export, v, run.given[v.name][k])]
        for run in samples.runs
        for k in range(len(run.expected))
    ]
    expected = [
        [cell for i, v in enumerate(outputs) for cell in _cells(export, v, row[i])] + ["0"]
        for run in samples.runs
        for row in run.expected
    ]
    variables = [f"    {p}_{group} {group};" for group in export.groups]
    return "\n".join(
        [
            comment(_heading(export, samples)),
            "",
            f'#include "{p}.h"',
            "",
            f"#define SAMPLES {N}",
            "",
            *_table(f"{p}_inputs given", given),
            *_table(f"{p}_outputs expected", expected),
            *([] if samples.exact else _allowed(export, np.concatenate([run.allowed for run in samples.runs]))),
            *_agrees(real),
            "/* Return whether the outputs of sample k are as expected. */",
            f"static int right(const {p}_outputs *found, int k)",
            "{",
            *_comparison(export, outputs, exact=samples.exact),
            "}",
            "",
            f"int {p}_test(void);",
            f"int {p}_test(void)",
            "{",
            *variables,
            # the compiler cannot divide by it itself
            *([f"    volatile {export.real.name} zero = 0;"] if _first_real(export) else []),
            "    int k;",
            "",
            f"    {p}_init(&parameters, &states, &inputs, &outputs);",
            f"    if ({p}_check(&parameters) != 0)",
            "        return -1;",
            *_loop(p, "0", "SAMPLES", 1),
            *_fault(export, "SAMPLES"),
            *_disabled(export),
            *_others(export, samples),
            "    return 0;",
            "}",
            "",
            f"#ifdef {p.upper()}_TEST_MAIN",
            "int main(void)",
            "{",
            f"    return {p}_test();",
            "}",
            "#endif",
            "",
        ]
    )


def _heading(export: Export, samples: Vectors) -> str:
    p = export.prefix
    motion = "\n".join(f"{f'{first} to {last}' if last > first else first}: {text}" for first, last, text in parts())
    paragraphs = [
        f"Unit test of {p}.c, to be run on the target. {p}_test() returns 0 if all is right, the number of the first "
        f"wrong sample, or -1 if {p}_check() rejects the start values. It calls nothing but {p}.c. With "
        f"{p.upper()}_TEST_MAIN defined, this file is a program with the same result as its status.",
        f"The expected values are not from {p}.c: friction-fmus {VERSION} computed them in double from the equations "
        "of the law.",
        tolerance(export, samples),
        *([untested(samples)] if untested(samples) else []),
        f"Samples, counted from 1:\n{motion}",
        *([f"{N + 1}: an input is NaN; the outputs are held and fault is set."] if _first_real(export) else []),
        *_about_others(samples),
    ]
    return "\n\n".join("\n".join(wrapped(line, width=114) for line in text.split("\n")) for text in paragraphs)


def _about_others(samples: Vectors) -> list[str]:
    """Return the text of the runs with other parameters."""
    begins = [k + 2 for k in _begins(samples)]
    changed = dict.fromkeys(name for run in samples.runs for name in run.run.settings)
    invalid = f", {LOST} invalid samples" if any(run.run.lost for run in samples.runs) else ""
    return (
        [
            f"{begins[1]} to {begins[-1] - 1}: the motion scaled, with other commands{invalid} and other values of "
            f"{', '.join(changed)}; a run starts with sample {', '.join(map(str, begins[1:-1]))}."
        ]
        if changed
        else []
    )


def _begins(samples: Vectors) -> list[int]:
    """Return the number of samples before each run, and of all."""
    return list(accumulate((len(run.expected) for run in samples.runs), initial=0))


def tolerance(export: Export, samples: Vectors) -> str:
    """Return how far an output may be from its expected value, and why."""
    if samples.exact:
        return (
            "Outputs must equal the expected values: the law calls no function of the C library that rounds, and all "
            "other operations are exact in IEEE arithmetic. A difference means that the compiler contracts a product "
            "and a sum (gcc does so without -ffp-contract=off) or that the target has no IEEE double."
        )
    why = (
        "float rounds each operation to 6e-8"
        if export.real is not DOUBLE
        else f"C libraries round {', '.join(sorted(export.kernel.functions - EXACT))} differently"
    )
    return (
        f"The differences in the table `allowed` are accepted because {why}: {samples.relative:g} of the output, or of "
        "its median if this is larger, or four times the effect of random rounding of each operation."
    )


def untested(samples: Vectors) -> str:
    """Return what the samples do not show; empty if they show everything."""
    texts = []
    if samples.untested:
        texts.append(f"No sample shows a change by 1 % of: {', '.join(samples.untested)}.")
    if not samples.limited:
        texts.append("No sample reaches a limit u_min or u_max.")
    if samples.repeated:
        numbers = ", ".join(map(str, samples.repeated))
        texts.append(f"Repeated inputs, as an output would not be finite: samples {numbers}.")
    doubtful = [
        k + begin + (begin > 0)
        for begin, run in zip(_begins(samples), samples.runs, strict=False)
        for k in run.doubtful
    ]
    if doubtful:
        numbers = ", ".join(map(str, doubtful))
        texts.append(f"Rounding decides, so that both results are accepted: samples {numbers}.")
    return " ".join(texts)


def _literal(export: Export, value: float) -> str:
    """Return the shortest literal of the type of the export."""
    if export.real is DOUBLE or not math.isfinite(np.float32(value)):
        return export.real.literal(value)
    return f"{np.float32(value)!s}{export.real.suffix}"


def _cells(export: Export, variable: LawVariable, value: float) -> list[str]:
    """Return the members of a variable in an initialiser: one, or two for a pair."""
    if variable.kind in BOOLEANS:
        return [number(export, variable, value)]
    if variable.name not in export.pairs:
        return [_literal(export, value)]
    return [_literal(export, value), _literal(export, value - float(np.float32(value)))]


def _table(declaration: str, rows: Sequence[Sequence[str]]) -> list[str]:
    return [
        f"static const {declaration}[{len(rows)}] = {{",
        *(f"    {{{', '.join(row) or '0'}}}," for row in rows),
        "};",
        "",
    ]


def _allowed(export: Export, allowed: np.ndarray) -> list[str]:
    """Return the table of tolerances, with two digits."""
    suffix = export.real.suffix
    rows = (", ".join(f"{value:.1e}{suffix}" for value in row) for row in allowed)
    return [
        f"static const {export.real.name} allowed[{len(allowed)}][{allowed.shape[1]}] = {{",
        *(f"    {{{row}}}," for row in rows),
        "};",
        "",
    ]


def _agrees(real: str) -> list[str]:
    return [
        f"static int agrees({real} difference, {real} bound)",
        "{",
        "    return difference <= bound && -difference <= bound; /* not if it is NaN */",
        "}",
        "",
    ]


def _comparison(export: Export, outputs: Sequence[LawVariable], *, exact: bool) -> list[str]:
    """Return the comparison of all outputs."""
    calls = []
    for i, variable in enumerate(outputs):
        name = variable.name
        difference = f"found->{name} - expected[k].{name}"
        if name in export.pairs:
            difference = f"({difference}) + (found->{name}_low - expected[k].{name}_low)"
        calls.append(f"agrees({difference}, {export.real.literal(0.0) if exact else f'allowed[k][{i}]'})")
    return ["    return " + "\n           && ".join(calls) + ";"]


def _first_real(export: Export) -> LawVariable | None:
    return next(iter(export.law.select(Kind.INPUT, Kind.OPTIONAL)), None)


def _loop(prefix: str, first: str, last: str, offset: int) -> list[str]:
    return [
        f"    for (k = {first}; k < {last}; k++) {{",
        "        inputs = given[k];",
        f"        {prefix}_step(&parameters, &states, &inputs, &outputs);",
        "        if (outputs.fault || !right(&outputs, k))",
        f"            return k + {offset};",
        "    }",
    ]


def _fault(export: Export, last: str, count: int = 1) -> list[str]:
    """Return the statements that expect the outputs of the last sample while an input is NaN."""
    variable = _first_real(export)
    if variable is None:
        return []
    return [
        f"    inputs.{variable.name} = zero / zero;",
        *[f"    {export.prefix}_step(&parameters, &states, &inputs, &outputs);"] * count,
        f"    if (!outputs.fault || !right(&outputs, {last} - 1))",
        f"        return {last} + {2 if count > 1 else 1};",
    ]


def _disabled(export: Export) -> list[str]:
    """Return the statements that expect a disabled law at rest while the input is still NaN."""
    shown = [v for v in export.law.disabled()[1] if v.kind is Kind.OUTPUT]
    values = export.law.evaluate({**_plain(export), "enable": 0.0}) if shown else {}
    zero = export.real.literal(0.0)
    tests = [f"!agrees(outputs.{v.name} - {_literal(export, values[v.name])}, {zero})" for v in shown]
    return (
        [
            "    inputs.enable = false;",
            f"    {export.prefix}_step(&parameters, &states, &inputs, &outputs);",
            f"    if (!outputs.fault || {' || '.join(tests)})",
            "        return SAMPLES + 1;",
        ]
        if shown
        else []
    )


def _plain(export: Export) -> dict[str, float | tuple[float, ...]]:
    """Return the start values of an export by variable."""
    return {v.name: export.start[v.name] if v.kind in VECTORS else export.start[v.name][0] for v in export.law.given}


def _others(export: Export, samples: Vectors) -> list[str]:
    """Return the statements of the runs with other parameters."""
    p, begins = export.prefix, _begins(samples)
    lines = []
    for first, last, run in zip(begins[1:-1], begins[2:], samples.runs[1:], strict=True):
        lines.append(f"    {p}_init(&parameters, &states, &inputs, &outputs);")
        for variable in export.law.given:
            for i, value in enumerate(run.run.settings.get(variable.name, ())):
                place = export.places(variable)[i].replace("->", ".")
                lines.append(f"    {place} = {number(export, variable, value)};")
                lows = export.lows(variable)
                if lows:
                    low = value - float(np.float32(value))
                    lines.append(f"    {lows[i].replace('->', '.')} = {_literal(export, low)};")
        middle = first + run.run.lost if run.run.lost < last - first else first
        if middle > first:
            lines += [*_loop(p, f"{first}", f"{middle}", 2), *_fault(export, f"{middle}", LOST)]
        lines += _loop(p, f"{middle}", f"{last}", 2)
    return lines
