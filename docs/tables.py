"""Tables that follow from blocks and masters; the site has them at ``<!-- table: name -->`` in its pages."""

from __future__ import annotations

import argparse
import inspect
import re
from collections.abc import Iterable, Sequence
from functools import cache
from importlib import import_module
from itertools import pairwise
from pathlib import Path

from needs import KNOWLEDGE, MEASURED, MOTIONS, QUESTIONS, REFERENCE, SITUATIONS, SWITCHES, Motion, Question, Situation

from friction_fmus.blocks.catalogue import FEATURES, Block, catalogue
from friction_fmus.blocks.macros import INDENT, Paragraph, paragraphs
from friction_fmus.blocks.probe import (
    BOOLEAN,
    FIXED,
    INPUT,
    OUTPUT,
    PARAMETER,
    STATE,
    STATE_OUTPUT,
    BlockVariable,
    BlockVariables,
)
from friction_fmus.cli.main import parser
from friction_fmus.export.block_fmu import describe_block
from friction_fmus.fmi.model_description import CAPABILITIES, ROLE
from friction_fmus.identification.data.formats import modules as data_formats
from friction_fmus.reference.case import CASES, read_cases
from harness.masters import master_names

DOCS = Path(__file__).parent


# ---- what the blocks say --------------------------------------------------------------------------------------------


@cache
def described(name: str) -> BlockVariables:
    """Return the variables of a block of the catalogue."""
    return describe_block(catalogue()[name])


MEANINGS = {
    "canHandleVariableCommunicationStepSize": "Communication steps may have any length and may vary.",
    "canInterpolateInputs": "Inputs may have a first derivative; they then vary linearly during a step.",
    "maxOutputDerivativeOrder": "First time derivatives of the outputs are available at the end of a step.",
    "canNotUseMemoryManagementFunctions": "Several instances can run in one process; a step allocates no memory.",
    "canGetAndSetFMUstate": "The state can be saved and restored, so that steps can be repeated.",
    "canSerializeFMUstate": "The saved state can be written to a file.",
    "providesDirectionalDerivative": "Directional derivatives are available, for implicit masters.",
}
"""What a capability of an FMU means for a user."""


def inputs(name: str) -> frozenset[str]:
    """Return its inputs without the switches."""
    return frozenset(v.name for v in _inputs(name))


def required(name: str) -> frozenset[str]:
    """Return its inputs without the switches and those that may stay unconnected."""
    return frozenset(v.name for v in _inputs(name) if not v.text.startswith("optional"))


def _inputs(name: str) -> list[BlockVariable]:
    return [v for v in described(name).variables if v.role == INPUT and v.name not in SWITCHES]


def of_kind(*kinds: str) -> list[Block]:
    """Return the blocks of these kinds, in the order of the catalogue."""
    return [block for block in catalogue().values() if block.kind in kinds]


def knowledge(name: str) -> str:
    """Return the kind of friction model in a compensator, of `KNOWLEDGE`, by the names of its parameters."""
    names = {v.name for v in described(name).variables if v.role in (PARAMETER, FIXED)}
    if not names & {"Fc", "Fc0"}:
        return "none"
    return "presliding" if names & {"sigma", "sigma0", "sigma1", "alpha[1]"} else "static"


def suited_models(motion: Motion) -> list[str]:
    """Return the friction models for a motion."""
    return [
        block.name
        for block in of_kind("friction")
        if motion.shows <= set(block.features) and not motion.without & set(block.features)
    ]


def answering_models(question: Question) -> list[str]:
    """Return the friction models for a need."""
    return [
        block.name
        for block in of_kind("friction")
        if question.shows <= set(block.features) and question.inputs <= inputs(block.name)
    ]


def choices(row: Motion | Question | Situation) -> list[str]:
    """Return the blocks that a row recommends, best first."""
    return row.blocks.split()


def begin(situation: Situation) -> list[str]:
    """Return the recommended compensators."""
    return choices(situation)[: situation.first]


def suited_compensators(situation: Situation) -> list[str]:
    """Return the compensators that need no other signals than those of a situation, and no other friction model."""
    return [
        block.name
        for block in of_kind("compensator")
        if required(block.name) <= situation.signals and knowledge(block.name) in situation.model
    ]


def finding(script: str) -> str:
    """Return the title of a script's section in docs/effects.md, as a link to it."""
    for section in re.split(r"^### ", (DOCS / "effects.md").read_text(encoding="utf-8"), flags=re.M)[1:]:
        if f"(figures/{script}.png)" in section:
            title = section.splitlines()[0]
            return f"[{title}](effects.md#{slug(title)})"
    raise LookupError(f"effects.md does not show {script}")


