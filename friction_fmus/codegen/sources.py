"""The C files of a law without FMI: header, implementation, example."""

from __future__ import annotations

import math
import re
import textwrap
from dataclasses import replace

import numpy as np

from friction_fmus.blocks.catalogue import source_folder
from friction_fmus.codegen.layout import Export
from friction_fmus.lawkit.conditions import PARAMETERS
from friction_fmus.lawkit.emit.c_text import Real
from friction_fmus.lawkit.law import BOOLEANS, Kind, Variable
from friction_fmus.version import VERSION

_C89 = {
    *("acos", "asin", "atan", "atan2", "ceil", "cos", "cosh", "exp", "fabs", "floor", "fmod", "log", "pow", "sin"),
    *("sinh", "sqrt", "tan", "tanh"),
}
"""Functions that <math.h> has had from the beginning, in double."""


def si_units() -> dict[str, str]:
    """Quantity -> unit of the sliding build, read from block.h."""
    text = (source_folder() / "block.h").read_text(encoding="utf-8")
    sliding = text[text.index("#else", text.index("#ifdef ROTATIONAL")) :]
    return dict(re.findall(r'^#define (\w+)\s+"([^"]*)"$', sliding, re.M))


def unit_text(variable: Variable) -> str:
    """Unit of a variable, ``N/m``; empty for a number without one."""
    units = si_units()
    words = re.findall(r'"[^"]*"|\w+', variable.unit.c)
    return "".join(word[1:-1] if word.startswith('"') else units[word] for word in words)


def comment(text: str, indent: str = "") -> str:
    """A C comment; nothing in the text can end it."""
    harmless = text.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")
    return textwrap.indent(f"/* {textwrap.indent(harmless, '   ').lstrip()} */", indent)


def number(export: Export, variable: Variable, value: float) -> str:
    """A value of the variable as a literal."""
    return str(int(value)) if variable.kind in BOOLEANS else export.real.literal(value)


def _range(variable: Variable) -> str:
    low, high = (math.isfinite(limit) for limit in (variable.min, variable.max))
    if low and high:
        return f", {variable.min:g} to {variable.max:g}"
    return f", at least {variable.min:g}" if low else f", at most {variable.max:g}" if high else ""


def _struct(export: Export, group: str) -> list[str]:
    """typedef of one struct; an empty one is no C."""
    lines = ["typedef struct {"]
    for variable in export.groups[group]:
        unit = unit_text(variable)
        given = variable.kind in PARAMETERS and variable.kind not in BOOLEANS
        text = f"{f'[{unit}] ' if unit else ''}{variable.text}{_range(variable) if given else ''}"
        lines.append(f"    {export.member(variable)}; {comment(text)}")
        if variable.name in export.pairs:
            low = export.member(replace(variable, name=f"{variable.name}_low"))
            lines.append(f"    {low}; {comment(f'{variable.name} without what is in {variable.name}')}")
    if not export.groups[group]:
        lines.append("    char none;")
    return [*lines, f"}} {export.prefix}_{group};", ""]


def header(export: Export) -> str:
    """The text of ``PREFIX.h``."""
    p, law = export.prefix, export.law
    guard = f"{p.upper()}_H"
    calls = ", ".join(sorted(export.kernel.functions)) or "none"
    title = (
        f"{law.name}: {law.summary}\n\n{law.documentation}\n\nSource: {law.source}\n"
        f"Functions of the C library that are called: {calls}.\n"
        f"Written by friction-fmus {VERSION} from the law file {law.path.name}: change that file, not this one."
    )
    arguments = f"const {p}_parameters *parameters, {p}_states *states, const {p}_inputs *inputs, {p}_outputs *outputs"
    rules = "\n".join(f"{i}: {text}" for i, (text, _) in enumerate(_rules(export), start=1))
    return "\n".join(
        [
            comment(title),
            "",
            f"#ifndef {guard}",
            f"#define {guard}",
            "",
            *(line for group in export.groups for line in _struct(export, group)),
            "#ifdef __cplusplus",
            'extern "C" {',
            "#endif",
            "",
            "/* Start values of everything. */",
            f"void {p}_init({p}_parameters *parameters, {p}_states *states, {p}_inputs *inputs, {p}_outputs *outputs);",
            "",
            comment(f"0 if the parameters can be used, else the number of the first rule that they break:\n\n{rules}"),
            f"int {p}_check(const {p}_parameters *parameters);",
            "",
            comment(
                "One sample, every `Ts` seconds: the outputs for these inputs, and the next states. With an input that "
                "is\nNaN or infinite outputs and states stay, and `fault` is 1."
            ),
            f"void {p}_step({arguments});",
            "",
            "#ifdef __cplusplus",
            "}",
            "#endif",
            "",
            "#endif",
            "",
        ]
    )


def _rules(export: Export) -> list[tuple[str, str]]:
    """What must hold of the parameters: for people, and as a C condition."""
    rules = []
    for variable in export.groups["parameters"]:
        if variable.kind in BOOLEANS:
            continue
        parts = []
        parts += [f"FINITE({low})" for low in export.lows(variable)]
        for place in export.places(variable):
            parts.append(f"FINITE({place})")
            if math.isfinite(variable.min):
                parts.append(f"{place} >= {export.real.literal(variable.min)}")
            if math.isfinite(variable.max):
                parts.append(f"{place} <= {export.real.literal(variable.max)}")
        rules.append((f"{variable.name} is finite{_range(variable)}", " && ".join(parts)))
    return rules + [
        (text, f"holds[{i}] != {export.real.literal(0.0)}") for i, text in enumerate(export.law.conditions.texts)
    ]


