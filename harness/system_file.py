"""Systems as TOML files."""

from __future__ import annotations

import json
import math
import os
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from harness.assembly import Assembly
from harness.atomic import atomic_path
from harness.errors import ExperimentError, SystemFileError, nearest
from harness.experiment import Experiment
from harness.fmu import FmuPart
from harness.manipulator import Manipulator, manipulator_table, read_manipulator
from harness.part import Part, StartValue
from harness.series import SeriesPart
from harness.wire import Wire, parse_wire, split_name

_TOP_KEYS = ("name", "strict", "parts", "wires", "experiment")
_FMU_KEYS = ("every", "start", "isolate", "timeout")
_RECORD_KEYS = ("interpolation", "beyond")
_WIRE_KEYS: dict[str, tuple[type, ...]] = {"gain": (int, float), "offset": (int, float), "delay": (int,)}
_WHOLE = ("decimate", "extrapolation")
_EXPERIMENT_KEYS = tuple(field.name for field in fields(Experiment))


@dataclass(frozen=True)
class SystemDescription:
    """What a system file says: the arguments of System."""

    parts: tuple[Part, ...]
    wires: tuple[Wire, ...]
    start: dict[str, StartValue]
    experiment: Experiment | None
    name: str
    strict: bool = False


def read_system(path: Path, resolve: Callable[[str], Path] | None) -> SystemDescription:
    """Read a system file; see `System.from_toml`.

    Raises
    ------
    SystemFileError
        If the file cannot be read or has keys that are not understood.
    """
    try:
        with path.open("rb") as file:
            document = tomllib.load(file)
    except OSError as error:
        raise SystemFileError(f"cannot read the system file {path}: {error.strerror}; give an existing file") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SystemFileError(f"{path} is not a TOML file: {error}; correct it there") from error

    _check_keys(document, _TOP_KEYS, f"{path}")
    parts: list[Part] = []
    start: dict[str, StartValue] = {}
    try:
        for name, entry in _table(document, "parts", path).items():
            if not isinstance(entry, dict):
                raise SystemFileError(f"part '{name}' in {path} is not a table: write [parts.{name}]")
            parts.append(_read_part(name, entry, path, resolve))
            start.update(
                {f"{name}.{key}": _start_value(key, v, name, path) for key, v in entry.get("start", {}).items()}
            )
        strict = document.get("strict", False)
        if not isinstance(strict, bool):
            raise SystemFileError(f"strict in {path} is {strict!r}: give true or false")
        wires = document.get("wires", [])
        if not isinstance(wires, list):
            raise SystemFileError(f'wires in {path} is not a list: write wires = ["a.y -> b.u"]')
        return SystemDescription(
            parts=tuple(parts),
            wires=tuple(_read_wire(wire, path) for wire in wires),
            start=start,
            experiment=_read_experiment(_table(document, "experiment", path), path)
            if "experiment" in document
            else None,
            name=str(document.get("name", path.stem)),
            strict=strict,
        )
    except BaseException:
        for part in parts:
            part.close()
        raise


def write_system(system: Assembly, path: Path) -> None:
    """Write a system file; see `System.to_toml`."""
    lines = [f"name = {_literal(system.name)}", *(["strict = true"] if system.strict else []), "wires = ["]
    lines += [f"    {_wire_literal(wire)}," for wire in system.wires]
    lines += ["]"]
    for name, part in system.parts.items():
        lines += ["", f"[parts.{_key(name)}]", *_part_lines(part, path)]
        ends = ((split_name(dotted), value) for dotted, value in system.start.items())
        values = {port: value for (owner, port), value in ends if owner == name}
        if values:
            lines += ["", f"[parts.{_key(name)}.start]"]
            lines += [f"{_key(port)} = {_literal(value)}" for port, value in values.items()]
    if system.experiment is not None:
        lines += ["", "[experiment]"]
        settings = ((key, getattr(system.experiment, key)) for key in _EXPERIMENT_KEYS if key != "manipulators")
        lines += [f"{key} = {_literal(value)}" for key, value in settings if value not in (None, ())]
        for manipulator in system.experiment.manipulators:
            lines += ["", "[[experiment.manipulators]]"]
            lines += [f"{key} = {_literal(value)}" for key, value in manipulator_table(manipulator).items()]
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _read_part(name: str, entry: Mapping[str, Any], path: Path, resolve: Callable[[str], Path] | None) -> Part:
    kinds = [kind for kind in ("model", "fmu", "record") if kind in entry]
    if len(kinds) != 1:
        raise SystemFileError(
            f"part '{name}' in {path} has {' and '.join(kinds) or 'no origin'}: give one of model, fmu, record"
        )
    kind = kinds[0]
    where = f"part '{name}' in {path}"
    _check_keys(entry, (kind, *(_RECORD_KEYS if kind == "record" else _FMU_KEYS)), where)
    origin = entry[kind]
    if not isinstance(origin, str):
        raise SystemFileError(f"{kind} of {where} is {origin!r}: give a text")
    if kind == "record":
        return SeriesPart.from_csv(
            name,
            path.parent / origin,
            interpolation=entry.get("interpolation", "linear"),
            beyond=entry.get("beyond", "error"),
        )
    every = entry.get("every", 1)
    if not isinstance(every, int) or isinstance(every, bool):
        raise SystemFileError(f"every of {where} is {every!r}: give a whole number of ticks")
    if not isinstance(entry.get("start", {}), dict):
        raise SystemFileError(f"start of {where} is not a table: write [parts.{name}.start]")
    isolation = _read_isolation(entry, where)
    if kind == "fmu":
        return FmuPart(name, path.parent / origin, every=every, **isolation)
    if resolve is None:
        raise SystemFileError(
            f"{where} names the model '{origin}' but nothing here knows models: give fmu = \"path.fmu\""
        )
    return FmuPart(name, resolve(origin), every=every, model=origin, **isolation)


