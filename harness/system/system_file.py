"""Systems as TOML files."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, TypeAlias

import tomli_w

from harness.errors import ExperimentError, SystemFileError
from harness.extras import MODELS
from harness.parts.fmu import FmuPart
from harness.parts.part import Part, StartValue
from harness.parts.series import SeriesPart
from harness.storage.files import atomic_path, relative
from harness.storage.toml_file import TomlTable, read_table
from harness.system.assembly import Assembly
from harness.system.experiment import Experiment
from harness.system.wire import Wire, manipulator_table, parse_wire, read_manipulator, split_name
from harness.values import flag, number, shown, tables, text, texts, whole

_TOP_KEYS = ("name", "strict", "parts", "wires", "experiment")
_FMU_KEYS = ("every", "start")
_RECORD_KEYS = ("interpolation", "beyond")

# for each key: a function that returns None for a value of the wrong kind, and a text for the message; ranges are
# checked by the classes that receive the values, as they may also come from Python
_Kinds: TypeAlias = Mapping[str, tuple[Callable[[object], Any], str]]
_NUMBER, _WHOLE, _TEXT = (number, "a number"), (whole, "an integer"), (text, "a text on one line")
_PART_KINDS: Final[_Kinds] = {
    **dict.fromkeys(("model", "fmu", "record", "interpolation", "beyond"), _TEXT),
    "every": (whole, "an integer number of communication steps"),
}
_WIRE_KINDS: Final[_Kinds] = {"gain": _NUMBER, "offset": _NUMBER, "delay": _WHOLE, "initial": _NUMBER}
_EXPERIMENT_KINDS: Final[_Kinds] = {
    **dict.fromkeys(
        ("stop", "step", "start", "tolerance", "loop_tolerance", "coupling_tolerance", "step_tolerance"), _NUMBER
    ),
    **dict.fromkeys(("decimate", "extrapolation"), _WHOLE),
    **dict.fromkeys(("record", "order"), (texts, "a list of texts")),
    "master": _TEXT,
    "manipulators": (tables, "a list of tables"),
}


@dataclass(frozen=True)
class SystemDescription:
    """The content of a system file: the arguments of System."""

    parts: tuple[Part, ...]
    wires: tuple[Wire, ...]
    start: dict[str, StartValue]
    experiment: Experiment | None
    name: str
    strict: bool = False


def read_system(path: Path, resolve: Callable[[str], Path] | None) -> SystemDescription:
    """Read a system file; see `System.from_toml`."""
    document = read_table(path, SystemFileError)
    document.known(_TOP_KEYS)
    parts: list[Part] = []
    start: dict[str, StartValue] = {}
    try:
        entries = _table(document, "parts", path)
        for name in entries:
            entry = TomlTable(entries.content[name], f"part '{name}' in {path}", SystemFileError)
            start |= {f"{name}.{key}": value for key, value in _start_values(entry, name, path).items()}
            parts.append(_read_part(name, entry, path, resolve))
        wires: list[object] = document.take("wires", _list, 'a list, such as wires = ["a.y -> b.u"]', [])
        experiment = _table(document, "experiment", path)
        return SystemDescription(
            parts=tuple(parts),
            wires=tuple(_read_wire(wire, path) for wire in wires),
            start=start,
            experiment=_read_experiment(experiment) if "experiment" in document else None,
            name=document.take("name", *_TEXT, path.stem),
            strict=document.take("strict", flag, "true or false", False),
        )
    except BaseException:
        for part in parts:
            part.close()
        raise


def write_system(system: Assembly, path: Path) -> None:
    """Write a system file; see `System.to_toml`."""
    parts = {name: _part_table(part, path) for name, part in system.parts.items()}
    for dotted, value in system.start.items():
        owner, port = split_name(dotted)
        parts[owner].setdefault("start", {})[port] = value
    document: dict[str, Any] = {"name": system.name, **({"strict": True} if system.strict else {})}
    document |= {"wires": [_wire_entry(wire) for wire in system.wires], "parts": parts}
    if system.experiment is not None:
        settings = {key: getattr(system.experiment, key) for key in _EXPERIMENT_KINDS}
        settings["manipulators"] = tuple(map(manipulator_table, system.experiment.manipulators))
        document["experiment"] = {key: value for key, value in settings.items() if value not in (None, ())}
    with atomic_path(path) as temporary:
        temporary.write_text(tomli_w.dumps(document), encoding="utf-8")


def _read_part(name: str, entry: TomlTable, path: Path, resolve: Callable[[str], Path] | None) -> Part:
    kinds, where = [kind for kind in ("model", "fmu", "record") if kind in entry], entry.where
    if len(kinds) != 1:
        raise SystemFileError(f"{where} has {' and '.join(kinds) or 'no source'}: give one of model, fmu, record")
    kind = kinds[0]
    entry.known((kind, *(_RECORD_KEYS if kind == "record" else _FMU_KEYS)))
    settings = {key: entry.take(key, *_PART_KINDS[key]) for key in entry if key != "start"}
    origin = settings.pop(kind)
    try:
        if kind == "record":
            return SeriesPart.from_csv(name, path.parent / origin, **settings)
        if kind == "fmu":
            return FmuPart(name, path.parent / origin, **settings)
        finders = [resolve] if resolve else MODELS
        if not finders:
            raise SystemFileError(
                f"{where} names the model '{origin}', but no function resolves models: give fmu = \"path.fmu\""
            )
        return FmuPart(name, finders[0](origin), model=origin, **settings)
    except OSError as error:
        reason = error.strerror or str(error)
        raise SystemFileError(f"{kind} of {where} is not usable: {reason}; give another path") from error


def _read_wire(entry: object, path: Path) -> Wire:
    """Return a connection from ``"a.y -> b.u"`` or ``{wire = "a.y -> b.u", gain = 2.0, offset = 1.0, delay = 1}``."""
    ends = text(entry.get("wire") if isinstance(entry, dict) else entry)
    if ends is None:
        raise SystemFileError(
            f'{shown(entry)} among the wires in {path} is not a connection: write "a.y -> b.u" or '
            '{wire = "a.y -> b.u", gain = 2.0}'
        )
    wire = parse_wire(ends)
    if not isinstance(entry, dict):
        return wire
    table = TomlTable(entry, f"the connection {wire} in {path}", SystemFileError)
    table.known(("wire", *_WIRE_KINDS))
    return replace(wire, **{key: table.take(key, *_WIRE_KINDS[key]) for key in table if key != "wire"})


def _wire_entry(wire: Wire) -> str | dict[str, Any]:
    if str(wire).count("->") > 1:
        raise SystemFileError(f"the connection {wire} cannot be written: rename what has an arrow in its name")
    plain = Wire(wire.source, wire.target)
    changed = {key: getattr(wire, key) for key in _WIRE_KINDS if getattr(wire, key) != getattr(plain, key)}
    return {"wire": str(wire), **changed} if changed else str(wire)


def _read_experiment(table: TomlTable) -> Experiment:
    table.known(_EXPERIMENT_KINDS)
    settings = {key: table.take(key, *_EXPERIMENT_KINDS[key]) for key in dict.fromkeys(("stop", "step", *table))}
    try:
        settings |= {"manipulators": tuple(read_manipulator(item) for item in settings.get("manipulators", ()))}
    except ExperimentError as error:
        raise SystemFileError(f"{error} (in {table.where})") from error
    return Experiment(**settings)


def _table(document: TomlTable, key: str, path: Path) -> TomlTable:
    return TomlTable(document.content.get(key, {}), f"[{key}] in {path}", SystemFileError)


def _list(value: object) -> list[object] | None:
    return value if isinstance(value, list) else None


def _start_values(entry: TomlTable, part: str, path: Path) -> dict[str, StartValue]:
    table = TomlTable(entry.content.get("start", {}), f"[parts.{part}.start] in {path}", SystemFileError)
    return {key: table.take(key, _start_value, "a number, a text, true or false") for key in table}


def _start_value(value: object) -> Any:
    return value if isinstance(value, (bool, int, float, str)) else None


def _part_table(part: Part, path: Path) -> dict[str, Any]:
    if isinstance(part, FmuPart):
        origin = {"model": part.model} if part.model else {"fmu": relative(part.path, path.parent)}
        every = {"every": part.every} if part.every != 1 else {}
        return {**origin, **every}
    if isinstance(part, SeriesPart) and part.path is not None:
        return {"record": relative(part.path, path.parent), "interpolation": part.interpolation, "beyond": part.beyond}
    raise SystemFileError(
        f"part '{part.name}' cannot be written to {path}: only FMUs and recorded files have a place in it"
    )
