"""Kinds of mutants: which files are damaged, how, and which command reads them."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from random import Random

import h5netcdf  # noqa: F401
import h5py  # noqa: F401
import pyarrow.parquet  # noqa: F401

sys.path.insert(0, str(Path(__file__).parents[2]))

import mutant_seeds as seeds
from robustness.mutate import BYTES, TEXT, damaged, damaged_archive, members, odd_values, odd_xml, zipped

import friction_fmus.identification.model_comparison

# all that the commands import on their way, once for all processes
import friction_fmus.identification.result_files
import friction_fmus.study.study  # noqa: F401
from friction_fmus.__main__ import main
from harness import HarnessError, load_result

SEEDS: dict[str, bytes] = {}
"""Path below the folder of seeds -> content, once `prepare` has been called."""

SHORT = ("--step", "1e-3", "--stop", "0.02")
Files = dict[str, bytes]
Damage = Callable[[Files, Random], Files]
Change = Callable[[bytes, Random], bytes]
Action = Callable[[Path], "int | None"]


@dataclass(frozen=True)
class Kind:
    """One kind of input.

    Attributes
    ----------
    name : str
        What it is called on the command line.
    group : str
        Folder of its valid files.
    damage : callable
        What makes a mutant of them.
    action : callable
        The command in a folder with these files; its exit status.
    """

    name: str
    group: str
    damage: Damage
    action: Action

    @property
    def files(self) -> Files:
        """The valid files."""
        return {name[len(self.group) + 1 :]: text for name, text in SEEDS.items() if name.startswith(f"{self.group}/")}

    def mutant(self, number: int) -> Files:
        """A mutant, or the valid files for a negative number."""
        return self.files if number < 0 else self.damage(self.files, Random(f"{self.name} {number}"))


def prepare(place: Path) -> None:
    """Make the seeds, in a process of its own so that this one starts no threads before it forks."""
    folder = place / "seeds"
    process = os.fork()
    if process == 0:
        status = 1
        try:
            seeds.write_seeds(folder)
            status = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(status)
    if os.waitpid(process, 0)[1]:
        raise RuntimeError("the seeds cannot be made")
    SEEDS.update(
        {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}
    )


def command(*arguments: str) -> Action:
    """A command line."""
    return lambda _: main(list(arguments))


def read_result(name: str, folder: Path) -> int:
    """What a program does that reads a result."""
    try:
        load_result(folder / name)
    except HarnessError as error:
        print(f"friction-fmus: {error}")
        return 2
    return 0


def one(name: str, change: Change) -> Damage:
    """One of the files is changed."""
    return lambda files, random: {**files, name: change(files[name], random)}


def text(content: bytes, random: Random) -> bytes:
    return damaged(content, random, TEXT)


def binary(content: bytes, random: Random) -> bytes:
    return damaged(content, random, BYTES)


def description(content: bytes, random: Random) -> bytes:
    """An FMU with a damaged archive or XML; its library is whole or not there."""
    return damaged_archive(content, random, r"\.xml$")


def library(content: bytes, random: Random) -> bytes:
    """An FMU with a damaged archive, XML or library."""
    if random.random() < 0.5:
        return damaged_archive(content, random, r"binaries/", BYTES)
    return description(content, random)


def structure(content: bytes, random: Random) -> bytes:
    """An SSP archive that is damaged itself, in its XML, or in the XML of an FMU in it."""
    if random.random() < 0.2:
        found = members(content)
        name = random.choice([name for name in found if name.endswith(".fmu")])
        return zipped(found | {name: description(found[name], random)})
    return damaged_archive(content, random, r"\.ss[a-z]$")


def odd_structure(content: bytes, random: Random) -> bytes:
    """An SSP archive with well-formed but odd XML, also in an FMU in it."""
    found = members(content)
    if random.random() < 0.2:
        name = random.choice([name for name in found if name.endswith(".fmu")])
        inside = members(found[name])
        inside["modelDescription.xml"] = odd_xml(inside["modelDescription.xml"], random)
        return zipped(found | {name: zipped(inside)})
    return zipped(found | {"SystemStructure.ssd": odd_xml(found["SystemStructure.ssd"], random)})


def state(content: bytes, random: Random) -> bytes:
    """A checkpoint with a damaged archive, description, or state of a part."""
    way = random.choice((TEXT, BYTES))
    return damaged_archive(content, random, r"\.json$" if way is TEXT else r"/", way)


def sweep_folder(files: Files, random: Random) -> Files:
    """The folder of an interrupted sweep with one file damaged."""
    files = dict(files)
    tables = sorted(name for name in files if name.endswith(".parquet"))
    if random.random() < 0.7:
        del files[tables.pop(random.randrange(len(tables)))]
    if random.random() < 0.5:
        return one("out/_sweep.json", text)(files, random)
    if random.random() < 0.2:
        return files | {random.choice(tables): seeds.odd_table(random, seeds.motion(20), ".parquet")}
    return one(random.choice(tables), binary)(files, random)


def log(suffix: str, files: Files, random: Random) -> Files:
    """A data file with damaged bytes, or with odd columns and values."""
    if random.random() < 0.5:
        return files | {f"data{suffix}": seeds.odd_table(random, seeds.motion(), suffix)}
    return one(f"data{suffix}", text if suffix == ".csv" else binary)(files, random)


def other_log(suffix: str, files: Files, random: Random) -> Files:
    """A data file with damaged bytes, text, or a damaged member of its archive."""
    if suffix in (".zip", ".xlsx", ".npz") and random.random() < 0.7:
        return one(f"data{suffix}", lambda content, random: damaged_archive(content, random, "."))(files, random)
    return one(f"data{suffix}", text if suffix in (".json", ".lvm") else binary)(files, random)


def config(content: bytes, random: Random) -> bytes:
    """A configuration with odd values or damaged text."""
    return odd_values(content, random, seeds.STUDY_KEYS) if random.random() < 0.6 else text(content, random)


def odd_system(content: bytes, random: Random) -> bytes:
    return odd_values(content, random, seeds.KEYS)


RUN = command("run", "s.toml", "-o", "o.csv")
RUN_TO = command("run", "s.toml", "-o", "o.csv", "--stop", "0.05")
RUN_SHORT = command("run", "s.toml", "-o", "o.csv", *SHORT)
RUN_ON = command("run", "s.toml", "-o", "o.csv", "--resume", "state", "--stop", "0.04")
SWEEP = command("sweep", "s.toml", *seeds.SWEEP, "-o", "out")
SAMPLES = command("sweep", "s.toml", "--samples", "p.csv", "--executor", "serial", *SHORT, "-o", "out")
IDENTIFY = command("identify", "map.toml", "--model", "Coulomb", "--workers", "1", "-o", "out")
STUDY = command("study", "map.toml", "--workers", "1", "-o", "out")

_ALL = (
    Kind("check-static", "fmu", one("part.fmu", description), command("check", "--static", "part.fmu")),
    Kind("check", "fmu", one("part.fmu", library), command("check", "--timeout", "10", "part.fmu")),
    Kind("run-fmu", "fmu", one("part.fmu", description), RUN_SHORT),
    Kind("check-3", "fmu3", one("part.fmu", library), command("check", "--timeout", "10", "part.fmu")),
    Kind("run-fmu-3", "fmu3", one("part.fmu", description), RUN_SHORT),
    Kind("run-ssp", "ssp", one("s.ssp", structure), command("run", "s.ssp", "-o", "o.csv", *SHORT)),
    Kind("run-ssp2", "ssp2", one("s.ssp", structure), command("run", "s.ssp", "-o", "o.csv", *SHORT)),
    *(
        Kind(f"odd-{group}", group, one("s.ssp", odd_structure), command("run", "s.ssp", "-o", "o.csv", *SHORT))
        for group in ("ssp", "ssp2")
    ),
    Kind("sweep-ssp", "ssp", one("s.ssp", structure), command("sweep", "s.ssp", *SHORT, *seeds.SWEEP, "-o", "out")),
    Kind("run-toml", "toml", one("s.toml", text), RUN_SHORT),
    Kind("run-series", "toml", one("reference.csv", text), RUN),
    Kind("odd-run", "toml", one("s.toml", odd_system), RUN_TO),
    Kind("checkpoint", "checkpoint", one("state", state), RUN_ON),
    Kind("sweep-folder", "sweep", sweep_folder, SWEEP),
    Kind("samples", "samples", one("p.csv", text), SAMPLES),
    Kind(
        "parameters",
        "parameters",
        one("p.ssv", text),
        command("run", "s.toml", "--parameters", "p.ssv", "-o", "o.csv", *SHORT),
    ),
    *(Kind(f"identify{suffix}", f"identify{suffix}", partial(log, suffix), IDENTIFY) for suffix in seeds.LOGS),
    *(
        Kind(f"identify{suffix}", f"identify{suffix}", partial(other_log, suffix), IDENTIFY)
        for suffix in seeds.OTHER_LOGS
    ),
    Kind("identify-mapping", "identify.csv", one("map.toml", config), IDENTIFY),
    *(Kind(f"study{suffix}", f"study{suffix}", partial(log, suffix), STUDY) for suffix in seeds.LOGS),
    Kind("study-config", "study.csv", one("map.toml", config), STUDY),
    *(
        Kind(
            f"result{suffix}",
            f"result{suffix}",
            one(f"result{suffix}", text if suffix == ".csv" else binary),
            partial(read_result, f"result{suffix}"),
        )
        for suffix in seeds.SUFFIXES
    ),
)
KINDS: dict[str, Kind] = {kind.name: kind for kind in _ALL}
