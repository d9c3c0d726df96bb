"""Cases of the reference set: ``case.toml`` in a folder of `CASES` or of a built set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from cattrs import Converter, transform_error

from friction_fmus.errors import FrictionError
from harness.storage.toml_file import read_table

CASES: Final = Path(__file__).parent / "cases"
"""Folder of the cases in this package, without their FMUs."""

REFERENCE: Final = "reference.csv"
BOUND: Final = "bound.csv"
"""Files of a case: the reference results, and the largest deviation from each that a right tool can have."""


@dataclass(frozen=True)
class CaseFmu:
    """An FMU of a case."""

    block: str  # name of a block, or a C file of `fmu_src/reference`
    start: dict[str, Any] = field(default_factory=dict)  # start values that are built into the FMU
    options: dict[str, Any] = field(default_factory=dict)  # options of the target
    domain: Literal["translational", "rotational"] = "translational"
    interface: Literal["", "cs", "me", "both"] = ""  # of the FMU; "": the one that the case uses


@dataclass(frozen=True)
class CaseExperiment:
    """Times of a run."""

    stop: float
    step: float  # communication step, or interval of the outputs [s]
    start: float = 0.0
    tolerance: float = 1e-6  # relative


@dataclass(frozen=True)
class ReferenceCase:
    """One case.

    Attributes
    ----------
    title, tests : str
        What the case is about, and what a right tool does.
    standard : list of str
        Paragraphs of the standards that say so.
    fmi, kind : str
        Version, and the interface that is used: co-simulation, model exchange, or a system of FMUs as SSP.
    bound : str
        How reference values and bounds were obtained.
    fmus : mapping of str to CaseFmu
        The FMU, or the FMUs of the system by the names of their files without suffix.
    experiment : CaseExperiment
        Times of the run.
    outputs : list of str
        Recorded variables: the columns of the results after the time.
    start : mapping of str to value
        Start values that the tool sets before the initialization.
    inputs : bool
        Whether ``inputs.csv`` has inputs over the time, linear between rows. Two rows with one time are a jump, and
        inputs that are not Real keep their value from row to row.
    connections : list of str
        Connections ``"a.y -> b.u"`` of a system.
    call : list of mapping
        Calls of the tool's interface in their order, in place of a run from start to stop, see docs/reference-set.md.
    faults : list of str
        Faults of importers that the case finds.
    needs : list of str
        What only some tools have. A tool without one of them does not support the case.
    may_refuse : bool
        Whether a tool that ends with an error passes.
    """

    folder: Path
    title: str
    tests: str
    standard: list[str]
    fmi: Literal["2.0", "3.0"]
    kind: Literal["cs", "me", "ssp"]
    bound: str
    fmus: dict[str, CaseFmu]
    experiment: CaseExperiment
    outputs: list[str]
    start: dict[str, Any] = field(default_factory=dict)
    inputs: bool = False
    connections: list[str] = field(default_factory=list)
    call: list[dict[str, Any]] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    needs: list[str] = field(default_factory=list)
    may_refuse: bool = False

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.folder.name

    @property
    def file(self) -> Path:
        """What the tool opens."""
        return self.folder / (f"{self.name}.ssp" if self.kind == "ssp" else f"{next(iter(self.fmus))}.fmu")

    @property
    def all_needs(self) -> frozenset[str]:
        """Everything that a tool must have: what the case states, and what follows from its other entries."""
        found = {"start": self.start, "inputs": self.inputs, "call": self.call, "fmi3": self.fmi == "3.0"}
        return frozenset({*self.needs, self.kind, *(name for name, used in found.items() if used)})


_CONVERTER: Final = Converter(forbid_extra_keys=True)
_CONVERTER.register_structure_hook(float, lambda value, _: _number(value))
_CONVERTER.register_structure_hook(str, lambda value, _: _text(value))


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError(f"{value!r} is not a number")
    return float(value)


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is not a text")
    return value


def read_case(folder: Path) -> ReferenceCase:
    """Read a case."""
    file = folder / "case.toml"
    content: Mapping[str, Any] = read_table(file, FrictionError).content
    try:
        return _CONVERTER.structure({**content, "folder": folder}, ReferenceCase)
    except Exception as error:  # cattrs collects errors of many kinds
        raise FrictionError(f"{file} is not a case: {'; '.join(transform_error(error, path=''))}") from error


def read_cases(folder: Path, names: list[str] | None = None) -> list[ReferenceCase]:
    """Return the cases in a folder by name, or those with the names."""
    found = sorted(path.parent for path in folder.glob("*/case.toml"))
    known = [path.name for path in found]
    for name in names or ():
        if name not in known:
            raise FrictionError(f"{folder} has no case {name!r}: give one of {', '.join(known)}")
    if not found:
        raise FrictionError(f"{folder} has no cases: build them with `friction-fmus reference build -o {folder}`")
    return [read_case(path) for path in found if not names or path.name in names]
