"""A law as a function block of IEC 61131-3: Structured Text, and the same in a PLCopen XML file."""

import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from itertools import groupby
from pathlib import Path
from string import Template
from typing import NamedTuple

import numpy as np

from friction_fmus.codegen import sources
from friction_fmus.codegen.layout import Export, is_flag, numbered
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.emit.chains import INDEX
from friction_fmus.lawkit.emit.structured_text import KEYWORDS, _StructuredReal, functions, real_type, spelled
from friction_fmus.lawkit.emit.syntax import indented, plain
from friction_fmus.lawkit.law import VECTORS, Kind, LawVariable
from friction_fmus.version import VERSION, build_time


class Declaration(NamedTuple):
    """A variable of a function block or of a function."""

    name: str
    kind: str  # its type, of a vector the type of an element
    size: int = 0  # number of elements; 0 for a scalar
    start: tuple[str, ...] = ()  # start values as literals; none for zero
    text: str = ""  # comment


class Pou(NamedTuple):
    """A program organization unit: a function block or a function."""

    name: str
    returns: str  # type of a function; empty for a function block
    text: str  # documentation
    sections: Sequence[tuple[str, Sequence[Declaration]]]  # variables, with the keyword of their section
    body: str


@dataclass(frozen=True)
class FunctionBlock(Export):
    """A law with the settings of its export as a function block, whose variables replace the members of structs."""

    real: _StructuredReal

    @cached_property
    def names(self) -> dict[str, str]:
        """Names in the block by names in the law, with ``_value`` after keywords; also of its own variables."""
        own = ["valid", "rests", "sum", "holds", "violated", self.prefix]
        own += [f"{v.name}_valid" for v in self.groups["parameters"] if sources.is_long(v)]
        own += [f"{v.name}_before" for v in self.law.select(Kind.OUTPUT)]
        found = {name: name for name in own}
        used = {name.upper(): f"the variable {name} of the block" for name in own}
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
        names = [*self.names.values(), *self.real.locals]
        return [*KEYWORDS, *names, *(f"{name}_low" for name in names)]

    def places(self, variable: LawVariable) -> list[str]:
        """Return the variable, or the elements of a vector."""
        name = self.names[variable.name]
        return [f"{name}[{i}]" for i in range(len(variable.starts))] if variable.kind in VECTORS else [name]

    def body(self) -> list[str]:
        """Return the statements of a call, which correspond to ``PREFIX_check`` and ``PREFIX_step`` in C."""
        real, disables, count = self.real, bool(self.law.disabled()[1]), len(self.law.conditions.texts)
        results = [place for v in self.law.select(Kind.OUTPUT) for place in (*self.places(v), *self.lows(v))]
        if count:
            real.declared("BOOL", "holds", size=count)
        real.declared("DINT", INDEX)
        total, loops, restart = sources.overflow(self)
        held = [f"{place} := {place}_before;" for place in results]
        sample = [
            *(line for place in results for line in real.declared(real.name, f"{place}_before", plain(place))),
            *self.kernel.lines,
            *real.declared(real.name, "sum", plain(total)),
            *loops,
            *real.assignment("valid", plain(real.finite.format("sum"))),
            *real.decision(plain("!valid"), [*held, *restart], []),
            "rests := NOT valid;",
        ]
        missed = [f"{self.names[v.name]} := {self.names[v.name]} + 1.0;" for v in self.law.given if v.tally]
        disabled = f"!{self.names['enable']} && !valid" if disables else "false"
        return [
            *sources.vectors_valid(self),
            *sources.relations(self),
            *sources.checked(self),
            *real.declared("BOOL", "valid", plain(sources.usable(self))),
            *real.declared("BOOL", "rests", plain(disabled)),
            *real.decision(plain("valid"), sample, missed),
            *(real.decision(plain("rests"), sources.at_rest(self), []) if disables else []),
            "fault := NOT valid;",
        ]

    @cached_property
    def units(self) -> list[Pou]:
        """The functions that Structured Text lacks, and the function block."""
        body, texts = "\n".join(self.body()), functions(self.real.name)
        called: list[str] = []
        for name in reversed([*texts]):  # a function calls only functions before it
            if re.search(rf"_{name}\(", "".join([body, *(texts[user][1] for user in called)])):
                called.insert(0, name)
        parameters, states, inputs, outputs = (
            [part for v in members for part in self._declared(v)] for members in self.groups.values()
        )
        outputs.append(Declaration("violated", "DINT", text="0, or the number of the first violated rule"))
        largest = self.real.literal(min(self.real.largest, sys.float_info.max))
        sections = [
            *(("VAR_INPUT", inputs), ("VAR_INPUT", parameters), ("VAR_OUTPUT", outputs), ("VAR", states)),
            ("VAR CONSTANT", [Declaration("largest", self.real.name, start=(largest,))]),
            ("VAR_TEMP", [Declaration(name, kind, size) for name, (kind, size) in self.real.locals.items()]),
        ]
        calls = dict.fromkeys(sorted({*re.findall(r"\b[A-Z]+\b(?=\()", body)} - {"ABS", "SEL", "SQRT"}), "")
        calls |= {f"{self.prefix}_{name}": f" ({texts[name][0]})" for name in called}
        block = Pou(self.prefix, "", self._title(calls), sections, body)
        return [*(_function(*texts[name], self.prefix) for name in called), block]

    def _declared(self, variable: LawVariable) -> list[Declaration]:
        """Return the declaration of a variable, and of its lower part."""
        name, starts = self.names[variable.name], self.start.get(variable.name, ())
        text = sources.described(self, variable) + f"; {variable.name} in the equations" * (name != variable.name)
        kind = "BOOL" if is_flag(variable) else self.real.name
        size = len(variable.starts) if variable.kind in VECTORS else 0
        values = tuple(spelled(sources.number(self, variable, value)) for value in starts)
        paired = variable.name in self.pairs
        lows = tuple(self.real.literal(value - float(np.float32(value))) for value in starts if paired)
        low = Declaration(f"{name}_low", kind, size, lows, f"{name} minus its value rounded to REAL")
        return [Declaration(name, kind, size, values, text), low][: 1 + paired]

    def _title(self, calls: Mapping[str, str]) -> str:
        """Return the comment of the block, with the functions whose last digits may differ from those of C."""
        law = self.law
        return _template("function_block.txt").substitute(
            {"name": law.name, "source": law.source, "file": law.path.name, "version": VERSION},
            summary=self.words.fill(law.summary),
            documentation=numbered(law.documentation),
            invalid=sources.invalid(self),
            rules="\n".join(f"{i}: {text}" for i, (text, _) in enumerate(sources.rules(self), start=1)),
            functions=", ".join(f"{name}{how}" for name, how in calls.items()) or "none",
        )


