"""Parameter sets of a sweep."""

import itertools
import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from harness.errors import SweepError
from harness.parts.archive import parse_value
from harness.parts.part import Port, PortType, StartValue
from harness.ssp import Parameter, ParameterSet, read_ssv
from harness.storage.files import read_csv, reason
from harness.system.system import System
from harness.units import in_unit
from harness.values import is_count, plain, shown

Sample: TypeAlias = Mapping[str, StartValue]
WithUnits: TypeAlias = Mapping[str, StartValue | Parameter]
Given: TypeAlias = WithUnits | ParameterSet
"""A parameter set as accepted from the user: a mapping, with or without units, or a `ParameterSet`."""

Bounds: TypeAlias = Mapping[str, tuple[float, float]]

MOST_RUNS: Final = 10_000_000  # largest number of runs in a sweep, as all parameters are kept in memory


def check_runs(count: int) -> None:
    """Raise an error for more runs than a sweep can have."""
    if count > MOST_RUNS:
        raise SweepError(
            f"the sweep would have {count} runs; the limit is {MOST_RUNS}: use fewer parameters or fewer values"
        )


def grid(values: Mapping[str, ArrayLike]) -> list[dict[str, StartValue]]:
    """Return all combinations of values; the last name varies fastest.

    Parameters
    ----------
    values : mapping of str to array_like, shape (n_k,)
        Values of each name, which is ``part.port`` or a setting of the experiment such as ``step``.

    Returns
    -------
    list of dict, length n_1 n_2 ...
        The parameter sets.
    """
    columns = [[_swept(value) for value in np.atleast_1d(np.asarray(v, dtype=object))] for v in values.values()]
    check_runs(math.prod(len(column) for column in columns))
    return [dict(zip(values, point, strict=True)) for point in itertools.product(*columns)]


def latin_hypercube(bounds: Bounds, n: int, seed: int, *, log: Collection[str] = ()) -> list[dict[str, StartValue]]:
    """Return random points such that each of n equal strata of every parameter contains exactly one.

    Source: McKay, Beckman, Conover, Technometrics 21(2), 1979.

    Parameters
    ----------
    bounds : mapping of str to (float, float)
        Smallest and largest value of each name.
    n : int
        Number of points.
    seed : int
        Seed of the random numbers; equal seeds give equal points.
    log : collection of str
        Names whose logarithm is sampled.

    Returns
    -------
    list of dict, length n
        The parameter sets.

    Raises
    ------
    SweepError
        If the bounds or n are invalid.
    """
    if n < 1:
        raise SweepError(f"a Latin hypercube cannot have {n} points: give 1 or more")
    check_runs(n)
    _check_seed(seed)
    from scipy.stats import qmc  # slow to load

    sampler = qmc.LatinHypercube(_dimensions(bounds, log), seed=seed)
    return _scaled(sampler.random(n), bounds, log)


def sobol(bounds: Bounds, n: int, seed: int, *, log: Collection[str] = ()) -> list[dict[str, StartValue]]:
    """Return points of a scrambled Sobol sequence, which cover the bounds more evenly than random points.

    Sources: Sobol, USSR Computational Mathematics and Mathematical Physics 7(4), 1967; Owen, Journal of Complexity
    14(4), 1998.

    Parameters
    ----------
    bounds : mapping of str to (float, float)
        Smallest and largest value of each name.
    n : int
        Number of points; it must be a power of 2 to keep the balance of the sequence (Owen, 2020).
    seed : int
        Seed of the random numbers; equal seeds give equal points.
    log : collection of str
        Names whose logarithm is sampled.

    Returns
    -------
    list of dict, length n
        The parameter sets.

    Raises
    ------
    SweepError
        If the bounds or n are invalid.
    """
    check_runs(n)
    _check_seed(seed)
    power = max(0, round(math.log2(n))) if n > 0 else 0
    if 2**power != n:
        raise SweepError(f"a Sobol sequence of {n} points is not balanced: give a power of 2 such as {2**power}")
    from scipy.stats import qmc

    sampler = qmc.Sobol(_dimensions(bounds, log), seed=seed)
    return _scaled(sampler.random_base2(power), bounds, log)


def read_csv_samples(path: Path) -> list[dict[str, StartValue]]:
    """Read parameter sets from a table: a row of names, then one set per row; an empty cell keeps the default."""
    try:
        lines = read_csv(path)
    except (OSError, ValueError) as error:
        raise SweepError(f"cannot read the parameter sets {path}: {reason(error)}; give a CSV file") from error
    if len(lines) < 2:
        raise SweepError(f"{path} contains no parameter sets: give a row of names, then a row for each run")
    names = [name.strip() for name in lines[0]]
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise SweepError(f"two columns of {path} are called '{twice[0]}': remove or rename one")
    for number, line in enumerate(lines[1:], start=2):
        if len(line) != len(names):
            raise SweepError(f"row {number} of {path} has {len(line)} cells instead of {len(names)}: correct it")
    return [{name: _parsed(cell) for name, cell in zip(names, line, strict=True) if cell.strip()} for line in lines[1:]]