def slug(title: str) -> str:
    """Return the anchor of a heading."""
    return re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", title.lower())).strip("-")


# ---- the tables -----------------------------------------------------------------------------------------------------


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def bold(names: Iterable[str]) -> str:
    """Return names in bold."""
    return ", ".join(f"**{name}**" for name in names)


def model_link(name: str) -> str:
    """Return a link to a friction model in docs/models.md."""
    return f"[{name}](models.md#{name.lower()})"


def motions() -> str:
    """Return the friction models by motion."""
    return table(
        ("A / x_p", "speed", "reversals", "recommended", "what it shows", "alternatives"),
        [
            (
                m.amplitude,
                m.speed,
                m.reversals,
                bold(map(model_link, choices(m))),
                ", ".join(feature for feature in FEATURES if feature in m.shows) or "–",
                ", ".join(model_link(name) for name in suited_models(m) if name not in choices(m)),
            )
            for m in MOTIONS
        ],
    )


def reasons() -> str:
    """Return the reasons for these models: the effects that scripts show."""
    found: dict[str, list[str]] = {}
    for m in MOTIONS:
        found.setdefault(m.found, []).extend(choices(m))
    return "\n".join(f"* **{', '.join(names)}**: {finding(target)}" for target, names in found.items())


def questions() -> str:
    """Return the friction models by other needs."""
    return table(
        ("you need", "recommended", "alternatives"),
        [
            (
                q.need,
                bold(map(model_link, choices(q))),
                others(q),
            )
            for q in QUESTIONS
        ],
    )


def others(question: Question) -> str:
    """Return the alternatives for a need; those that only need an input are too many to list."""
    rest = [name for name in answering_models(question) if name not in choices(question)]
    if question.inputs and rest:
        return f"every model with the input {', '.join(f'`{name}`' for name in sorted(question.inputs))}"
    return ", ".join(map(model_link, rest)) or "–"


def situations() -> str:
    """Return the compensators by what is known and measured."""
    return table(
        ("known and measured", "recommended", "alternatives", "effect"),
        [
            (
                s.known,
                bold(begin(s)),
                ", ".join(name for name in choices(s) if name not in begin(s)) or "–",
                finding(s.found),
            )
            for s in SITUATIONS
        ],
    )


def compensators() -> str:
    """Return the inputs, the friction model and the use of each compensator."""
    rows = []
    for block in of_kind("compensator"):
        taken = inputs(block.name)
        first = next((p.text for p in paragraphs(block.notes) if p.lead == "Use it"), block.summary)
        use = re.split(r"(?<=[a-z0-9])[.;:] ", first, maxsplit=1)[0].rstrip(".")
        other = sorted(taken - set(REFERENCE) - set(MEASURED))
        rows.append(
            (
                f"**{block.name}**",
                " ".join(name for name in REFERENCE if name in taken) or "–",
                " ".join(name for name in MEASURED if name in taken) or "–",
                " ".join(other) or "–",
                KNOWLEDGE[knowledge(block.name)],
                (use[:1].upper() + use[1:]).replace("|", "\\|"),
            )
        )
    return table(("compensator", "reference", "measured", "other inputs", "friction model", "when to use it"), rows)


def capabilities() -> str:
    """Return the attributes of the element CoSimulation, the same for every block."""
    return table(
        ("attribute", "value", "what it means"),
        [(f"`{name}`", f"`{value}`", MEANINGS[name]) for name, value in CAPABILITIES.items()],
    )


def exchange() -> str:
    """Return the blocks that are for co-simulation only."""
    rows = [(f"`{block.name}`", block.no_exchange) for block in catalogue().values() if block.no_exchange]
    return table(("block", "why not model exchange"), rows)


def kinds() -> str:
    """Return what modelDescription.xml says of the variables of each kind of block."""
    rows = []
    for kind in ("friction", "plant", "compensator", "signal"):
        blocks = of_kind(kind)
        variables = [v for block in blocks for v in described(block.name).variables]
        sampled = {described(block.name).sampled for block in blocks}
        rows.append(
            (
                kind,
                str(len(blocks)),
                " or ".join({True: "sampled", False: "continuous"}[s] for s in sorted(sampled)),
                " or ".join("discrete" if s else "continuous" for s in sorted(sampled)),
                _types(v.type for v in variables if v.role == INPUT),
                _types(v.type for v in variables if v.role in (OUTPUT, STATE_OUTPUT)),
                _count(sum(v.role in (STATE, STATE_OUTPUT) for v in described(b.name).variables) for b in blocks),
                "yes" if any(v.role == FIXED for v in variables) else "no",
            )
        )
    heads = ("kind", "blocks", "how it steps", "Real outputs are", "inputs", "outputs", "states", "fixed parameters")
    return table(heads, rows)


