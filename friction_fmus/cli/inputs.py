"""What commands read besides their files: a system, the address of a cluster, and the parameter sets of a sweep."""

import argparse
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from friction_fmus.cli.arguments import parse_value
from friction_fmus.errors import FrictionError
from friction_fmus.export.block_fmu import fmu
from harness import System, grid, latin_hypercube, read_samples, sobol
from harness.extras import require
from harness.sweeps import WithUnits
from harness.sweeps.samples import check_runs


def open_system(path: Path, *, open_inputs: bool = False) -> System:
    """Return the system in a .toml or .ssp file."""
    if path.suffix.lower() == ".ssp":
        return System.from_ssp(path)
    return System.from_toml(path, resolve=fmu, open_inputs=open_inputs)


PATIENCE = 10.0  # time limit for the answer of a scheduler [s]


def connect(address: str) -> Any:
    """Return a client of the dask cluster at this address."""
    require("distributed", "a dask cluster needs it")
    from distributed import Client

    make: Any = Client
    try:
        return make(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise FrictionError(
            f"no dask scheduler answers at {address}: {error}; start `dask scheduler`, or correct the address"
        ) from error


_FORMS = (
    "use NAME=A,B,... or NAME=FIRST:LAST:COUNT, or NAME=FIRST:LAST for random points; append :log for a log scale, and "
    "a unit after a space, as in Fc='0.5:2:4 N'"
)


def parameter_sets(options: argparse.Namespace) -> list[WithUnits]:
    """Return the parameter sets described by the options of `sweep`."""
    listed: dict[str, list[Any]] = {}
    ranges: dict[str, tuple[float, float]] = {}
    logarithmic: list[str] = []
    units: dict[str, str] = {}
    for text in options.vary:
        name, values = _assignment(text)
        if found := re.fullmatch(r"(.*[\d.]|.*:log)\s+([^\W\d]\S*|%)", values):
            values, units[name] = found[1], found[2]
        if name in listed or name in ranges:
            raise FrictionError(f"--vary names {name} twice; combine its values in one option")
        if ":" not in values:
            listed[name] = [parse_value(value) for value in values.split(",")]
            continue
        first, last, count, log = _range(text, values)
        if count is not None:
            check_runs(count)
            listed[name] = (np.geomspace if log else np.linspace)(first, last, count).tolist()
            continue
        ranges[name] = (first, last)
        logarithmic += [name] * log
    n = options.latin_hypercube if options.latin_hypercube is not None else options.sobol
    if ranges and n is None:
        raise FrictionError(f"{', '.join(ranges)} has no count of values; {_FORMS}, with --latin-hypercube or --sobol")
    points: list[WithUnits] = [{}]
    if n is not None:
        method = sobol if options.sobol is not None else latin_hypercube
        points = list(method(ranges, n, options.seed, log=logarithmic))
    elif options.samples:
        points = read_samples(options.samples)
    elif not listed:
        raise FrictionError(f"nothing is varied; add --vary ({_FORMS}) or --samples FILE")
    rows = grid(listed)
    check_runs(len(rows) * len(points))
    return [{**_with_units(others, units), **_with_units(point, units)} for others in rows for point in points]


def _with_units(values: WithUnits, units: Mapping[str, str]) -> WithUnits:
    """Return a parameter set in which the numbers have these units."""
    return {
        name: f"{value!r} {units[name]}" if name in units and isinstance(value, float) else value
        for name, value in values.items()
    }


def _assignment(text: str) -> tuple[str, str]:
    name, equals, values = text.partition("=")
    if not (equals and name.strip() and values.strip()):
        raise FrictionError(f"--vary {text!r} is not NAME=VALUES; {_FORMS}")
    return name.strip(), values.strip()


def _range(text: str, values: str) -> tuple[float, float, int | None, bool]:
    """Return first, last, count and scale of ``FIRST:LAST[:COUNT][:log]``."""
    parts = values.split(":")
    log = parts[-1] == "log"
    parts = parts[:-1] if log else parts
    try:
        first, last, *rest = parts
        count = int(*rest) if rest else None
        ends = float(first), float(last)
    except (TypeError, ValueError) as error:
        raise FrictionError(f"--vary {text!r} is not a range; {_FORMS}") from error
    if count is not None and count < 1:
        raise FrictionError(f"--vary {text!r} has {count} values; {_FORMS}")
    if log and min(ends) <= 0.0:
        raise FrictionError(f"--vary {text!r} has a logarithmic scale; use values above 0")
    return *ends, count, log
