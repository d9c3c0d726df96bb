"""Declarations next to the equations in a block's file, used by its page, the doctor, the study and the
identification."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from friction_fmus.blocks.arithmetic import names_in
from friction_fmus.blocks.bibliography import cited
from friction_fmus.blocks.identified import Identified, identified
from friction_fmus.blocks.loop import InLoop, in_loop
from friction_fmus.blocks.macros import macro, string, words
from friction_fmus.blocks.use import Use, use_of
from friction_fmus.errors import FrictionError, nearest


@dataclass(frozen=True)
class About:
    """Declarations in the file of a block."""

    portrait: str = ""
    """Name of the experiment for the figures, see `friction_fmus.fmi.portrait.choice`; if empty, the ports select it.
    """
    quotes: tuple[str, ...] = ()
    """Functions of `friction_fmus.conditions` that the documentation page quotes. The doctor evaluates them for systems
    with the block."""
    needs: Mapping[str, int] = field(default_factory=dict)
    """Rows of the decision tables in the documentation that recommend the block, with its rank in each."""
    identified: Identified = field(default_factory=Identified)
    """How a friction model is identified."""
    in_loop: InLoop = field(default_factory=InLoop)
    """The role of the block in a control loop."""
    use: Use | None = None
    """How a law or controller is used as a compensator; None excludes it from studies."""
    cites: tuple[str, ...] = ()
    """Literature: keys of ``bibliography.bib``, or BibTeX entries."""

    @property
    def reads(self) -> frozenset[str]:
        """Names of the block's variables in its expressions."""
        texts = [self.identified.size, *self.identified.fits]
        friction, plant, law = self.in_loop.friction, self.in_loop.plant, self.in_loop.law
        for part in (friction, law.friction if law is not None else None):
            texts += vars(part).values() if part is not None else ()
        if plant is not None:
            texts += [*plant.forces, *plant.friction, plant.mass, plant.damping, plant.stiffness]
            texts += [*plant.flexible, plant.belt]
        for named in (self.in_loop.sensor, self.in_loop.drive, self.in_loop.cogging):
            texts += vars(named).values() if named is not None else ()
        if law is not None:
            texts += [*law.gains.values(), law.inertia, law.amplifies, *law.adapts, *(law.linear or ())]
        if self.use is not None and not self.use.never:
            texts += [self.use.output, self.use.period, *self.use.tuned, *self.use.renamed.values()]
        return frozenset().union(*(names_in(text) for text in texts if text))

    def check(self, variables: Iterable[str]) -> None:
        """Raise a FrictionError for a name that is not a variable of the block, or an unknown key of the literature."""
        cited(self.cites)
        known = set(variables)
        for name in sorted(self.reads - known):
            raise FrictionError(
                f"the description of the block reads {name}, which is not a variable{nearest(name, known)}"
            )


def about_c_block(code: str) -> About:
    """Return the declarations in the macros of a C file."""
    about = About(
        string(code, "PORTRAIT"),
        words(string(code, "QUOTES")),
        dict(_place(need) for need in words(string(code, "NEEDS"))),
        identified(code),
        in_loop(code),
        use_of(code),
        words(string(code, "CITES")),
    )
    about.check(re.findall(r"\(\s*(\w+)\s*,", macro(code, "VARIABLES") or ""))
    return about


def _place(need: str) -> tuple[str, int]:
    """Return the name and the rank of ``name: rank``; the rank is 1 if none is given."""
    name, colon, place = need.partition(":")
    if colon and not place.strip().isdigit():
        raise FrictionError(f"NEEDS states the rank {place.strip()!r} of {name}; give a number")
    return name.strip(), int(place) if colon else 1
