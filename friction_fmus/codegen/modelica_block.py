"""A law as a sampled block of the Modelica library, whose external object has the exported C."""

import math
import re
from collections.abc import Iterable
from html import escape
from string import Template
from textwrap import fill

from friction_fmus.blocks.axis_units import SLIDING, TURNING, Words
from friction_fmus.blocks.catalogue import source_folder
from friction_fmus.codegen.layout import Export, is_flag
from friction_fmus.codegen.sources import header, implementation, unit_text
from friction_fmus.fmi.documentation import notes_as_html
from friction_fmus.lawkit.declarations import VECTORS, Kind, LawVariable

KEYWORDS = """algorithm and annotation block class connect connector constant constrainedby der discrete each elseif
elsewhen encapsulated end enumeration equation expandable external final flow function import impure initial inner input
loop model not operator or outer output package parameter partial protected public pure record redeclare replaceable
stream then type when within"""

PORT = "Modelica.Blocks.Interfaces."


def c_header(export: Export) -> str:
    """Return the text of a C header with the law; its functions are static, so that any files may include it."""
    p, groups = export.prefix, export.groups
    text = header(export).rpartition("#endif")[0] + implementation(export).partition("\n")[2]
    text = re.sub(r"/\* If \S+\.c is compiled.*?\*/\n\n", "", text, flags=re.DOTALL)
    text = re.sub(r"^(static )?(?=(void|int32_t) \w+\()", "static inline ", text, flags=re.MULTILINE)
    text = re.sub(r"\b(sample|disable|relations)\(", rf"{p}_\1(", text)
    arguments, assignments = [], []
    for v in (*groups["parameters"], *groups["inputs"]):
        to, size = f"{'parameters' if v in groups['parameters'] else 'inputs'}.{v.name}", _size(v)
        arguments.append(f"{'int ' if is_flag(v) else 'const double *' if size else 'double '}{v.name}")
        value = f"    {to} = {v.name}{' != 0' * is_flag(v)};"
        assignments.append(f"    memcpy({to}, {v.name}, sizeof {to});" if size else value)
    arguments += [f"{'int' if is_flag(v) else 'double'} *{v.name}" for v in groups["outputs"]]
    results = [f"    *{v.name} = memory->outputs.{v.name};" for v in groups["outputs"]]
    return text + _template("object").substitute(
        p=p, arguments=", ".join(arguments), assignments="\n".join(assignments), results="\n".join(results)
    )


def block(export: Export) -> str:
    """Return the text of the block, with the units of a linear axis."""
    p, law, (parameters, _, inputs, outputs) = export.prefix, export.law, export.groups.values()
    given = (*parameters, *inputs)
    optional = {v: f"use{v.name[0].upper()}{v.name[1:]}" for v in inputs if v.kind is not Kind.INPUT}
    declarations = [_declared(f"parameter {_type(v)}", v, f" = {_value(v)}") + ";" for v in parameters]
    held, equations = [], []
    for v, use in optional.items():
        text = f'{use} = false "true: {v.name} is an input; false: it is {_value(v)}"'
        declarations.append(f"  parameter Boolean {text} annotation(Evaluate = true, choices(checkBox = true));")
        held.append(f'  {PORT}{_type(v)}Input {v.name}_ "{v.name}, also if it is not an input";')
        equations.append(f"  connect({_name(v)}, {v.name}_);")
        equations.append(f"  if not {use} then\n    {v.name}_ = {_value(v)};\n  end if;")
    for side, x, ports in (("Input", -110, inputs), ("Output", 110, outputs)):
        for i, v in enumerate(ports):
            place = f"extent = {{{{-10, -10}}, {{10, 10}}}}, origin = {{{x}, {90 - 180 * i // max(1, len(ports) - 1)}}}"
            declarations.append(_declared(f"{PORT}{_type(v)}{side}", v, f" if {optional[v]}" if v in optional else ""))
            declarations.append(f"    annotation(Placement(transformation({place})));")
    ranges = len([v for v in parameters if not is_flag(v)])  # the first rules of `check`
    rules = {f"violated < 1 or violated > {ranges}": "A parameter is not finite, or outside its range"}
    for number, rule in enumerate(law.conditions.texts, ranges + 1):
        rules[f"violated <> {number}"] = f"The parameters must satisfy {rule}"
    equations += [f"  assert({condition}, {_string(sentence)});" for condition, sentence in rules.items()]
    arguments = [f"    input {_type(v)} {_name(v)}{_size(v)};" for v in given]
    arguments += ["    output Integer violated;", *(f"    output {_type(v)} {_name(v)};" for v in outputs)]
    folder = "modelica://FrictionFMUs/Resources/Include"
    return _template("block").substitute(
        {"p": p, "name": law.name, "summary": _string(law.summary), "source": escape(law.source)},
        include=f'annotation(Include = "#include \\"{p}.h\\"", IncludeDirectory = "{folder}")',
        declarations="\n".join(declarations),
        held="\n".join(held),
        equations="\n".join(equations),
        arguments="\n".join(arguments),
        called=_listed(map(_name, (*given, *outputs))),
        results=", ".join(map(_name, outputs)),
        values=_listed(f"{v.name}_" if v in optional else _name(v) for v in given),
        documentation=notes_as_html(law.documentation).replace("\\", "\\\\"),
    )


def rotational(export: Export) -> str:
    """Return the same block with the units of a rotary axis."""
    variables = [v for group in ("parameters", "inputs", "outputs") for v in export.groups[group]]
    units = {v: unit_text(v, rotary=True) for v in variables if unit_text(v, rotary=True) != unit_text(v)}
    changed = [f'{_name(v)}({"each " * bool(_size(v))}unit = "{unit}")' for v, unit in units.items()]
    name, summary = export.law.name, _string(export.law.summary, TURNING)
    return f"\n  block {name} = Compensators.{name}({_listed(changed)}) {summary};\n"


def _template(name: str) -> Template:
    return Template((source_folder() / "modelica" / "Compensators" / f"{name}.template").read_text(encoding="utf-8"))


def _name(v: LawVariable) -> str:
    return f"'{v.name}'" if v.name in KEYWORDS.split() else v.name


def _type(v: LawVariable) -> str:
    return "Boolean" if is_flag(v) else "Real"


def _size(v: LawVariable) -> str:
    return f"[{len(v.starts)}]" if v.kind in VECTORS else ""


def _value(v: LawVariable) -> str:
    values = ", ".join(str(bool(value)).lower() if is_flag(v) else repr(value) for value in v.starts)
    return f"{{{values}}}" if v.kind in VECTORS else values


def _declared(kind: str, v: LawVariable, more: str) -> str:
    """Return a declaration with attributes, more, and the description."""
    each, unit = "each " * bool(_size(v)), unit_text(v)
    attributes = [f'{each}unit = "{unit}"'] if unit else []
    limits = (("min", v.min), ("max", v.max))
    attributes += [f"{each}{end} = {limit!r}" for end, limit in limits if math.isfinite(limit)]
    listed = f"({', '.join(attributes)})" if attributes else ""
    return f"  {kind} {_name(v)}{_size(v)}{listed}{more} {_string(v.text)}"


def _string(text: str, words: Words = SLIDING) -> str:
    escaped = words.fill(text).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _listed(parts: Iterable[str]) -> str:
    return fill(", ".join(parts), 112, initial_indent="\n      ", subsequent_indent=" " * 6, break_on_hyphens=False)
