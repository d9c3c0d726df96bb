"""The systems of two FMUs whose communication step is timed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np

from friction_fmus import build
from harness import FmuPart, System

STEP = 1e-4
"""Communication step [s]."""


@dataclass(frozen=True)
class Member:
    """One of the two FMUs.

    Attributes
    ----------
    name, model : str
        Of the part and of its block.
    input : str
        Its wired input.
    outputs : tuple of str
        What is recorded; the first one is wired.
    start : mapping of str to float
        Start values.
    """

    name: str
    model: str
    input: str
    outputs: tuple[str, ...]
    start: Mapping[str, float]


@dataclass(frozen=True)
class Pair:
    """Two FMUs, the first of which drives the second.

    Attributes
    ----------
    title : str
        How the rows call it.
    members : tuple of two Member
        The FMUs in the order in which they are stepped.
    closed : bool
        Whether the second drives the first, too.
    fmpy : float
        What the engine is to take at most of the time of a loop with fmpy.
    """

    title: str
    members: tuple[Member, Member]
    closed: bool
    fmpy: float

    @property
    def wires(self) -> list[tuple[str, str]]:
        """Output and input of each wire, as "part.port"."""
        both = [(self.members[0], self.members[1]), (self.members[1], self.members[0])]
        return [(f"{a.name}.{a.outputs[0]}", f"{b.name}.{b.input}") for a, b in both[: 1 + self.closed]]

    @property
    def recorded(self) -> list[str]:
        """Names of the columns, as "part.port"."""
        return [f"{member.name}.{output}" for member in self.members for output in member.outputs]


PAIRS = (
    Pair(
        "two Quantisers",  # the cheapest block; the next one, Viscous, has other units
        (
            Member("first", "Quantiser", "x", ("y",), {"x": 1.2345678e-3}),
            Member("second", "Quantiser", "x", ("y",), {"q": 2e-6}),
        ),
        closed=False,
        fmpy=1 / 50,
    ),
    Pair(
        "Mass + LuGre",  # sliding steadily at 5 mm/s, five times vs
        (
            Member("mass", "Mass", "F_friction", ("v", "x"), {"F_drive": 1.2, "v0": 5e-3}),
            Member("friction", "LuGre", "v", ("F",), {"sigma2": 40.0}),
        ),
        closed=True,
        fmpy=1 / 20,
    ),
)


class Built:
    """A pair with its FMUs.

    Parameters
    ----------
    pair : Pair
        The pair.
    folder : Path
        Where to build and unzip.

    Attributes
    ----------
    paths, folders : dict
        The FMU and its unzipped folder by the name of the part.
    descriptions : dict
        Their descriptions, of fmpy.
    references : dict
        Value references by "part.port".
    """

    def __init__(self, pair: Pair, folder: Path) -> None:
        """Build them."""
        self.pair, self.folder = pair, folder
        self.paths = {member.name: build(member.model, folder) for member in pair.members}
        self.folders = {name: Path(fmpy.extract(str(path), str(folder / name))) for name, path in self.paths.items()}
        self.descriptions: dict[str, Any] = {
            name: fmpy.read_model_description(str(path)) for name, path in self.paths.items()
        }
        self.references: dict[str, int] = {
            f"{name}.{variable.name}": variable.valueReference
            for name, description in self.descriptions.items()
            for variable in description.modelVariables
        }

    def library(self, member: Member) -> Path:
        """The shared library of an FMU."""
        name = self.descriptions[member.name].coSimulation.modelIdentifier + fmpy.sharedLibraryExtension
        return self.folders[member.name] / "binaries" / str(fmpy.platform) / str(name)

    def system(self) -> System:
        """The pair for the harness."""
        start = {f"{member.name}.{name}": value for member in self.pair.members for name, value in member.start.items()}
        parts = [FmuPart(name, path) for name, path in self.paths.items()]
        return System(parts, [f"{output} -> {input_}" for output, input_ in self.pair.wires], start)


Values = np.ndarray[Any, np.dtype[np.float64]]