READERS: Final[dict[str, Callable[[Path], Sequence[WithUnits]]]] = {
    ".csv": read_csv_samples,
    ".ssv": lambda path: [read_ssv(path).parameters],
}
"""Readers of parameter sets by file suffix."""


def read_samples(paths: Iterable[Path]) -> list[WithUnits]:
    """Read the parameter sets of several files, one after the other.

    Parameters
    ----------
    paths : iterable of Path
        The files. A .csv file has a parameter set in each row below the names; an .ssv file is one parameter set.

    Returns
    -------
    list of mappings
        Values by name; values of an .ssv file have units.

    Raises
    ------
    SweepError
        If a file cannot be read or has an unknown format.
    """
    sets: list[WithUnits] = []
    for path in paths:
        if path.suffix not in READERS:
            raise SweepError(f"{path} has no known format: give parameter sets as {', '.join(READERS)}")
        sets += READERS[path.suffix](path)
    return sets


def checked_samples(samples: Iterable[Given], system: System) -> list[dict[str, StartValue]]:
    """Return parameter sets with plain Python values, in the units of the system."""
    ports = settable(system)
    plain = [
        {str(name): _swept(value, str(name)) for name, value in _in_units(sample, system, ports).items()}
        for sample in samples
    ]
    if not plain:
        raise SweepError("the sweep has no runs: give at least one parameter set")
    return plain


def settable(system: System) -> dict[str, Port]:
    """Return the inputs and parameters that can have start values, by name."""
    parts = system.parts.items()
    return {f"{owner}.{port.name}": port for owner, part in parts for port in (*part.inputs, *part.parameters)}


def column_types(samples: Sequence[Sample]) -> dict[str, PortType]:
    """Return the type of each swept name over all parameter sets, in order of appearance."""
    kinds: dict[str, set[type]] = {}
    for sample in samples:
        for name, value in sample.items():
            kinds.setdefault(name, set()).add(type(value))
    types: dict[tuple[type, ...], PortType] = {(bool,): "Boolean", (int,): "Integer", (str,): "String"}
    found: dict[str, PortType] = {}
    for name, kind in kinds.items():
        if len(kind) > 1 and not kind <= {int, float}:
            given = " and ".join(sorted(one.__name__ for one in kind))
            raise SweepError(f"the values of {name} have the types {given}: give values of one type")
        found[name] = types.get(tuple(kind), "Real")
    return found


def _in_units(given: Given, system: System, ports: Mapping[str, Port]) -> Sample:
    """Return a parameter set converted to the units of the system."""
    values = given.parameters if isinstance(given, ParameterSet) else given
    with_unit = {name: value for name, value in values.items() if isinstance(value, Parameter)}
    start = system.with_parameters(with_unit).start if with_unit else {}
    return {
        name: start[name] if isinstance(value, Parameter) else _number(value, name, ports.get(name))
        for name, value in values.items()
    }


def _number(value: StartValue, name: str, port: Port | None) -> StartValue:
    """Return a value such as ``0.002 kN`` of a real variable as a number."""
    if not isinstance(value, str) or port is None or port.type != "Real":
        return value
    number: StartValue = in_unit(value, port.unit, port.base, name)
    if isinstance(number, str):
        raise SweepError(f"{value!r} is no value of {name}: give a number, or a number with a unit")
    return number


def _swept(value: object, name: str = "") -> StartValue:
    """Return a value as a Python type, as numpy types cannot be stored in all files."""
    value = plain(value)
    if isinstance(value, (bool, int, float, str)):
        return value
    raise SweepError(
        f"the value {value!r} {f'of {name} ' if name else ''}cannot be swept: give numbers, Booleans or texts"
    )


def _parsed(cell: str) -> StartValue:
    cell = cell.strip()
    if cell.lower() in ("true", "false"):
        return parse_value("Boolean", cell.lower())
    for kind in ("Integer", "Real"):
        try:
            value = parse_value(kind, cell)
        except ValueError:
            continue
        if kind == "Real" or is_count(value, -(1 << 63), (1 << 63) - 1):
            return value
    return cell


def _check_seed(seed: int) -> None:
    if not is_count(seed, 0):
        raise SweepError(f"the seed is {shown(seed)}: give an integer, 0 or more")


def _dimensions(bounds: Bounds, log: Collection[str]) -> int:
    if not bounds:
        raise SweepError("nothing is varied: give bounds for at least one name")
    for name in log:
        if name not in bounds:
            raise SweepError(f"{name} has a logarithmic scale but no bounds: give its bounds")
    for name, (low, high) in bounds.items():
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise SweepError(f"the bounds of {name} are {low} and {high}: give two finite numbers in increasing order")
        if name in log and low <= 0.0:
            raise SweepError(f"{name} has a logarithmic scale that starts at {low}: give positive bounds")
    return len(bounds)


def _scaled(points: np.ndarray, bounds: Bounds, log: Collection[str]) -> list[dict[str, StartValue]]:
    columns = []
    for (name, (low, high)), column in zip(bounds.items(), points.T, strict=True):
        scaled = low * (high / low) ** column if name in log else low + (high - low) * column
        columns.append(np.clip(scaled, low, high).tolist())
    return [dict(zip(bounds, point, strict=True)) for point in zip(*columns, strict=True)]
