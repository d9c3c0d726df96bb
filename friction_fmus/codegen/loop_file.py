"""The file of a loop: a servo, the laws whose forces are added to its force, and their parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, TypeAlias

import tomli_w

from friction_fmus.axis.position_map import Grid, PositionMap
from friction_fmus.errors import FrictionError
from harness.storage.toml_file import Table, read_table
from harness.values import finite, flag, text

LOOP_FILE: Final = "loop.toml"
"""Name of the file that a study writes."""

LAWS: Final = ("feedforward", "compensator", "servo")
"""The tables of the laws, in the order in which the laws are computed."""

SHARED: Final = ("Ts", "u_min", "u_max")
"""Parameters that all laws have in common, unless the file gives the limit of one."""

MOST: Final = 64
"""Largest number of samples over which the velocity is computed."""

Numbers: TypeAlias = Mapping[str, float | bool]

_STUDY: Final = ("data", "columns", "windows", "identify", "compensation")
_COLUMNS: Final = ("cogging", "friction")
_FLAGS: Final = ("rotary", "known_force")
_SETTINGS: Final = ("Ts", "u_min", "u_max", "offset", "window", "v0", *_FLAGS)


@dataclass(frozen=True)
class LoopLaw:
    """A law of a loop."""

    law: str
    """Its name, or the path of its file."""
    parameters: Numbers = field(default_factory=dict)
    """Its parameters; elements of vectors are ``W[1]``. Others have their start values."""
    connections: Mapping[str, float | str] = field(default_factory=dict)
    """Constant inputs, and inputs that are connected to another input of the loop."""
    output: str = "u"
    """The output that is added to the force of the servo."""
    factor: float | None = None
    """Factor of this output; None for 1."""


@dataclass(frozen=True)
class LoopFile:
    """A servo with compensation."""

    laws: Mapping[str, LoopLaw]
    """The laws by the name of their table, ``servo`` and optionally ``feedforward`` and ``compensator``."""
    Ts: float
    """Sample time [s]."""
    u_min: float
    u_max: float
    """Limits of the force [N]."""
    offset: float | None = None
    """Constant force that is added [N]; None for none."""
    window: int = 0
    """Number of samples over which the velocity is computed; 0 if it is an input."""
    v0: float | None = None
    """Velocity before the first sample [m/s]; None for rest."""
    rotary: bool = False
    """Whether the axis is rotary; read m as rad, N as N.m and kg as kg.m2."""
    known_force: bool = False
    """Whether the loop has an input for a known force, which is added and hidden from estimators."""
    table: PositionMap | None = None
    """Force over position, which is compensated at the reference as a known force."""
    path: Path = Path(LOOP_FILE)
    """The file."""


def read_loop(path: Path) -> LoopFile:
    """Read the file of a loop."""
    if not path.is_file():
        raise FrictionError(
            f"{path} does not exist; write it, or use recommended/{LOOP_FILE} of a study that recommends a compensation"
        )
    content = read_table(path, FrictionError)
    if "loop" not in content and any(name in content for name in _STUDY):
        raise FrictionError(
            f"{path} describes a study, not a loop; run `friction-fmus study {path.name} -o out` and use "
            f"out/recommended/{LOOP_FILE}, which the study writes if it recommends a compensation"
        )
    content.known(("loop", *LAWS, "table"), "table")
    tables = {name: Table(value, f"{path}, [{name}],", FrictionError) for name, value in content.content.items()}
    for name in ("loop", "servo"):
        if name not in tables:
            raise FrictionError(f"{path} has no table [{name}]; add it")
    settings = tables["loop"]
    settings.known(_SETTINGS)
    flags = {key: settings.take(key, flag, "true or false") for key in _FLAGS if key in settings}
    needed = ("Ts", "u_min", "u_max")
    values = {key: _finite(settings, key) for key in (*needed, *settings) if key not in flags}
    if values["Ts"] < 1e-9:
        raise FrictionError(f"{settings.where} has Ts = {values['Ts']:g}; give a sample time of at least 1e-9 s")
    if values["u_min"] > values["u_max"]:
        raise FrictionError(f"{settings.where} has u_min above u_max; exchange them")
    window = values.get("window", 0.0)
    if window not in range(MOST + 1):
        raise FrictionError(f"{settings.where} has window = {window:g}; give an integer number of samples up to {MOST}")
    return LoopFile(
        {name: _law(tables[name], name) for name in LAWS if name in tables},
        values["Ts"],
        values["u_min"],
        values["u_max"],
        values.get("offset"),
        int(window),
        values.get("v0"),
        path=path,
        table=_position_map(tables["table"]) if "table" in tables else None,
        **{**flags, **({"known_force": True} if "table" in tables else {})},
    )


def loop_text(loop: LoopFile, heading: str) -> str:
    """Return the file of a loop with a heading as comment."""
    settings = {key: getattr(loop, key) for key in _SETTINGS}
    # 0.0 is not a missing limit, offset or factor
    given = {key: value for key, value in settings.items() if value != getattr(LoopFile, key, None)}
    content: dict[str, Any] = {"loop": given}
    for name, law in loop.laws.items():
        own = {"law": law.law, **({"output": law.output} if name != "servo" else {})}
        groups = {"factor": law.factor, "parameters": dict(law.parameters), "connections": dict(law.connections)}
        content[name] = own | {key: value for key, value in groups.items() if value not in (None, {})}
    if loop.table is not None:
        grid, table = loop.table.grid, loop.table
        columns = {name: [float(value) for value in getattr(table, name)] for name in _COLUMNS}
        numbers = {"begin": grid.begin, "spacing": grid.spacing, "periodic": grid.periodic, "v_sign": table.v_sign}
        content["table"] = numbers | columns
    return f"# {heading}\n# C code: friction-fmus codegen {loop.path.name} -o c\n\n{tomli_w.dumps(content)}"


def _position_map(table: Table) -> PositionMap:
    table.known(("begin", "spacing", "periodic", "v_sign", *_COLUMNS))
    begin, spacing, v_sign = (_finite(table, key) for key in ("begin", "spacing", "v_sign"))
    periodic = table.take("periodic", flag, "true or false")
    cogging, friction = (_numbers(table, key) for key in _COLUMNS)
    return PositionMap(Grid(begin, spacing, len(cogging), periodic), cogging, friction, v_sign)


def _numbers(table: Table, key: str) -> tuple[float, ...]:
    values = table.take(key, lambda value: value if isinstance(value, list) else None, "a list of numbers")
    elements = {f"{key}[{i}]": value for i, value in enumerate(values, start=1)}
    return tuple(_finite(Table(elements, table.where, table.error), element) for element in elements)


def _law(table: Table, name: str) -> LoopLaw:
    table.known(("law", "parameters", "connections", *(("output", "factor") if name != "servo" else ())))
    law = table.take("law", text, "the name of a law")
    output = table.take("output", text, "the name of an output of the law", "u")
    parameters, connections = (
        Table(table.content.get(key, {}), f"{table.where} {key},", table.error) for key in ("parameters", "connections")
    )
    for own, kind in ((parameters, bool), (connections, str)):
        for key, value in own.content.items():
            if not isinstance(value, kind):
                _finite(own, key)
    factor = _finite(table, "factor") if "factor" in table else None
    return LoopLaw(law, parameters.content, connections.content, output, factor)


def _finite(table: Table, key: str) -> float:
    return table.take(key, finite, "a finite number")
