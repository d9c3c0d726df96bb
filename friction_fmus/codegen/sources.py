"""The C files of a law without FMI: header, implementation, example."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from casadi import Function

from friction_fmus.catalogue import source_folder
from friction_fmus.emit import Kernel, Real, kernel
from friction_fmus.law import BOOLEANS, VECTORS, Kind, Law, Variable
from friction_fmus.law_conditions import PARAMETERS
from friction_fmus.law_variables import FAULT
from friction_fmus.version import VERSION

INPUTS = (Kind.INPUT, Kind.OPTIONAL, Kind.COMMAND)
STATES = (Kind.STATE, Kind.STATES)

Values = Mapping[str, tuple[float, ...]]

_C89 = {
    *("acos", "asin", "atan", "atan2", "ceil", "cos", "cosh", "exp", "fabs", "floor", "fmod", "log", "pow", "sin"),
    *("sinh", "sqrt", "tan", "tanh"),
}
"""Functions that <math.h> has had from the beginning, in double."""


@dataclass(frozen=True)
class Export:
    """A law, and how it is to be written.

    Attributes
    ----------
    law : Law
        The law.
    real : Real
        Type of all numbers.
    prefix : str
        Of files, types and functions.
    start : mapping of str to tuple of float
        Start values of inputs, states and parameters, by variable.
    """

    law: Law
    real: Real
    prefix: str
    start: Values

    @property
    def groups(self) -> dict[str, tuple[Variable, ...]]:
        """Members of the structs by the struct's name, in the order of the arguments of ``step``."""
        return {
            "parameters": self.law.select(*PARAMETERS),
            "states": self.law.select(*STATES),
            "inputs": self.law.select(*INPUTS),
            "outputs": (*self.law.select(Kind.OUTPUT), FAULT),
        }

    @property
    def kernel(self) -> Kernel:
        """One sample, as statements on the structs."""
        return self.statements(self.law.function, self.law.given, self.results)

    @property
    def results(self) -> list[str]:
        """C expressions of the scalars that a sample writes, in the order of the law's function."""
        return [place for variable in self.law.results for place in self.places(variable)]

    def statements(self, function: Function, given: Sequence[Variable], writes: Sequence[str]) -> Kernel:
        """A function of variables of the structs, as statements."""
        scalars = [variable for variable in given for _ in variable.starts]
        return kernel(
            function,
            [place for variable in given for place in self.places(variable)],
            writes,
            real=self.real,
            conditions=[i for i, variable in enumerate(scalars) if variable.kind in BOOLEANS],
        )

    def places(self, variable: Variable) -> list[str]:
        """C expressions of its scalars, behind pointers with the names of the structs."""
        group = next(name for name, members in self.groups.items() if variable in members)
        name = f"{group}->{variable.name}"
        return [f"{name}[{i}]" for i in range(len(variable.starts))] if variable.kind in VECTORS else [name]

    def member(self, variable: Variable) -> str:
        """Declaration of a member."""
        kind = "int" if variable.kind in (*BOOLEANS, Kind.FLAG) else self.real.name
        return f"{kind} {variable.name}{f'[{len(variable.starts)}]' if variable.kind in VECTORS else ''}"


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
    lines = [
        f"    {place} = {number(export, variable, value)};"
        for variable in export.law.given
        for place, value in zip(export.places(variable), export.start[variable.name], strict=True)
    ]
    lines += [f"    outputs->{v.name} = {export.real.literal(0.0)};" for v in export.law.select(Kind.OUTPUT)]
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
    reals = [f"inputs->{v.name}" for v in export.law.select(Kind.INPUT, Kind.OPTIONAL)]
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
            f"{real.name} {name}({', '.join([real.name] * (2 if name.removesuffix(real.suffix) in TWO else 1))});"
            for name in new
        ),
        "#endif",
        "",
    ]


TWO = ("pow", "atan2", "fmod", "copysign", "hypot", "remainder")
"""Functions of two numbers."""


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
