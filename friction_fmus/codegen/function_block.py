"""A law as a function block of IEC 61131-3: Structured Text, and the same in a PLCopen XML file."""

import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from lxml import etree
from lxml.builder import ElementMaker

from friction_fmus.codegen.layout import Export, is_flag, numbered
from friction_fmus.codegen.sources import (
    at_rest,
    described,
    invalid,
    is_long,
    number,
    numbered_rules,
    overflow,
    plain,
    relations,
    rules,
    usable,
    vectors_valid,
)
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.emit.c_text import Kernel
from friction_fmus.lawkit.emit.chains import INDEX
from friction_fmus.lawkit.emit.structured_text import KEYWORDS, comment, functions, real_type, spelled
from friction_fmus.lawkit.emit.syntax import indented
from friction_fmus.lawkit.law import VECTORS, Kind, LawVariable
from friction_fmus.version import VERSION, build_time


class Variable(NamedTuple):
    """A variable of a function block or of a function."""

    name: str
    kind: str  # its type, of a vector the type of an element
    size: int = 0  # number of elements; 0 for a scalar
    start: tuple[str, ...] = ()  # start values as literals; none for zero
    text: str = ""  # comment


class Unit(NamedTuple):
    """A program organization unit: a function block or a function."""

    name: str
    returns: str  # type of a function; empty for a function block
    text: str  # documentation
    sections: Sequence[tuple[str, Sequence[Variable]]]  # variables, with the keyword of their section
    body: str


