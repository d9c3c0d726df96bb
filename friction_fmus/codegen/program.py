"""A program that runs an exported law with given samples under qemu-arm, in place of the microcontroller.

It needs no C runtime and writes its results by Linux system calls. The counted instructions belong to the law and to
the library functions that it calls; they are the same on every core with this instruction set.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from friction_fmus.codegen.layout import INPUTS, Export
from friction_fmus.codegen.sources import unit_text
from friction_fmus.lawkit.law import BOOLEANS, Variable

_SIZES = {"m": 1e-3, "m/s": 1e-2, "m/s2": 1.0, "rad": 1e-3, "rad/s": 1e-2}
"""Magnitude of the samples by unit, for which friction and control are neither at rest nor saturated."""

STACK = 4096
"""Size of the monitored stack [bytes]."""


def samples(export: Export, n: int, seed: int = 1) -> dict[str, np.ndarray]:
    """Return n random samples of the inputs around their start values, with some zeros; Booleans rarely change."""
    random = np.random.default_rng(seed)

    def draw(variable: Variable) -> np.ndarray:
        start = export.start[variable.name][0]
        if variable.kind in BOOLEANS:
            return np.where(random.random(n) < 0.1, 1.0 - start, start)
        column = start + _SIZES.get(unit_text(variable), 1.0) * random.normal(size=n)
        column[random.random(n) < 0.1] = 0.0
        return column.astype(np.float32).astype(float) if export.real.suffix else column

    return {variable.name: draw(variable) for variable in export.law.select(*INPUTS)}


def program(export: Export, given: Mapping[str, np.ndarray], restart: int = 0) -> str:
    """Return the text of the program.

    For every sample, the program writes a line with the bytes of the results and of the lower parts of pairs, and at
    the end the depth of the stack [bytes]. With the macro QUIET it runs the law once and writes only that depth.
    """
    p, inputs = export.prefix, export.law.select(*INPUTS)
    n = len(next(iter(given.values()))) if given else 1
    cells = [cell for v in inputs for cell in _cells(export, v, given[v.name])]
    rows = [f"    {{{', '.join(row)}}}," for row in zip(*(column for _, column in cells), strict=True)]
    shown = [place.replace("->", ".") for place in (*export.results, *export.result_lows.values())]
    write = [
        line for place in shown for line in (f"            value = {place};", "            hex(&value, sizeof value);")
    ]
    return "\n".join(
        [
            f'#include "{p}.h"',
            "",
            f"static const {export.real.name} given[{n}][{max(len(cells), 1)}] = {{",
            *(rows or ["    {0},"]),
            "};",
            CALLS,
            *(f"static {p}_{group} {group};" for group in export.groups),
            "",
            "static volatile unsigned char *stack; /* of the step */",
            "",
            "static void __attribute__((noinline, noclone)) run(unsigned n, int writes)",
            "{",
            "    unsigned k;",
            f"    {export.real.name} value;",
            '    __asm__ volatile("mov %0, sp" : "=r"(stack));',
            "    for (k = 0; k < n; k++) {",
            f"        if (k == 0 || k == {restart})",
            f"            {p}_init(&parameters, &states, &inputs, &outputs);",
            *(f"        {assignment % i}" for i, (assignment, _) in enumerate(cells)),
            f"        {p}_step(&parameters, &states, &inputs, &outputs);",
            "        if (writes) {",
            *write,
            '            linux(4, 1, "\\n", 1);',
            "        }",
            "    }",
            "}",
            "",
            "void start(void);",
            "void start(void)",
            "{",
            "    unsigned depth;",
            "    run(0, 0);",
            f"    for (depth = 1; depth <= {STACK}; depth++)",
            "        *(stack - depth) = 0xA5;",
            f"    run({n}, 0);",
            f"    for (depth = {STACK}; depth > 0 && *(stack - depth) == 0xA5; depth--)",
            "        ;",
            "#ifndef QUIET",
            f"    run({n}, 1);",
            "#endif",
            "    hex(&depth, sizeof depth);",
            "    linux(1, 0, 0, 0);",
            "}",
            "",
        ]
    )


def _cells(export: Export, variable: Variable, values: np.ndarray) -> list[tuple[str, list[str]]]:
    """Return the assignment of column %d to each member of an input, and the samples of this member."""
    name, columns = variable.name, {variable.name: values}
    if name in export.pairs:
        high = values.astype(np.float32).astype(float)
        columns = {name: high, f"{name}_low": values - high}
    test = " != 0" if variable.kind in BOOLEANS else ""
    return [
        (f"inputs.{member} = given[k][%d]{test};", [export.real.literal(float(value)) for value in part])
        for member, part in columns.items()
    ]


CALLS = """
static void linux(long number, long a, const void *b, long c)
{
    register long r7 __asm__("r7") = number;
    register long r0 __asm__("r0") = a;
    register const void *r1 __asm__("r1") = b;
    register long r2 __asm__("r2") = c;
    __asm__ volatile("svc 0" : "+r"(r0) : "r"(r7), "r"(r1), "r"(r2) : "memory");
}

static void hex(const void *bytes, unsigned n)
{
    const unsigned char *byte = bytes;
    char text[2];
    for (unsigned i = 0; i < n; i++) {
        text[0] = "0123456789abcdef"[byte[i] >> 4];
        text[1] = "0123456789abcdef"[byte[i] & 15];
        linux(4, 1, text, 2);
    }
    linux(4, 1, " ", 1);
}
"""
