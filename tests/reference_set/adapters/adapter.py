"""What the adapters share; each is a program ``NAME.py CASE OUTPUT``, as `reference run` wants, for one tool.

It needs nothing but the standard library, because some tools have environments of their own.
"""

from __future__ import annotations

import csv
import math
import os
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

SKIPPED = 77
Rows = Iterable[Sequence[Any]]

sys.path.insert(0, str(Path(__file__).parents[2]))

from reference_set.input_lines import InputLines  # noqa: E402


class UnsupportedError(Exception):
    """The tool has no way to run the case."""


class AdaptedCase:
    """A case as ``case.toml`` says it, with the defaults."""

    def __init__(self, folder: Path) -> None:
        """Read it."""
        self.folder = folder
        self.said: dict[str, Any] = tomllib.loads((folder / "case.toml").read_text(encoding="utf-8"))
        times = self.said["experiment"]
        self.start, self.stop, self.step = float(times.get("start", 0.0)), float(times["stop"]), float(times["step"])
        self.tolerance = float(times.get("tolerance", 1e-6))
        self.kind: str = self.said["kind"]
        self.outputs: list[str] = self.said["outputs"]
        self.values: dict[str, Any] = self.said.get("start", {})
        self.needs: set[str] = {*self.said.get("needs", []), self.kind}
        self.needs |= {name for name in ("start", "inputs", "call") if self.said.get(name)}
        self.needs |= {"fmi3", f"fmi3-{self.kind}"} if self.said["fmi"] == "3.0" else set()
        name = f"{folder.name}.ssp" if self.kind == "ssp" else f"{next(iter(self.said['fmus']))}.fmu"
        self.file = folder / name

    def times(self) -> list[float]:
        """Communication points."""
        count = math.floor((self.stop - self.start) / self.step * (1.0 + 1e-12))
        found = [self.start + k * self.step for k in range(count + 1)]
        return [*found, self.stop] if self.stop - found[-1] > 1e-9 * self.step else found

    def types(self) -> dict[str, str]:
        """Types of the variables of the FMU: Real, Integer, ... also for FMI 3.0 and enumerations."""
        return types(self.file)

    def enumerations(self) -> set[str]:
        """Variables that are enumerations."""
        with zipfile.ZipFile(self.file) as archive:
            root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        found = root.iterfind("ModelVariables/*")
        return {e.get("name", "") for e in found if e.tag == "Enumeration" or e.find("Enumeration") is not None}

    def components(self) -> dict[str, Path]:
        """The FMUs of the components of a flat SSP, unpacked beside it in the folder of the temporary files."""
        folder = Path(tempfile.mkdtemp(prefix="ssp"))
        with zipfile.ZipFile(self.file) as archive:
            archive.extractall(folder)
        root = ElementTree.parse(folder / "SystemStructure.ssd").getroot()
        found = (element for element in root.iter() if element.tag.endswith("}Component"))
        return {element.get("name", ""): folder / element.get("source", "") for element in found}

    def inputs(self) -> InputLines:
        """Inputs over time."""
        path = self.folder / "inputs.csv" if self.said.get("inputs") else None
        return InputLines(path, {name: kind == "Real" for name, kind in self.types().items()})


def types(fmu: Path) -> dict[str, str]:
    """Types of the variables of an FMU."""
    with zipfile.ZipFile(fmu) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    found = {}
    for element in root.iterfind("ModelVariables/*"):
        kind = element[0].tag if element.tag == "ScalarVariable" else element.tag
        kind = {"Float64": "Real", "Float32": "Real", "Enumeration": "Integer"}.get(kind, kind)
        found[element.get("name", "")] = "Integer" if "Int" in kind else kind
    return found


def main(run: Callable[[AdaptedCase], Rows], lacks: Collection[str], version: Callable[[], str]) -> None:
    """Run the case of the command line, or print the version of the tool."""
    if sys.argv[1:] == ["--version"]:
        print(version())
        return
    case, output = AdaptedCase(Path(sys.argv[1])), Path(sys.argv[2])
    missing = sorted(case.needs & set(lacks))
    if missing:
        print(f"it has no {', '.join(missing)}")
        sys.exit(SKIPPED)
    try:
        rows = list(run(case))
    except UnsupportedError as error:
        print(error, flush=True)
        os._exit(SKIPPED)  # some libraries have the last word on standard output
    except Exception as error:
        text = f"{type(error).__name__}: {error}"
        print(text, flush=True)
        os._exit(SKIPPED if "not supported" in text else 1)
    with output.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([["time", *case.outputs], *rows])