@dataclass(frozen=True)
class FunctionBlock(Export):
    """A law with the settings of its export as a function block, whose variables replace the members of structs."""

    locals: dict[str, Variable] = field(default_factory=dict)  # temporary variables, which the methods add

    @cached_property
    def names(self) -> dict[str, str]:
        """Names in the block by names in the law; ``_value`` is added to keywords."""
        own = ["valid", "rests", "sum", "holds", "violated", self.prefix]
        own += [f"{v.name}_before" for v in self.law.select(Kind.OUTPUT)]
        own += [f"{v.name}_valid" for v in self.groups["parameters"] if is_long(v)]
        used = {name.upper(): f"the variable {name} of the block" for name in own}
        found = {}
        for variable in (v for members in self.groups.values() for v in members):
            name = found[variable.name] = f"{variable.name}{'_value' * (variable.name.upper() in KEYWORDS)}"
            for part in (name, f"{name}_low")[: 1 + (variable.name in self.pairs)]:
                if other := used.get(part.upper()):
                    raise FrictionError(
                        f"{self.law.name}: {variable.name} and {other} have the same name in Structured Text, which "
                        f"ignores case; rename {variable.name} in {self.law.path.name}"
                    )
                used[part.upper()] = variable.name
        return found

    @property
    def taken(self) -> Iterable[str]:
        """Names that the variables of a function must not have."""
        names = [*self.names.values(), *self.locals, self.prefix, "violated"]
        return [*KEYWORDS, *names, *(f"{name}_low" for name in self.pairs)]

    def places(self, variable: LawVariable) -> list[str]:
        """Return the variable, or the elements of a vector."""
        name = self.names[variable.name]
        return [f"{name}[{i}]" for i in range(len(variable.starts))] if variable.kind in VECTORS else [name]

    def statements(self, *arguments: Any, **options: Any) -> Kernel:
        """Return the statements of a function, and keep their variables; see `Export.statements`."""
        found = super().statements(*arguments, **options)
        self.locals.update((name, Variable(name, kind, size)) for kind, name, size in found.locals)
        return found

    def body(self) -> list[str]:
        """Return the statements of a call, which correspond to ``PREFIX_check`` and ``PREFIX_step`` in C."""
        syntax, disables = self.real.syntax, bool(self.law.disabled()[1])
        count = len(self.law.conditions.texts)
        results = [place for v in self.law.select(Kind.OUTPUT) for place in (*self.places(v), *self.lows(v))]
        flags = ["valid", "rests", *(f"{v.name}_valid" for v in self.groups["parameters"] if is_long(v))]
        own = [*(Variable(name, "BOOL") for name in flags), *[Variable("holds", "BOOL", count)][:count]]
        own += [Variable(name, self.real.name) for name in ("sum", *(f"{place}_before" for place in results))]
        self.locals.update((v.name, v) for v in (*own, Variable(INDEX, syntax.integer)))

        checked = ["violated := 0;"]
        for i, (_, condition) in reversed([*enumerate(rules(self), start=1)]):
            checked = syntax.decision(
                plain(f"!({condition})" if " && " in condition else f"!{condition}"), [f"violated := {i};"], checked
            )
        total, loops, restart = overflow(self)
        missed = [syntax.increase(v.name, plain(self.real.literal(1.0)))[0] for v in self.law.given if v.tally]
        sample = [
            *(f"{place}_before := {place};" for place in results),
            *self.kernel.lines,
            *syntax.assignment("sum", plain(total)),
            *loops,
            *syntax.assignment("valid", plain(self.real.finite("sum"))),
            "rests := NOT valid;",
            *syntax.decision(plain("rests"), [*(f"{place} := {place}_before;" for place in results), *restart], []),
        ]
        return [
            *vectors_valid(self),
            *relations(self),
            *checked,
            *syntax.assignment("valid", plain(usable(self))),
            f"rests := NOT {self.names['enable']} AND NOT valid;" if disables else "rests := FALSE;",
            *syntax.decision(plain("valid"), sample, missed),
            *(syntax.decision(plain("rests"), at_rest(self), []) if disables else []),
            "fault := NOT valid;",
        ]

    def units(self) -> list[Unit]:
        """Return the functions that Structured Text lacks, and the function block."""
        body, texts = "\n".join(self.body()), functions(self.real.name)
        called: dict[str, None] = {}
        for name in reversed(texts):  # a function calls only functions before it
            if re.search(rf"_{name}\(", "".join([body, *(texts[user][1] for user in called)])):
                called[name] = None
        parameters, states, inputs, outputs = (
            [part for v in members for part in self._declared(v)] for members in self.groups.values()
        )
        outputs.append(Variable("violated", "DINT", text="0, or the number of the first violated rule"))
        largest = self.real.literal(min(self.real.largest, sys.float_info.max))
        sections = [
            *(("VAR_INPUT", inputs), ("VAR_INPUT", parameters), ("VAR_OUTPUT", outputs), ("VAR", states)),
            ("VAR CONSTANT", [Variable("largest", self.real.name, start=(largest,))]),
            ("VAR_TEMP", [*self.locals.values()]),
        ]
        calls = {name: "" for name in sorted({*re.findall(r"\b[A-Z]+\b(?=\()", body)} - {"ABS", "SEL", "SQRT"})}
        calls |= {f"{self.prefix}_{name}": f" ({texts[name][0]})" for name in called}
        block = Unit(self.prefix, "", self._title(calls), sections, body)
        return [*(_function(*texts[name], self.prefix) for name in texts if name in called), block]

    def _declared(self, variable: LawVariable) -> list[Variable]:
        """Return the declaration of a variable, and of its lower part."""
        name, starts = self.names[variable.name], self.start.get(variable.name, ())
        text = described(self, variable) + f"; {variable.name} in the equations" * (name != variable.name)
        kind = "BOOL" if is_flag(variable) else self.real.name
        size = len(variable.starts) if variable.kind in VECTORS else 0
        found = [Variable(name, kind, size, tuple(spelled(number(self, variable, value)) for value in starts), text)]
        if variable.name in self.pairs:
            lows = tuple(self.real.literal(value - float(np.float32(value))) for value in starts)
            found.append(Variable(f"{name}_low", kind, size, lows, f"{name} minus its value rounded to REAL"))
        return found

    def _title(self, calls: Mapping[str, str]) -> str:
        """Return the comment of the block, with the functions whose last digits may differ from those of C."""
        law, differs = self.law, ", ".join(f"{name}{how}" for name, how in calls.items()) or "none"
        return "\n".join(
            [
                f"{law.name}: {self.words.fill(law.summary)}\n\n{numbered(law.documentation)}\n\nSource: {law.source}",
                f"Generated by friction-fmus {VERSION} from {law.path.name}: change that file, not this one.\n",
                "Call the block every `Ts` seconds. The declared start values are those before the first call.",
                f"While an input {invalid(self)}, outputs and states are held, or at rest while `enable` is false.",
                "If a result overflows, the law is at rest. `fault` is then true.\n",
                f"`violated` is 0 if the parameters are valid, else {numbered_rules(self)}\n",
                f"Functions whose last digits may differ from those of C: {differs}.",
                "Switch off floating-point exceptions of the task: 1/0 must be infinity and must not stop the controller.",
                "Tested on a PC against the C export; not tried in TwinCAT, in CODESYS or on a controller.",
            ]
        )


