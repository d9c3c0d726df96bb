"""A law as a function block of IEC 61131-3: Structured Text, and the same in a PLCopen XML file."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from itertools import groupby
from pathlib import Path
from string import Template

import numpy as np

from friction_fmus.codegen import sources
from friction_fmus.codegen.layout import Export, is_flag, numbered
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.emit.chains import INDEX
from friction_fmus.lawkit.emit.structured_text import KEYWORDS, STANDARD, _StructuredReal, functions, real_type, spelled
from friction_fmus.lawkit.emit.syntax import indented, plain
from friction_fmus.lawkit.law import VECTORS, Kind, LawVariable
from friction_fmus.version import VERSION, build_time


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
        return variable.places(self.names[variable.name])

    def body(self) -> list[str]:
        """Return the statements of a call, which correspond to ``PREFIX_check`` and ``PREFIX_step`` in C."""
        real, disables, count = self.real, bool(self.law.disabled()[1]), len(self.law.conditions.texts)
        results = [place for v in self.law.select(Kind.OUTPUT) for place in (*self.places(v), *self.lows(v))]
        if count:
            real.declared("BOOL", "holds", size=count)
        real.declared("DINT", INDEX)
        total, loops, restart = sources.overflow(self)
        held = [f"{place} := {place}_before;" for place in results]
        rest = ["rests := NOT valid;"] if disables else []
        sample = [
            *(line for place in results for line in real.declared(real.name, f"{place}_before", plain(place))),
            *self.kernel.lines,
            *real.declared(real.name, "sum", plain(total)),
            *loops,
            *real.assignment("valid", plain(real.finite.format("sum"))),
            *real.decision(plain("!valid"), [*held, *restart], []),
            *rest,
        ]
        missed = [f"{self.names[v.name]} := {self.names[v.name]} + 1.0;" for v in self.law.given if v.tally]
        return [
            *sources.vectors_valid(self),
            *sources.relations(self),
            *sources.checked(self),
            *real.declared("BOOL", "valid", plain(sources.usable(self))),
            *(real.declared("BOOL", "rests", plain(f"!{self.names['enable']} && !valid")) if disables else []),
            *real.decision(plain("valid"), sample, missed),
            *(real.decision(plain("rests"), sources.at_rest(self), []) if disables else []),
            "fault := NOT valid;",
        ]

    @cached_property
    def text(self) -> str:
        """The text of ``PREFIX.st``: the functions that Structured Text lacks, and the function block."""
        texts, real = functions(self.real.name), self.real
        body, table = "\n".join(self.body()), self._table_function()
        called: list[str] = []
        for name in reversed([*texts]):  # a function calls only functions before it
            if re.search(rf"_{name}\(", "".join([body, table, *(texts[user][1] for user in called)])):
                called.insert(0, name)
        calls = {name: "" for name in STANDARD if re.search(rf"\b{name}\(", body)}
        calls |= {f"{self.prefix}_{name}": f" ({texts[name][0]})" for name in called}
        before = [f"(* {how} *)\n{code}" for how, code in (texts[name] for name in called)] + [table] * bool(table)
        parameters, states, inputs, outputs = (
            [row for v in members for row in self._declared(v)] for members in self.groups.values()
        )
        outputs.append(self._row("violated", "DINT", text="0, or the number of the first violated rule"))
        largest = self._row("largest", real.name, start=[f"{real.name}#{'3.4E38' if real.bound else '1.79E308'}"])
        own = [self._row(name, kind, size) for name, (kind, size) in real.locals.items()]
        lines = [real.comment(self._title(calls)), f"FUNCTION_BLOCK {self.prefix}"]
        sections = {"VAR_INPUT": inputs + parameters, "VAR_OUTPUT": outputs, "VAR": states}
        sections |= {"VAR CONSTANT": [largest], "VAR_TEMP": own}
        for keyword, rows in sections.items():
            lines += [keyword, *indented(rows), "END_VAR"] if rows else []
        return "\n".join([*before, *lines, body, "END_FUNCTION_BLOCK", ""]).replace("PREFIX_", f"{self.prefix}_")

    def _declared(self, variable: LawVariable) -> list[str]:
        """Return the declaration of a variable, and of its lower part."""
        name, starts = self.names[variable.name], self.start.get(variable.name, ())
        text = sources.described(self, variable) + f"; {variable.name} in the equations" * (name != variable.name)
        kind = "BOOL" if is_flag(variable) else self.real.name
        size = len(variable.starts) if variable.kind in VECTORS else 0
        found = [self._row(name, kind, size, [spelled(sources.number(self, variable, v)) for v in starts], text)]
        if variable.name in self.pairs:
            lows = [self.real.literal(value - float(np.float32(value))) for value in starts]
            found.append(self._row(f"{name}_low", kind, size, lows, f"{name} minus its value rounded to REAL"))
        return found

    def _row(self, name: str, kind: str, size: int = 0, start: Sequence[str] = (), text: str = "") -> str:
        """Return a declaration."""
        runs = [(value, len([*equal])) for value, equal in groupby(start)]
        values = ", ".join(f"{count}({value})" if count > 1 else value for value, count in runs)
        value = f" := {f'[{values}]' if size else values}" if start else ""
        array = f"ARRAY[0..{size - 1}] OF " if size else ""
        return f"{name} : {array}{kind}{value};{f' {self.real.comment(text)}' if text else ''}"

    def _table_function(self) -> str:
        """Return the function that computes the table of a loop; empty if it has none."""
        if not self.table:
            return ""
        if self.real.bound:
            raise FrictionError(f"{self.law.path.name} has a table over position, which needs LREAL: omit --real float")
        grid, literal = self.table.grid, self.real.literal
        span = grid.nodes if grid.periodic else grid.nodes - 1
        along = f"r_value - {literal(grid.begin)}" if grid.begin >= 0.0 else f"r_value + {literal(-grid.begin)}"
        start = [f"place := ({along}) / {literal(grid.spacing)};"]
        if grid.periodic:
            start = [f"place := PREFIX_fmod({along}, {literal(span * grid.spacing)}) / {literal(grid.spacing)};"]
            start += [f"IF place < 0.0 THEN\n    place := place + {span}.0;\nEND_IF;"]

        def nodes(column: Sequence[float]) -> str:  # with one node before, and one or two after the table
            before, after = [2.0 * column[0] - column[1]], [2.0 * column[-1] - column[-2]]
            if grid.periodic:
                before, after = [column[-1]], [*column[:2]]
            return ", ".join(map(literal, [*before, *column, *after]))

        return _template("table.st").substitute(
            {"span": span, "last": span + 2, "v_sign": literal(self.table.v_sign), "start": "\n".join(start)},
            force=self.words.force,
            unit=self.words.N,
            cogging=nodes(self.table.cogging),
            friction=nodes(self.table.friction),
        )

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


_POU = r"^\(\* (.*?) \*\)\nFUNCTION(\w*) (\w+)(?: : (\w+))?\n((?:VAR.*?^END_VAR\n)+)(.*?)\nEND_FUNCTION\2$"
_SECTION = r"^VAR(\w*)( CONSTANT)?\n(.*?)^END_VAR$"
_ROW = r"^    (\w+) : (?:ARRAY\[0\.\.(\d+)\] OF )?(\w+)(?: := \[?(.*?)\]?)?;(?: \(\* (.*) \*\))?$"
_FLAGS = re.DOTALL | re.MULTILINE


def plcopen(text: str) -> str:
    """Return a text of Structured Text as PLCopen XML, TC6 version 2.01."""
    pous = re.findall(_POU, text, _FLAGS)
    given = {"name": pous[-1][2], "version": VERSION, "time": build_time(), "units": "".join(map(_pou, pous))}
    return _template("plcopen.xml").substitute(given)


def _pou(found: Sequence[str]) -> str:
    text, block, name, returns, declared, body = found
    sections = f"<returnType><{returns}/></returnType>" if returns else ""
    for kind, constant, rows in re.findall(_SECTION, declared, _FLAGS):
        element, attribute = f"{kind.strip('_').lower() or 'local'}Vars", ' constant="true"' if constant else ""
        variables = "".join(map(_variable, re.findall(_ROW, rows, re.MULTILINE)))
        sections += f"\n<{element}{attribute}>{variables}</{element}>"
    return f"""
<pou name="{name}" pouType="{"functionBlock" if block else "function"}"><interface>{sections}</interface>
<body><ST>{_xhtml(body)}</ST></body><documentation>{_xhtml(text)}</documentation></pou>"""


def _variable(found: Sequence[str]) -> str:
    name, last, kind, start, text = found
    kind, initial = f"<{kind}/>", f'<simpleValue value="{start}"/>'
    if last:
        kind = f'<array><dimension lower="0" upper="{last}"/><baseType>{kind}</baseType></array>'
        runs = re.findall(r"(?:(\d+)\()?([^(), ]+)", start)
        values = (f'<value repetitionValue="{count or 1}"><simpleValue value="{v}"/></value>' for count, v in runs)
        initial = f"<arrayValue>{''.join(values)}</arrayValue>"
    initial = f"<initialValue>{initial}</initialValue>" if start else ""
    note = f"<documentation>{_xhtml(text)}</documentation>" if text else ""
    return f'\n<variable name="{name}"><type>{kind}</type>{initial}{note}</variable>'


def _xhtml(text: str) -> str:
    return f'<xhtml xmlns="http://www.w3.org/1999/xhtml">{escape(text, quote=False)}</xhtml>'