def _types(types: Iterable[int]) -> str:
    found = set(types)
    return ", ".join(name for number, name in ((0, "Real"), (1, "Integer"), (BOOLEAN, "Boolean")) if number in found)


def _count(numbers: Iterable[int]) -> str:
    found = sorted(numbers)
    return f"{found[0]} to {found[-1]}" if found[0] != found[-1] else str(found[0])


def roles() -> str:
    """Return causality, variability and initial of the variables."""
    rows = []
    for causality, variability, initial in dict.fromkeys(ROLE.values()):
        sampled = ", in sampled blocks `discrete`" if causality in ("output", "local") else ""
        rows.append((f"`{causality}`", f"`{variability}`{sampled}", f"`{initial}`" if initial else "–"))
    return table(("causality", "variability", "initial"), rows)


def models() -> str:
    """Return the features of friction models, then what each model is, its use, limits and equations."""
    legend = [f"* **{name}**: {meaning}" for name, meaning in FEATURES.items()]
    return "\n".join([*legend, "", *map(_section, of_kind("friction"))])


def _section(block: Block) -> str:
    first, *rest = paragraphs(block.notes)
    leads = [paragraph for paragraph in rest if paragraph.lead]
    parts = [markdown(paragraph) for paragraph in (first, *leads, *_equations(rest))]
    return "\n\n".join([f"## {block.name}", *parts, f"Source: {block.origin}."]) + "\n"


def markdown(paragraph: Paragraph) -> str:
    """Return a paragraph of the notes of a block in Markdown."""
    if paragraph.equations:
        return "\n".join(["```text", *(INDENT + line for line in paragraph.lines), "```"])
    lead = f"**{paragraph.lead}** " if paragraph.lead else ""
    written = "\n  ".join(paragraph.lines) if paragraph.item else "\n".join(paragraph.lines)
    return ("- " if paragraph.item else lead) + written.replace("*", "\\*").replace("|", "\\|")


def _equations(notes: Sequence[Paragraph]) -> list[Paragraph]:
    """Return the equations, each with the paragraph after it that explains them, unless it is about the steps."""
    shown: list[Paragraph] = []
    for before, paragraph in pairwise((Paragraph(()), *notes)):
        numerics = re.search(r"\bsteps?\b", " ".join(paragraph.lines))
        if paragraph.equations or (before.equations and not paragraph.lead and not numerics):
            shown.append(paragraph)
    return shown


def masters() -> str:
    """Return the master algorithms, as their files describe them."""
    rows = []
    for name in master_names():
        first, *rest = inspect.getdoc(import_module(f"harness.masters.{name.replace('-', '_')}")).split("\n\n")
        use = next(text.removeprefix("Use it for ") for text in rest if text.startswith("Use it for "))
        rows.append((f"`{name}`", " ".join(first.split()).partition(": ")[2], " ".join(use.split()).rstrip(".")))
    return table(("master", "a communication step", "use it for"), rows)


def formats() -> str:
    """Return the formats of data files, as their modules describe them."""
    rows = []
    for module in data_formats():
        suffixes = ", ".join(f"`{suffix}`" for suffix in module.SUFFIXES) or "any text"
        rows.append(f"* {suffixes}: {str(inspect.getdoc(module)).replace('``', '`')}")
    return "\n".join(rows)


def commands() -> str:
    """Return the commands with what they do, as their help says."""
    (group,) = (action for action in parser()._actions if isinstance(action, argparse._SubParsersAction))
    return table(("command", "what it does"), [(f"`{each.dest}`", str(each.help)) for each in group._choices_actions])


def cases() -> str:
    """Return the cases of the reference set."""
    kinds = {"cs": "co-simulation", "me": "model exchange", "ssp": "SSP"}
    rows = []
    for case in read_cases(CASES):
        kind = "calls" if case.call else kinds[case.kind]
        title = re.sub(r"^(Model exchange|FMI 3\.0|SSP|FMI 3\.0 model exchange): ", "", case.title)
        rows.append((f"`{case.name}`", title[:1].upper() + title[1:], f"FMI {case.fmi}, {kind}"))
    return table(("case", "what is tested", "interface"), rows)


_OF_BLOCKS = (motions, reasons, questions, situations, compensators, capabilities, exchange, kinds, roles, models)
TABLES = {f.__name__: f for f in (*_OF_BLOCKS, masters, formats, commands, cases)}


def filled(text: str) -> str:
    """Return a page with its tables."""
    return re.sub(r"<!-- table: (\w+) -->", lambda found: TABLES[found[1]](), text)