def function_block(export: Export) -> FunctionBlock:
    """Return the function block of a law that is given as its export to C."""
    prefix = export.prefix
    if prefix.upper() in KEYWORDS:
        raise FrictionError(f"The prefix {prefix} is a keyword of Structured Text; choose another prefix")
    real = real_type(export.real, prefix)
    return FunctionBlock(export.law, real, prefix, export.start, export.rotary, export.table)


def _function(how: str, code: str, prefix: str) -> Unit:
    """Return a function of functions.st."""
    text = code.replace("PREFIX", prefix)
    name, returns = re.findall(r"FUNCTION (\w+) : (\w+)", text)[0]
    sections = [
        (keyword, [Variable(*declared) for declared in re.findall(r"(\w+) : (\w+);", rows)])
        for keyword, rows in re.findall(r"^(VAR\w*)$(.*?)^END_VAR$", text, re.DOTALL | re.MULTILINE)
    ]
    body = text.rpartition("END_VAR\n")[2].partition("\nEND_FUNCTION")[0]
    return Unit(name, returns, how, sections, body)


def structured_text(units: Iterable[Unit]) -> str:
    """Return the text of units."""
    lines = []
    for unit in units:
        kind, result = ("FUNCTION", f" : {unit.returns}") if unit.returns else ("FUNCTION_BLOCK", "")
        lines += [comment(unit.text), f"{kind} {unit.name}{result}"]
        for keyword, variables in unit.sections:
            lines += [keyword, *indented(map(_declaration, variables)), "END_VAR"] if variables else []
        lines += [unit.body, f"END_{kind}", ""]
    return "\n".join(lines)


def _declaration(variable: Variable) -> str:
    name, kind, size, start, text = variable
    runs = [(value, len([*equal])) for value, equal in groupby(start)]
    values = ", ".join(f"{count}({value})" if count > 1 else value for value, count in runs)
    value = f" := {f'[{values}]' if size else values}" if start else ""
    array = f"ARRAY[0..{size - 1}] OF " if size else ""
    return f"{name} : {array}{kind}{value};{f' {comment(text)}' if text else ''}"


_ELEMENTS = {"VAR_INPUT": "inputVars", "VAR_OUTPUT": "outputVars", "VAR_TEMP": "tempVars"}


def plcopen(units: Sequence[Unit]) -> str:
    """Return the units as PLCopen XML, TC6 version 2.01."""
    make = ElementMaker(
        namespace="http://www.plcopen.org/xml/tc6_0201", nsmap={None: "http://www.plcopen.org/xml/tc6_0201"}
    )
    html = ElementMaker(namespace="http://www.w3.org/1999/xhtml", nsmap={None: "http://www.w3.org/1999/xhtml"})

    def variable(v: Variable) -> etree._Element:
        kind = make(v.kind)
        values = [make.simpleValue(value=value) for value in v.start]
        if v.size:
            kind = make.array(make.dimension(lower="0", upper=str(v.size - 1)), make.baseType(kind))
            values = [make.arrayValue(*map(make.value, values))] if values else []
        parts = [make.type(kind), *map(make.initialValue, values)]
        parts += [make.documentation(html.xhtml(v.text))] if v.text else []
        return make.variable(*parts, name=v.name)

    def pou(unit: Unit) -> etree._Element:
        sections = [
            make(
                _ELEMENTS.get(keyword, "localVars"),
                *map(variable, variables),
                **{"constant": "true"} if "CONST" in keyword else {},
            )
            for keyword, variables in unit.sections
        ]
        returns = [make.returnType(make(unit.returns))] if unit.returns else []
        return make.pou(
            make.interface(*returns, *sections),
            make.body(make.ST(html.xhtml(unit.body))),
            make.documentation(html.xhtml(unit.text)),
            name=unit.name,
            pouType="function" if unit.returns else "functionBlock",
        )

    scaling = [make(name, make.scaling(x="1", y="1")) for name in ("fbd", "ld", "sfc")]
    root = make.project(
        make.fileHeader(
            companyName="", productName="friction-fmus", productVersion=VERSION, creationDateTime=build_time()
        ),
        make.contentHeader(make.coordinateInfo(*scaling), name=units[-1].name),
        make.types(make.dataTypes(), make.pous(*map(pou, units))),
        make.instances(make.configurations()),
    )
    text = etree.tostring(root, encoding="unicode", pretty_print=True)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{text}'
