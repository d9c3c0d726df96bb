"""Cases of the reference set: ``case.toml`` in a folder of `CASES` or of a built set, see docs/reference-set.md."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from cattrs import Converter, transform_error

from friction_fmus.errors import FrictionError
from harness.storage.toml_file import read_table

CASES: Final = Path(__file__).parent / "cases"  # the cases of this package, without their FMUs

REFERENCE, BOUND, INPUTS = "reference.csv", "bound.csv", "inputs.csv"  # results, their bounds, inputs over time


@dataclass(frozen=True)
class CaseFmu:
    """How an FMU of a case is built."""

    block: str  # name of a block, a system file of the case, or a C file of `fmu_src/reference` without suffix
    start: dict[str, Any] = field(default_factory=dict)  # start values that are built into the FMU
    options: dict[str, Any] = field(default_factory=dict)  # other arguments of `friction_fmus.build`
    interface: Literal["", "cs", "me", "both"] = ""  # interfaces that it offers; "": the one that the case uses
    replaced: dict[str, str] = field(default_factory=dict)  # texts in modelDescription.xml, and those in their place


@dataclass(frozen=True)
class CaseExperiment:
    """Times of a run."""

    stop: float
    step: float  # communication step, or interval of the outputs [s]
    start: float = 0.0
    tolerance: float = 1e-6  # relative


@dataclass(frozen=True)
class ReferenceCase:
    """One case; the attributes are the entries of its file."""

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
    time_limit: float = 10.0

    @property
    def name(self) -> str:
        """Name of its folder."""
        return self.folder.name

    @property
    def file(self) -> Path:
        """What the tool opens."""
        return self.folder / (f"{self.name}.ssp" if self.kind == "ssp" else f"{next(iter(self.fmus))}.fmu")

    @property
    def all_needs(self) -> list[str]:
        """Everything that a tool must have: what the case states, and what follows from its other entries."""
        used = {"start": self.start and self.kind != "ssp", "inputs": self.inputs, "call": self.call}
        three = {"fmi3": self.fmi == "3.0", f"fmi3-{self.kind}": self.fmi == "3.0"}
        return sorted({self.kind, *self.needs, *(name for name, entries in {**used, **three}.items() if entries)})


def read_cases(folder: Path, names: Sequence[str] | None = None) -> list[ReferenceCase]:
    """Return the cases in a folder, or those with the names."""
    known = sorted(path.parent.name for path in folder.glob("*/case.toml"))
    if not known:
        raise FrictionError(f"{folder} has no cases: build them with `friction-fmus reference build -o {folder}`")
    for name in names or ():
        if name not in known:
            raise FrictionError(f"{folder} has no case {name!r}: give one of {', '.join(known)}")
    return [read_case(folder / name) for name in names or known]


def read_case(folder: Path) -> ReferenceCase:
    """Read a case."""
    file = folder / "case.toml"
    content = read_table(file, FrictionError).content
    try:
        return Converter(forbid_extra_keys=True).structure({**content, "folder": folder}, ReferenceCase)
    except Exception as error:  # cattrs collects errors of many kinds
        raise FrictionError(f"{file} is not a case: {'; '.join(transform_error(error, path=''))}") from error


STATUS: Final = ("ok", "warning", "discard", "error", "fatal")


def run_calls(case: ReferenceCase, instantiate: Callable[[str], Any]) -> list[list[Any]]:
    """Make the calls of a case and return the rows of its results.

    ``instantiate`` returns a new instance of the FMU with a name; docs/reference-set.md lists its methods.
    """
    instances: dict[str, Any] = {}
    kept: dict[str, Any] = {}  # states and derivatives by name
    rows: list[list[Any]] = []

    def make(call: dict[str, Any], instance: Any) -> None:
        do, state = call["do"], call.get("state", "")
        if do == "start":
            instance.start({**case.start, **call.get("values", {})})
        elif do == "set":
            instance.set(call["values"])
        elif do == "step":
            for _ in range(call.get("count", 1)):
                instance.step(float(call.get("size", case.experiment.step)))
        elif do == "get":
            found = instance.get([name for name in case.outputs if name not in kept])
            rows.append([instance.time, *(kept[name] if name in kept else found.pop(0) for name in case.outputs)])
        elif do in ("save", "serialise"):
            kept[state] = getattr(instance, do)()
        elif do in ("restore", "deserialise"):
            getattr(instance, do)(kept[state])
        elif do in ("directional", "adjoint"):
            found = getattr(instance, do)(call["unknowns"], call["knowns"], call["seed"])
            kept.update(zip(call["into"], found, strict=True))
        else:
            {"reset": instance.reset, "terminate": instance.terminate}[do]()

    for number, call in enumerate(case.call, start=1):
        key, expected, status = call.get("instance", "a"), call.get("expect", "ok"), 0
        if key not in instances:
            instances[key] = instantiate(key)
        try:
            make(call, instances[key])
        except Exception as error:  # of the tool
            status = getattr(error, "status", -1)
            if status < 0:
                raise
        if STATUS[status if status > 1 else 0] != expected:
            message = f"call {number} of {case.name}, {call['do']}, has the status {STATUS[status]}, not {expected}"
            raise FrictionError(message)
    return rows