def _check(export: Export) -> list[str]:
    """The function that checks the parameters."""
    conditions = export.law.conditions
    holds = [f"holds[{i}]" for i in range(len(conditions.texts))]
    lines = export.statements(conditions.function, conditions.parameters, holds).lines if holds else ()
    relations = [
        f"static void relations(const {export.prefix}_parameters *parameters, {export.real.name} *holds)",
        "{",
        *(f"    {line}" for line in lines),
        "}",
        "",
    ]
    return [
        *(relations if holds else []),
        f"int {export.prefix}_check(const {export.prefix}_parameters *parameters)",
        "{",
        *([f"    {export.real.name} holds[{len(holds)}];", "    relations(parameters, holds);"] if holds else []),
        *(f"    if (!({condition}))\n        return {i};" for i, (_, condition) in enumerate(_rules(export), start=1)),
        "    return 0;",
        "}",
        "",
    ]


def _init(export: Export) -> list[str]:
    """The function that sets start values."""
    p = export.prefix
    lines = []
    for variable in export.law.given:
        values = export.start[variable.name]
        lows = [value - float(np.float32(value)) for value in values]
        lines += [
            f"    {place} = {number(export, variable, value)};"
            for places, parts in ((export.places(variable), values), (export.lows(variable), lows))
            for place, value in zip(places, parts, strict=False)
        ]
    results = [place for v in export.law.select(Kind.OUTPUT) for place in (*export.places(v), *export.lows(v))]
    lines += [f"    {place} = {export.real.literal(0.0)};" for place in results]
    return [
        f"void {p}_init({p}_parameters *parameters, {p}_states *states, {p}_inputs *inputs, {p}_outputs *outputs)",
        "{",
        *lines,
        *([] if export.groups["states"] else ["    states->none = 0;"]),
        "    outputs->fault = 0;",
        "}",
        "",
    ]


def implementation(export: Export) -> str:
    """The text of ``PREFIX.c``."""
    p, body = export.prefix, export.kernel
    given = f"const {p}_parameters *parameters, {p}_states *states, const {p}_inputs *inputs, {p}_outputs *outputs"
    text = "\n".join(body.lines)
    unused = [f"    (void){group};" for group in ("parameters", "states") if f"{group}->" not in text]
    moved = export.law.select(Kind.INPUT, Kind.OPTIONAL)
    reals = [place for v in moved for place in (*export.places(v), *export.lows(v))]
    finite = "\n                       && ".join(f"FINITE({place})" for place in reals) or "1"
    return "\n".join(
        [
            f'#include "{p}.h"',
            "",
            "#include <math.h>",
            "",
            *_prototypes(export.real, body.functions),
            "#ifdef __FAST_MATH__",
            '#error "compile this file without -ffast-math: it would not see that an input is NaN"',
            "#endif",
            "#if defined __STDC_VERSION__ && __STDC_VERSION__ >= 199901L",
            "#define FINITE(value) isfinite(value)",
            "#else",
            f"#define FINITE(value) ((value) - (value) == {export.real.literal(0.0)}) /* else that is NaN */",
            "#endif",
            "",
            "/* One constant per operation; the results are stored at the end. */",
            f"static void sample({given})",
            "{",
            *(f"    {line}" for line in body.lines),
            *unused,
            "}",
            "",
            *_init(export),
            *_check(export),
            f"void {p}_step({given})",
            "{",
            f"    outputs->fault = !({finite});",
            "    if (!outputs->fault)",
            "        sample(parameters, states, inputs, outputs);",
            "}",
            "",
        ]
    )


def _prototypes(real: Real, functions: frozenset[str]) -> list[str]:
    """What <math.h> of C89 does not declare."""
    new = sorted(name for name in functions if name not in _C89)
    if not new:
        return []
    return [
        "#if !defined __STDC_VERSION__ || __STDC_VERSION__ < 199901L",
        *(
            f"{real.name} {name}({', '.join([real.name] * _ARGUMENTS.get(name.removesuffix(real.suffix), 1))});"
            for name in new
        ),
        "#endif",
        "",
    ]


_ARGUMENTS = {**dict.fromkeys(("pow", "atan2", "fmod", "copysign", "hypot", "remainder"), 2), "fma": 3}
"""Number of arguments of the functions that have more than one."""


def example(export: Export) -> str:
    """The text of ``main.c``."""
    p, real = export.prefix, export.real
    moved = export.law.select(Kind.INPUT, Kind.OPTIONAL)
    drive = f"        inputs.{moved[0].name} = {real.literal(1e-3)} * ({real.name})k;" if moved else ""
    shown = export.law.select(Kind.OUTPUT)
    texts = "  ".join(f"{v.name} = %g" for v in shown)
    values = ", ".join(f"(double)outputs.{v.name}" for v in shown)
    return "\n".join(
        [
            comment(f"{export.law.name} in a loop: in a drive the body of the loop runs every parameters.Ts seconds."),
            "",
            f'#include "{p}.h"',
            "",
            "#include <stdio.h>",
            "",
            "int main(void)",
            "{",
            *(f"    {p}_{group} {group};" for group in export.groups),
            "    int k;",
            "",
            f"    {p}_init(&parameters, &states, &inputs, &outputs);",
            f"    if ({p}_check(&parameters) != 0)",
            "        return 1;",
            "    for (k = 0; k < 10; k++) {",
            "        /* here the references and the sensors are read */",
            *([drive] if drive else []),
            f"        {p}_step(&parameters, &states, &inputs, &outputs);",
            "        /* here the actuator gets its command */",
            f'        printf("{texts}\\n", {values});',
            "    }",
            "    return 0;",
            "}",
            "",
        ]
    )