def _read_isolation(entry: Mapping[str, Any], where: str) -> dict[str, Any]:
    isolation = {key: entry[key] for key in ("isolate", "timeout") if key in entry}
    if not isinstance(isolation.get("isolate", False), bool):
        raise SystemFileError(f"isolate of {where} is {entry['isolate']!r}: give true or false")
    if type(isolation.get("timeout", 1.0)) not in (int, float):
        raise SystemFileError(f"timeout of {where} is {entry['timeout']!r}: give a number of seconds")
    return isolation


def _read_wire(entry: object, path: Path) -> Wire:
    """A wire from ``"a.y -> b.u"`` or ``{wire = "a.y -> b.u", gain = 2.0, offset = 1.0, delay = 1}``."""
    if isinstance(entry, str):
        return parse_wire(entry)
    if not isinstance(entry, dict) or not isinstance(entry.get("wire"), str):
        raise SystemFileError(
            f'{entry!r} among the wires in {path} is no wire: write "a.y -> b.u" or {{wire = "a.y -> b.u", gain = 2.0}}'
        )
    wire = parse_wire(entry["wire"])
    where = f"the wire {wire} in {path}"
    _check_keys(entry, ("wire", *_WIRE_KEYS), where)
    for key, types in _WIRE_KEYS.items():
        value = entry.get(key, 0)
        if isinstance(value, bool) or not isinstance(value, types):
            raise SystemFileError(f"{key} of {where} is {value!r}: that is not of the right type")
    return replace(wire, **{key: entry[key] for key in _WIRE_KEYS if key in entry})


def _wire_literal(wire: Wire) -> str:
    plain = Wire(wire.source, wire.target)
    changed = {key: getattr(wire, key) for key in _WIRE_KEYS if getattr(wire, key) != getattr(plain, key)}
    return _literal({"wire": str(wire), **changed}) if changed else _literal(str(wire))


def _read_experiment(table: Mapping[str, Any], path: Path) -> Experiment:
    where = f"[experiment] in {path}"
    _check_keys(table, _EXPERIMENT_KEYS, where)
    settings: dict[str, Any] = {}
    for key, value in table.items():
        if key in ("record", "order"):
            good = isinstance(value, list) and all(isinstance(item, str) for item in value)
            settings[key] = tuple(value) if good else None
        elif key == "manipulators":
            if isinstance(value, list) and all(isinstance(item, dict) for item in value):
                settings[key] = tuple(_read_manipulator(item, where) for item in value)
        elif key == "master":
            settings[key] = value if isinstance(value, str) else None
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            settings[key] = value if key in _WHOLE else float(value)
        if settings.get(key) is None or (key in _WHOLE and not isinstance(value, int)):
            raise SystemFileError(f"{key} of {where} is {value!r}: that is not of the right type")
    for key in ("stop", "step"):
        if key not in settings:
            raise SystemFileError(f"{where} has no {key}: add one, in seconds")
    return Experiment(**settings)


def _read_manipulator(table: Mapping[str, Any], where: str) -> Manipulator:
    try:
        return read_manipulator(table)
    except ExperimentError as error:
        raise SystemFileError(f"{error} (in {where})") from error


def _table(document: Mapping[str, Any], key: str, path: Path) -> Mapping[str, Any]:
    table = document.get(key, {})
    if not isinstance(table, dict):
        raise SystemFileError(f"{key} in {path} is not a table: write [{key}]")
    return table


def _start_value(key: str, value: object, part: str, path: Path) -> StartValue:
    if isinstance(value, (bool, int, float, str)):
        return value
    raise SystemFileError(
        f"start value {key} of part '{part}' in {path} is {value!r}: give a number, a text, true or false"
    )


def _check_keys(table: Mapping[str, Any], known: Iterable[str], where: str) -> None:
    for key in table:
        if key not in known:
            raise SystemFileError(f"'{key}' means nothing in {where}: {nearest(key, known)}")


def _part_lines(part: Part, path: Path) -> list[str]:
    if isinstance(part, FmuPart):
        origin = ("model", part.model) if part.model else ("fmu", _relative(part.path, path))
        every = [f"every = {part.every}"] if part.every != 1 else []
        isolation = ["isolate = true", f"timeout = {_literal(part.timeout)}"] if part.isolate else []
        return [f"{origin[0]} = {_literal(origin[1])}", *every, *isolation]
    if isinstance(part, SeriesPart) and part.path is not None:
        return [
            f"record = {_literal(_relative(part.path, path))}",
            f"interpolation = {_literal(part.interpolation)}",
            f"beyond = {_literal(part.beyond)}",
        ]
    raise SystemFileError(
        f"part '{part.name}' cannot be written to {path}: only FMUs and recorded files have a place in it"
    )


def _relative(target: Path, path: Path) -> str:
    try:
        return Path(os.path.relpath(target, path.parent)).as_posix()
    except ValueError:  # another drive
        return target.resolve().as_posix()


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _literal(name)


def _literal(value: object) -> str:
    """A value as TOML writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_literal(item)}" for key, item in value.items()) + "}"
    if isinstance(value, tuple):
        return "[" + ", ".join(_literal(item) for item in value) + "]"
    if isinstance(value, float) and math.isinf(value):
        return "inf" if value > 0 else "-inf"
    # JSON texts are TOML basic strings once DEL is escaped
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f") if isinstance(value, str) else repr(value)
