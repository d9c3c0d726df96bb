"""What a run needs to know of a system, so that the files which run it do not depend on the class."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from harness.experiment import Experiment
from harness.part import Part, StartValue
from harness.wire import Wire


class Assembly(Protocol):
    """Parts, the wires between them and their start values; `System` is one."""

    @property
    def name(self) -> str:
        """Name of the system."""

    @property
    def parts(self) -> Mapping[str, Part]:
        """The parts by name."""

    @property
    def wires(self) -> Sequence[Wire]:
        """The wires."""

    @property
    def start(self) -> Mapping[str, StartValue]:
        """Start values by "part.variable"."""

    @property
    def experiment(self) -> Experiment | None:
        """How it is run when nothing else is said."""
