"""Configuration of a study, read from TOML."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Final

from friction_fmus.axis.servo import GAINS, Servo
from friction_fmus.errors import FrictionError, nearest
from friction_fmus.study.compensator_records import Limits
from friction_fmus.study.ranking import Weights
from harness.storage.files import reason
from harness.storage.toml_file import read_toml
from harness.values import number, shown, texts

OPTIONAL_GAINS: Final[Mapping[str, float]] = {"ki": 0.0}
"""Default values of optional gains, equal to the start values of the law."""

RECORDS: Final = ("emps", "tribometer", "demo")
"""Records included in the package, and names of the studies of them."""

ALL: Final = "all"

PERIODS: Final = (1e-6, 0.1)
"""Shortest and longest sample time of a servo [s]."""

LONGEST_WINDOW: Final = 64
"""Largest window of the velocity estimate in samples: the limit of the block Differentiator."""

LONGEST_DELAY: Final = 100
"""Longest delay of the drive in samples."""

_TABLES = ("data", "columns", "windows", "servo", "identify", "compensation")


class ConfigError(FrictionError):
    """Invalid configuration; the message names file, table and key."""


@dataclass(frozen=True)
class Compensation:
    """Settings of the comparison of compensators on an axis.

    Attributes
    ----------
    compensators : tuple of str or "all"
        Names of laws.
    gains : tuple of float
        Gains of the compensation; values above 1 show the effect of over-compensation.
    mismatch : float
        Relative error of friction and mass in the robustness runs, such as 0.1.
    motion_feedforward : bool
        Whether the servo receives the reference velocity and acceleration, so that friction dominates the error.
    duration : float or None
        Simulated part of the reference, from its start [s]; None for all of it.
    delays : tuple of int
        Further delays of the force in the robustness runs [samples].
    limits : Limits
        Limits on the margins of every compared loop.
    weights : Weights
        Weights of the figures in the ranking.
    """

    compensators: tuple[str, ...] | str = ALL
    gains: tuple[float, ...] = (0.2, 0.4, 0.6, 0.8, 1.0, 1.2)
    mismatch: float = 0.1
    motion_feedforward: bool = True
    duration: float | None = None
    delays: tuple[int, ...] = (1, 2)
    limits: Limits = field(default_factory=Limits)
    weights: Weights = field(default_factory=Weights)


@dataclass(frozen=True)
class StudyConfig:
    """Configuration of a study.

    Attributes
    ----------
    name : str
        Argument of ``friction-fmus study``: the path of the configuration, or one of `RECORDS`.
    record : str
        One of `RECORDS`; empty if the data are in a file.
    data : mapping of str to mapping
        Tables ``data``, ``columns`` and ``windows``, see `read_mapping`.
    folder : Path
        Folder to which the path of the data file is relative.
    servo : Servo or None
        Servo of the axis; None for a contact without an axis.
    models : tuple of str or "all"
        Friction models to identify.
    position_map : bool
        Whether cogging and position-dependent friction are identified with each model, if this improves the prediction.
    viscous : bool
        Whether viscous friction is identified beside models without it.
    compensation : Compensation
        Settings of the comparison of compensators.
    bare : bool
        Whether the study was started with a data file instead of its configuration, which it then writes.
    """

    name: str
    record: str
    data: Mapping[str, Any]
    folder: Path
    servo: Servo | None = None
    models: tuple[str, ...] | str = ALL
    position_map: bool = True
    viscous: bool = True
    compensation: Compensation = field(default_factory=Compensation)
    bare: bool = False


def load_config(what: str | Path) -> StudyConfig:
    """Read the configuration of a study.

    Parameters
    ----------
    what : str or Path
        One of `RECORDS`, the path of a TOML file, or the path of a data file whose headings name its columns.

    Returns
    -------
    StudyConfig
        Validated configuration.

    Raises
    ------
    ConfigError
        If the file is missing, is not valid TOML, or has an invalid or unknown entry.
    """
    known = str(what) in RECORDS
    path = Path(__file__).with_name("axes") / f"{what}.toml" if known else Path(what)
    if not path.is_file():
        hint = nearest(str(what), RECORDS)
        choice = ", ".join(RECORDS)
        raise ConfigError(
            f"There is no file {what}{hint}; give the path of a data file or of a configuration, or one of {choice}."
        )
    if path.suffix.lower() != ".toml":
        return StudyConfig(str(what), "", {"data": {"file": path.name}}, path.parent, bare=True)
    try:
        table = read_toml(path)
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path} cannot be read as TOML ({reason(error)}); correct it.") from error
    return parse_config(table, path.parent, str(what))


def parse_config(content: Mapping[str, Any], folder: Path = Path(), origin: str = "The configuration") -> StudyConfig:
    """Read the configuration of a study from its tables.

    Parameters
    ----------
    content : mapping of str to mapping
        Tables of the configuration, as in a TOML file.
    folder : Path
        Folder to which the path of the data file is relative.
    origin : str
        Name of the configuration in error messages.

    Returns
    -------
    StudyConfig
        Validated configuration.

    Raises
    ------
    ConfigError
        If an entry is missing, invalid or unknown.
    """
    _known(content, _TABLES, origin, "table")
    tables = {name: _Table(content.get(name, {}), f"{origin}, [{name}],", name) for name in _TABLES}
    data = dict(tables["data"].content)
    record = tables["data"].text("record", choices=RECORDS) if "record" in data else ""
    if record and (data.keys() - {"record"} or "columns" in content):
        raise ConfigError(
            f"{origin}, [data], names the record {record!r} and also describes a file; remove one of the two."
        )
    if not record and "file" not in data:
        raise ConfigError(f'{origin}, [data], has no file; give the path of the data file as file = "...".')
    mapping = {name: content[name] for name in ("data", "columns", "windows") if name in content}
    models = tables["identify"]
    models.known(("models", "position_map", "viscous"))
    return StudyConfig(
        origin,
        record,
        mapping,
        folder,
        _servo(tables["servo"]) if "servo" in content else None,
        models.names("models"),
        models.flag("position_map", True),
        models.flag("viscous", True),
        _compensation(tables["compensation"]),
    )


def read_models(path: Path) -> list[str]:
    """Return the names of the models in the table ``[identify]`` of a TOML file; ``["all"]`` without one."""
    try:
        content = read_toml(path)
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path} cannot be read as TOML ({reason(error)}); correct it.") from error
    models = _Table(content.get("identify", {}), f"{path}, [identify],", "identify")
    models.known(("models",))
    names = models.names("models")
    return [names] if isinstance(names, str) else list(names)


def _servo(table: _Table) -> Servo:
    law = table.text("law", choices=tuple(GAINS))
    names = GAINS[law]
    other = ("law", "Ts", "force_limit", "window", "quantum", "velocity_feedforward", "inertia_feedforward", "mass")
    table.known((*names, *other, "delay", "noise"))
    gains = {name: table.number(name, low=0.0, above=True) for name in names[:-1]}
    return Servo(
        law,
        Ts=_period(table),
        force_limit=table.number("force_limit", low=0.0, above=True),
        window=table.whole("window", 2, low=1, high=LONGEST_WINDOW),
        quantum=table.number("quantum", 0.0, low=0.0),
        velocity_feedforward=table.flag("velocity_feedforward", False),
        inertia_feedforward=table.number("inertia_feedforward", 0.0, low=0.0),
        mass=table.number("mass", low=0.0, above=True) if "mass" in table.content else None,
        gains={**gains, names[-1]: table.number(names[-1], OPTIONAL_GAINS.get(names[-1]), low=0.0)},
        delay=table.whole("delay", 0, low=0, high=LONGEST_DELAY),
        noise=table.number("noise", 0.0, low=0.0),
    )


def _period(table: _Table) -> float:
    """Return the sample time; outside of `PERIODS` a record could be neither simulated nor evaluated."""
    least, most = PERIODS
    Ts = table.number("Ts", low=0.0, above=True)
    if not least <= Ts <= most:
        raise ConfigError(f"{table.where} has Ts = {Ts:g}; give a sample time from {least:g} to {most:g} s.")
    return Ts


def _compensation(table: _Table) -> Compensation:
    known = ("compensators", "gains", "mismatch", "motion_feedforward", "duration", "delays", "Ms", "delay_margin")
    table.known((*known, "weights"))
    default = Compensation()
    gains = table.numbers("gains", default.gains)
    if not any(0.0 < gain <= 1.0 for gain in gains):
        raise ConfigError(f"{table.where} has gains = {list(gains)}, none of them above 0 and up to 1; add 1.0.")
    return Compensation(
        table.names("compensators"),
        tuple(sorted(set(gains))),
        table.number("mismatch", default.mismatch, low=0.0, high=0.9),
        table.flag("motion_feedforward", default.motion_feedforward),
        table.number("duration", low=0.0, above=True) if "duration" in table.content else None,
        _delays(table),
        Limits(
            table.number("Ms", default.limits.Ms, low=1.0, above=True),
            table.number("delay_margin", default.limits.delay, low=0.0),
        ),
        _weights(table),
    )


def _delays(table: _Table) -> tuple[int, ...]:
    values = table.content.get("delays", list(Compensation.delays))
    found = [number(value) for value in values] if isinstance(values, list) else [None]
    if any(value is None or value != int(value) or not 1 <= value <= LONGEST_DELAY for value in found):
        raise ConfigError(
            f"{table.where} has delays = {shown(values)}; give a list of integers from 1 to {LONGEST_DELAY}."
        )
    return tuple(sorted({int(value) for value in found if value is not None}))


def _weights(table: _Table) -> Weights:
    weights = _Table(table.content.get("weights", {}), f"{table.where} weights,", "weights")
    names = tuple(each.name for each in fields(Weights))
    weights.known(names)
    default = Weights()
    return Weights(**{name: weights.number(name, getattr(default, name), low=0.0) for name in names})


@dataclass(frozen=True)
class _Table:
    """One table of the configuration; each value is validated when it is read."""

    content: Any
    where: str
    name: str

    def __post_init__(self) -> None:
        if not isinstance(self.content, Mapping):
            raise ConfigError(f"{self.where} is {shown(self.content)}, not a table; make it a table.")

    def known(self, keys: tuple[str, ...]) -> None:
        _known(self.content, keys, self.where, "key")

    def text(self, key: str, choices: tuple[str, ...]) -> str:
        value = self._value(key)
        if value not in choices:
            hint = nearest(value, choices) if isinstance(value, str) else ""
            raise ConfigError(f"{self.where} has {key} = {shown(value)}{hint}; use one of {', '.join(choices)}.")
        return str(value)

    def flag(self, key: str, default: bool) -> bool:
        value = self.content.get(key, default)
        if not isinstance(value, bool):
            raise ConfigError(f"{self.where} has {key} = {shown(value)}; use true or false.")
        return value

    def number(
        self, key: str, default: float | None = None, *, low: float, high: float = math.inf, above: bool = False
    ) -> float:
        value = self._value(key) if default is None else self.content.get(key, default)
        found = number(value)
        if found is None or not (low <= found <= high and found < math.inf) or (above and found == low):
            limits = f"above {low:g}" if above else f"from {low:g}" + (f" to {high:g}" if high < math.inf else "")
            raise ConfigError(f"{self.where} has {key} = {shown(value)}; give a number {limits}.")
        return found

    def whole(self, key: str, default: int, *, low: int, high: int) -> int:
        value = self.number(key, float(default), low=low, high=high)
        if value != int(value):
            raise ConfigError(f"{self.where} has {key} = {value:g}; give an integer number of samples.")
        return int(value)

    def numbers(self, key: str, default: tuple[float, ...]) -> tuple[float, ...]:
        values = self.content.get(key, list(default))
        found = [number(value) for value in values] if isinstance(values, list) else []
        if not found or any(value is None or not 0 < value <= 2 for value in found):
            raise ConfigError(f"{self.where} has {key} = {shown(values)}; give a list of numbers above 0 and up to 2.")
        return tuple(value for value in found if value is not None)

    def names(self, key: str) -> tuple[str, ...] | str:
        values = self.content.get(key, ALL)
        if values == ALL:
            return ALL
        names = texts(values)
        if not names:
            raise ConfigError(f'{self.where} has {key} = {shown(values)}; give "all" or a list of names.')
        return tuple(dict.fromkeys(names))

    def _value(self, key: str) -> Any:
        if key not in self.content:
            raise ConfigError(f"{self.where} has no {key}; add it.")
        return self.content[key]


def _known(content: Mapping[str, Any], names: tuple[str, ...], where: str, noun: str) -> None:
    for name in content:
        if name not in names:
            hint = nearest(name, names)
            raise ConfigError(f"{where} has the unknown {noun} {shown(name)}{hint}; valid are {', '.join(names)}.")
