"""The interface of a system that a run needs, so that the modules that run it do not depend on the class."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol

from harness.parts.part import Part, StartValue
from harness.system.experiment import Experiment
from harness.system.wire import Wire, split_name


class Assembly(Protocol):
    """Interface with parts, connections and start values; `System` implements it."""

    @property
    def name(self) -> str:
        """Name of the system."""

    @property
    def parts(self) -> Mapping[str, Part]:
        """The parts by name."""

    @property
    def wires(self) -> Sequence[Wire]:
        """The connections."""

    @property
    def start(self) -> Mapping[str, StartValue]:
        """Start values by "part.variable"."""

    @property
    def strict(self) -> bool:
        """Whether every input needs a connection or a value."""

    @property
    def experiment(self) -> Experiment | None:
        """Default settings of a run."""


@dataclass(frozen=True)
class Assembled:
    """An `Assembly` whose parts and connections have been checked."""

    name: str
    parts: Mapping[str, Part]
    wires: Sequence[Wire]
    start: Mapping[str, StartValue]
    strict: bool
    experiment: Experiment | None


def assembled(system: Assembly, **changes: Any) -> Assembled:
    """Return a system with changes."""
    return Assembled(**{each.name: getattr(system, each.name) for each in fields(Assembled)} | changes)


def resize_parts(system: Assembly) -> None:
    """Give the arrays of each part the sizes that the start values state; another system may share the part."""
    for name, part in system.parts.items():
        own = f"{name}."
        part.resize({key.removeprefix(own): value for key, value in system.start.items() if key.startswith(own)})


def start_values(start: Mapping[str, StartValue], part: str) -> dict[str, StartValue]:
    """Return the start values of one part, by variable."""
    ends = ((split_name(name), value) for name, value in start.items())
    return {port: value for (owner, port), value in ends if owner == part}
