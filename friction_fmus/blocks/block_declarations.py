"""Declarations next to the equations in a block's file, used by its page, the study and the identification."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Final

from friction_fmus.blocks import USES
from friction_fmus.blocks.arithmetic import names_in
from friction_fmus.blocks.contact import Friction, Identified, friction_of, identified
from friction_fmus.blocks.macros import macro, string, table, words
from friction_fmus.errors import FrictionError, did_you_mean

FILE = Path(__file__).with_name("bibliography.bib")


@cache
def bibliography() -> dict[str, str]:
    """Return the entries of ``bibliography.bib`` by key."""
    entries = re.findall(r"^(@\w+\{(\w+),.*?^\})$", FILE.read_text(encoding="utf-8"), re.M | re.S)
    return {key: entry for entry, key in entries}


def cited(keys: Iterable[str]) -> tuple[str, ...]:
    """Return the entries that a block cites."""
    known = bibliography()
    found = []
    for key in keys:
        if not key.startswith("@") and key not in known:
            raise FrictionError(
                f"the block cites {key!r}, which is not in bibliography.bib{did_you_mean(key, known)}; correct it, "
                "or give the BibTeX entry itself"
            )
        found.append(known.get(key, key))
    return tuple(found)


@dataclass(frozen=True)
class Use:
    """Use of a law or controller as a compensator that is added to a servo."""

    kind: str  # one of `USES`
    models: tuple[str, ...] = ()
    """Friction models in order of preference; the law gets the parameters of the first identified one, by name. Empty
    if it needs no model."""
    renamed: Mapping[str, str] = field(default_factory=dict)
    """Parameters of the law that have another name in the model: model name to law name."""
    tuned: Mapping[str, str] = field(default_factory=dict)
    """Expressions for further parameters, in terms of the model's parameters and of known data of the axis, see
    `friction_fmus.study.compensators.AxisKnowledge`. ``W[i]`` stands for all elements of a vector."""
    output: str = "u"  # the output that is added to the force of the servo
    never: str = ""  # A sentence that explains why the law is excluded from the comparison; empty if it is not excluded
    period: str = ""
    """Parameter for the period of the reference in samples; empty if the reference need not be periodic."""
    rule: str = ""  # further condition on the loop, a key of `friction_fmus.study.loop_conditions.RULES`
    linear: str = ""
    """For an estimator in C: the function of `friction_fmus.study.margins` that returns its linear part."""

    def __post_init__(self) -> None:
        """Raise an error for an unknown kind or a text that is not an expression."""
        if self.kind not in USES:
            raise FrictionError(f"{self.kind!r} is not a kind of compensator{did_you_mean(self.kind, USES)}")
        for text in self.tuned.values():
            names_in(text)


def replaces_servo(kind: str) -> Use:
    """Return the use of a law that closes the position loop itself."""
    return Use(kind, never="It replaces the feedback controller and cannot be compared at the same feedback gains.")


SHAPES_REFERENCE: Final = "It applies a feedforward {force} by way of the reference, to servos without a {force} input."
"""Why a study does not compare a law that shapes the reference."""


def use_of(code: str) -> Use | None:
    """Return the use that the macro USE of a C file declares, or None without this macro."""
    rows = table(code, "USE", ("KIND", "MODELS", "RENAMED", "TUNED", "OUTPUT", "NEVER", "PERIOD", "RULE", "LINEAR"))
    texts: dict[str, str] = {"kind": "other"}
    models: tuple[str, ...] = ()
    pairs: dict[str, dict[str, str]] = {"RENAMED": {}, "TUNED": {}}
    for row in rows:
        match row:
            case "MODELS", models:
                pass
            case ("RENAMED" | "TUNED") as key, (name, text):
                pairs[key][name] = text
            case ("KIND" | "OUTPUT" | "NEVER" | "PERIOD" | "RULE" | "LINEAR") as key, (text,):
                texts[key.lower()] = text
            case key, arguments:
                raise FrictionError(f"USE has the malformed row {key}({', '.join(arguments)})")
    return Use(**texts, models=models, renamed=pairs["RENAMED"], tuned=pairs["TUNED"]) if rows else None


@dataclass(frozen=True)
class About:
    """Declarations in the file of a block."""

    identified: Identified = field(default_factory=Identified)  # how a friction model is identified
    friction: Friction | None = None
    """The friction of a friction model, or what a compensator computes of the friction of its axis. The stiffness of a
    compensator is that of a model of the contact which follows the measured motion, so that it also acts at rest."""
    use: Use | None = None  # how a law or controller is used as a compensator; None excludes it from studies
    cites: tuple[str, ...] = ()  # literature: keys of ``bibliography.bib``, or BibTeX entries

    @property
    def reads(self) -> frozenset[str]:
        """Names of the block's variables in its expressions."""
        texts = [self.identified.size, *self.identified.fits]
        texts += vars(self.friction).values() if self.friction is not None else ()
        if self.use is not None and not self.use.never:
            texts += [self.use.output, self.use.period, *self.use.tuned, *self.use.renamed.values()]
        return frozenset().union(*(names_in(text) for text in texts if text))

    def check(self, variables: Iterable[str]) -> None:
        """Raise a FrictionError for a name that is not a variable of the block, or an unknown key of the literature."""
        cited(self.cites)
        known = set(variables)
        for name in sorted(self.reads - known):
            raise FrictionError(
                f"the description of the block reads {name}, which is not a variable{did_you_mean(name, known)}"
            )


def about_c_block(code: str) -> About:
    """Return the declarations in the macros of a C file."""
    about = About(identified(code), friction_of(code), use_of(code), words(string(code, "CITES")))
    about.check(re.findall(r"\(\s*(\w+)\s*,", macro(code, "VARIABLES") or ""))
    return about