def _template(name: str) -> Template:
    return Template((Path(__file__).parent / name).read_text(encoding="utf-8").rstrip())


def function_block(export: Export) -> FunctionBlock:
    """Return the function block of a law that is given as its export to C."""
    prefix = export.prefix
    if prefix.upper() in KEYWORDS:
        raise FrictionError(f"The prefix {prefix} is a keyword of Structured Text; choose another prefix")
    real = real_type(export.real, prefix)
    return FunctionBlock(export.law, real, prefix, export.start, export.rotary, export.table)


def _function(how: str, code: str, prefix: str) -> Pou:
    """Return a function of functions.st."""
    text = code.replace("PREFIX", prefix)
    name, returns = re.findall(r"FUNCTION (\w+) : (\w+)", text)[0]
    sections = [
        (keyword, [Declaration(*declared) for declared in re.findall(r"(\w+) : (\w+);", rows)])
        for keyword, rows in re.findall(r"^(VAR\w*)$(.*?)^END_VAR$", text, re.DOTALL | re.MULTILINE)
    ]
    return Pou(name, returns, how, sections, text.rpartition("END_VAR\n")[2].partition("\nEND_FUNCTION")[0])


def structured_text(export: FunctionBlock) -> str:
    """Return the text of ``PREFIX.st``."""
    lines, comment = [], export.real.comment
    for unit in export.units:
        kind, result = ("FUNCTION", f" : {unit.returns}") if unit.returns else ("FUNCTION_BLOCK", "")
        lines += [comment(unit.text), f"{kind} {unit.name}{result}"]
        for keyword, variables in unit.sections:
            rows = [_declaration(v) + (f" {comment(v.text)}" if v.text else "") for v in variables]
            lines += [keyword, *indented(rows), "END_VAR"] if rows else []
        lines += [unit.body, f"END_{kind}", ""]
    return "\n".join(lines)


def _declaration(variable: Declaration) -> str:
    name, kind, size, start, _ = variable
    runs = [(value, len([*equal])) for value, equal in groupby(start)]
    values = ", ".join(f"{count}({value})" if count > 1 else value for value, count in runs)
    value = f" := {f'[{values}]' if size else values}" if start else ""
    return f"{name} : {f'ARRAY[0..{size - 1}] OF ' if size else ''}{kind}{value};"


_ELEMENTS = {"VAR_INPUT": "inputVars", "VAR_OUTPUT": "outputVars", "VAR_TEMP": "tempVars", "VAR": "localVars"}
_ELEMENTS |= {"VAR CONSTANT": 'localVars constant="true"'}


def plcopen(export: FunctionBlock) -> str:
    """Return the text of ``PREFIX.xml``, in the format TC6 2.01 of PLCopen."""
    given = {"name": export.prefix, "version": VERSION, "time": build_time(), "units": "".join(map(_pou, export.units))}
    return _template("plcopen.xml").substitute(given)


def _pou(unit: Pou) -> str:
    returns = f"<returnType><{unit.returns}/></returnType>" if unit.returns else ""
    kind = "function" if returns else "functionBlock"
    sections = ""
    for keyword, variables in unit.sections:
        element, _, attribute = _ELEMENTS[keyword].partition(" ")
        sections += f"\n<{element} {attribute}>{''.join(map(_xml_variable, variables))}\n</{element}>"
    return f"""
<pou name="{unit.name}" pouType="{kind}"><interface>{returns}{sections}
</interface><body><ST>{_xhtml(unit.body)}</ST></body><documentation>{_xhtml(unit.text)}</documentation></pou>"""


def _xml_variable(variable: Declaration) -> str:
    name, kind, size, start, text = variable
    single, values = f"<{kind}/>", [f'<simpleValue value="{value}"/>' for value in start]
    if size:
        single = f'<array><dimension lower="0" upper="{size - 1}"/><baseType>{single}</baseType></array>'
        values = [f"<arrayValue>{''.join(f'<value>{v}</value>' for v in values)}</arrayValue>"] if values else []
    initial = "".join(f"<initialValue>{value}</initialValue>" for value in values)
    note = f"<documentation>{_xhtml(text)}</documentation>" if text else ""
    return f'\n<variable name="{name}"><type>{single}</type>{initial}{note}</variable>'


def _xhtml(text: str) -> str:
    return f'<xhtml xmlns="http://www.w3.org/1999/xhtml">{escape(text, quote=False)}</xhtml>'
