"""Configuration of a study, read from TOML; settings of a servo may be in the units of its drive."""

import math
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

from friction_fmus.axis.servo import GAINS, LOGGED_FORCES, LowPass, Notch, Servo
from friction_fmus.errors import FrictionError, RecordError, did_you_mean
from friction_fmus.identification import Measurement
from friction_fmus.identification.data.mapping import MISSING
from friction_fmus.identification.data.record import parse_quantity, unit_of
from friction_fmus.study.study_result import Limits
from harness.storage.toml_file import TomlTable, read_table
from harness.units import BaseUnit, parse_unit
from harness.values import finite, flag, shown, texts


class Quantity(NamedTuple):
    """Unit with places for numerator and denominator, an example, and whether the numerator is a force."""

    unit: str
    example: str
    of_force: bool = True


QUANTITIES: Final[Mapping[str, Quantity]] = {
    "kp": Quantity("{}/s/{}", "1 m/min/mm", False),
    **dict.fromkeys(("kv", "Kd", "viscous_feedforward"), Quantity("{}/({}/s)", "0.5 A/rpm")),
    **dict.fromkeys(("ki", "Kp"), Quantity("{}/{}", "20 A/rev")),
    "Ki": Quantity("{}/({}.s)", "20 A/(rev.s)"),
    **dict.fromkeys(("force_limit", "coulomb_feedforward"), Quantity("{}", "10 A")),
    **dict.fromkeys(("mass", "inertia_feedforward"), Quantity("{}/({}/s2)", "0.002 kg.m2")),
    **dict.fromkeys(("quantum", "noise"), Quantity("{}", "0.01 deg", False)),
    **dict.fromkeys(("Ts", "Tn"), Quantity("s", "20 ms")),
    "current_loop": Quantity("Hz", "800 Hz"),
}
"""Settings that may have a unit."""

OF_DRIVE: Final = ("torque_constant", "pitch", "Tn")  # settings from which others are computed

_LINEAR: Final = {True: (("N", "m"), ("A", "m"), ("A", "rad"), ("N.m", "rad")), False: (("m", "m"), ("rad", "m"))}
_ROTARY: Final = {True: (("N.m", "rad"), ("A", "rad")), False: (("rad", "rad"),)}
"""Numerators and denominators on a linear and a rotary axis, by whether the numerator is a force."""


@dataclass(frozen=True)
class DriveUnits:
    """Settings of a servo as they are given."""

    table: TomlTable
    rotary: bool  # whether the axis is rotary
    gain: str = ""  # factor of the column of the force, which is the torque constant if its unit fits; empty if unknown

    def converted(self) -> TomlTable:
        """Return the settings as numbers in the units of the axis, with an integral gain instead of ``Tn``."""
        given = self.table.content
        integral, Tn = GAINS.get(str(given.get("law")), ("",))[-1], self._value("Tn")
        if "Tn" in given and integral in given:
            raise self.table.error(f"{self.table.where} has both Tn and {integral}; remove one of the two")
        if "Tn" in given and not (finite(Tn) or 0.0) > 0.0:
            raise self._error("Tn", 'give a reset time above 0 in s, or with a unit: "20 ms"')
        content = {name: self._value(name) for name in given if name not in OF_DRIVE}
        gain = finite(content.get("kv" if integral == "ki" else "Kp"))
        if Tn is not None and gain is not None:  # a missing gain is named when the gains are read
            content[integral] = gain / Tn
        return TomlTable(content, self.table.where, self.table.error)

    def _value(self, name: str) -> Any:
        """Return a text with a unit as a number, and any other value as it is."""
        value = self.table.content.get(name)
        if name not in QUANTITIES or not isinstance(value, str) or value == MISSING:
            return value
        quantity = QUANTITIES[name]
        number, unit = self._parsed(name, quantity.example)
        pairs = (_ROTARY if self.rotary else _LINEAR)[quantity.of_force]
        for pair in pairs:
            if _fits(unit, quantity.unit.format(*pair), inertia="s2" in quantity.unit):
                sizes = [self._size(name, symbol) for symbol in pair[: quantity.unit.count("{}")]]
                return number * unit.factor * math.prod(sizes[:1]) / math.prod(sizes[1:])
        fitting = ", ".join(dict.fromkeys(quantity.unit.format(*pair) for pair in pairs))
        fitting = fitting.replace("rad/s/rad", "1/s").replace("m/s/m", "1/s")
        axis = f"on a {'rotary' if self.rotary else 'linear'} axis, " if "{}" in quantity.unit else ""
        raise self._error(name, f'{axis}give it in {fitting} or multiples, such as "{quantity.example}"')

    def _size(self, name: str, symbol: str) -> float:
        """Return a unit of the drive in the unit of the axis."""
        if symbol == "A":
            return self._torque_constant(name)
        if self.rotary or symbol in ("N", "m"):
            return 1.0
        way = self._pitch(name) / (2.0 * math.pi)
        return way if symbol == "rad" else 1.0 / way

    def _torque_constant(self, name: str) -> float:
        """Return the force of the axis per ampere."""
        own = "torque_constant" in self.table
        try:
            number, unit = parse_quantity(self.gain, "") if not own else self._parsed("torque_constant", "0.5 N.m/A")
        except RecordError:
            number, unit = 0.0, BaseUnit()
        for force in ("N.m",) if self.rotary else ("N", "N.m"):
            if _fits(unit, f"{force}/A"):
                if own and number <= 0.0:
                    break
                return abs(number) * unit.factor * self._size(name, force)  # a column may count the other way
        if own:
            raise self._error("torque_constant", f"give it above 0 in N.m/A{'' if self.rotary else ' or N/A'}")
        raise self._error(name, 'add torque_constant = "0.5 N.m/A", or "60 N/A" of a linear motor, to convert it')

    def _pitch(self, name: str) -> float:
        """Return the way per turn of the motor [m]."""
        if "pitch" not in self.table:
            raise self._error(name, 'on a linear axis, add pitch = "10 mm", the way per turn, to convert it')
        number, unit = self._parsed("pitch", "10 mm")
        turn = 2.0 * math.pi if _fits(unit, "m/rad") else 1.0
        if number <= 0.0 or not (_fits(unit, "m/rad") or _fits(unit, "m")):
            raise self._error("pitch", 'give the way per turn of the motor with its unit, such as "10 mm"')
        return number * unit.factor * turn

    def _parsed(self, name: str, example: str) -> tuple[float, BaseUnit]:
        try:
            return parse_quantity(self.table.content[name], f"{self.table.where} {name}", example)
        except RecordError as error:
            raise self.table.error(str(error)) from error

    def _error(self, name: str, remedy: str) -> Exception:
        return self.table.error(f"{self.table.where} has {name} = {shown(self.table.content[name])}; {remedy}")


def _fits(unit: BaseUnit, name: str, inertia: bool = False) -> bool:
    """Return whether a unit has the dimension of another one; an inertia is in kg.m2 as well as in N.m/(rad/s2)."""
    known = parse_unit(name)
    assert known is not None
    return unit.exponents == known.exponents or (inertia and unit.exponents[:-1] == known.exponents[:-1])


OPTIONAL_GAINS: Final[Mapping[str, tuple[float, ...]]] = {"ki": (0.0,)}
"""Default values of optional gains, equal to the start values of the law."""

RECORDS: Final = ("emps", "tribometer", "demo")  # records included in the package, and names of the studies of them

ALL: Final = "all"
BEST_KNOWN_MODELS: Final = ("Coulomb", "Stribeck", "LuGre")
BEST_KNOWN_LAWS: Final = (
    *("StaticFeedforward", "LuGreFeedforward", "IntegralAction", "DisturbanceObserver", "ExtendedStateObserver"),
    "PredictiveFilter",
)
"""Friction models and compensators that a study tries unless it is asked for others, or for all of them."""


PERIODS: Final = (1e-6, 0.1)  # shortest and longest sample time of a servo [s]
LONGEST_WINDOW: Final = 64  # largest window of the velocity estimate in samples: the limit of the block Differentiator
OF_RECORD: Final = -1.0  # resolution of the position that stands for that of the record
LONGEST_DELAY: Final = 100  # longest delay of the drive in samples

_TABLES = ("data", "columns", "windows", "servo", "axis", "identify", "compensation")


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
    mismatch, mass_mismatch : float
        Relative errors of friction and mass in the robustness runs. A record determines both better; friction of a
        warm machine repeats to some percent, and changes more from a cold start or with wear. Friction is at least as
        far off as the drive force that its model does not explain.
    motion_feedforward : bool
        Whether the servo receives the reference velocity and acceleration, so that friction dominates the error.
    duration : float or None
        Simulated part of the reference, from its start [s]; None for all of it.
    delays : tuple of int
        Further delays of the force in the robustness runs [samples].
    limits : Limits
        Limits on the margins of every compared loop.
    """

    compensators: tuple[str, ...] | str = BEST_KNOWN_LAWS
    gains: tuple[float, ...] = (0.2, 0.4, 0.6, 0.8, 1.0, 1.2)
    mismatch: float = 0.05
    mass_mismatch: float = 0.02
    motion_feedforward: bool = True
    duration: float | None = None
    delays: tuple[int, ...] = (1, 2)
    limits: Limits = field(default_factory=Limits)


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
    measurement : Measurement or None
        The data, if they are read already.
    resonances : tuple of float
        Known resonances of the axis, in ascending order [Hz].
    rotary : bool or None
        Whether the units of `servo` are those of a rotary axis; None if they fit both kinds.
    """

    name: str
    record: str
    data: Mapping[str, Any]
    folder: Path
    servo: Servo | None = None
    models: tuple[str, ...] | str = BEST_KNOWN_MODELS
    position_map: bool = True
    viscous: bool = True
    compensation: Compensation = field(default_factory=Compensation)
    bare: bool = False
    measurement: Measurement | None = None
    resonances: tuple[float, ...] = ()
    rotary: bool | None = None

    @property
    def command(self) -> str:
        """Command that runs the study."""
        words = ["friction-fmus", "study", self.name]
        if self.measurement is not None:
            given = self.measurement.mapping
            words += [*map(str, given.more), *(["--columns", given.option] if given.option else [])]
            words += ["--gain", given.gain] if given.gain else []
        return shlex.join([*words, *(["--full"] if self.models == ALL == self.compensation.compensators else [])])


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
        hint = did_you_mean(str(what), RECORDS)
        choice = ", ".join(RECORDS)
        raise ConfigError(
            f"There is no file {what}{hint}; give the path of a data file or of a configuration, or one of {choice}."
        )
    if path.suffix.lower() != ".toml":
        return StudyConfig(str(what), "", {"data": {"file": path.name}}, path.parent, bare=True)
    return parse_config(read_table(path, ConfigError).content, path.parent, str(what))


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
    TomlTable(content, origin, ConfigError).known(_TABLES, "table")
    tables = {name: _table(content, name, origin) for name in _TABLES}
    data = tables["data"].content
    record = tables["data"].choice("record", RECORDS) if "record" in data else ""
    if record and (data.keys() - {"record"} or "columns" in content):
        raise ConfigError(
            f"{origin}, [data], names the record {record!r} and also describes a file; remove one of the two."
        )
    if not record and "file" not in data:
        raise ConfigError(f'{origin}, [data], has no file; give the path of the data file as file = "...".')
    mapping = {name: content[name] for name in ("data", "columns", "windows") if name in content}
    models = tables["identify"]
    models.known(("models", "position_map", "viscous"))
    tables["axis"].known(("resonance",))
    servo, rotary = _servo_of_axis(tables["servo"], tables["columns"].content) if "servo" in content else (None, None)
    remedy = "a list of frequencies in Hz above 0"
    return StudyConfig(
        origin,
        record,
        mapping,
        folder,
        servo,
        _names(models, "models", BEST_KNOWN_MODELS),
        _flag(models, "position_map", True),
        _flag(models, "viscous", True),
        _compensation(tables["compensation"]),
        resonances=tables["axis"].take("resonance", lambda value: _list(value, lambda each: each > 0.0), remedy, ()),
        rotary=rotary,
    )


def read_models(path: Path) -> list[str]:
    """Return the names of the models in the table ``[identify]`` of a TOML file; ``["all"]`` without one."""
    models = _table(read_table(path, ConfigError).content, "identify", str(path))
    models.known(("models",))
    names = _names(models, "models", ALL)
    return [names] if isinstance(names, str) else list(names)


def _servo_of_axis(table: TomlTable, columns: Mapping[str, Any]) -> tuple[Servo, bool | None]:
    """Return the servo, and whether its units are those of a rotary axis, None if they fit both kinds."""
    force, position = (each if isinstance(each := columns.get(role), Mapping) else {} for role in ("force", "position"))
    found, wrong = {}, {}
    for rotary in (False,) if "pitch" in table else (False, True):
        try:
            found[rotary] = _servo(table, rotary, str(force.get("gain", "")))
        except ConfigError as error:
            wrong[rotary] = error
    if not found:
        unit = unit_of(str(position.get("unit", "")))
        raise wrong.get(unit is not None and unit.exponents[-1] == 1, wrong[False])
    rotary = min(found)
    return found[rotary], None if len(found) == 2 else rotary


def _servo(given: TomlTable, rotary: bool, gain: str) -> Servo:
    law = given.choice("law", GAINS)
    names = GAINS[law]
    other = ("law", "Ts", "force_limit", "window", "quantum", "velocity_feedforward", "inertia_feedforward", "mass")
    more = ("delay", "noise", "velocity_filter", "notch", "coulomb_feedforward", "viscous_feedforward", "current_loop")
    given.known((*names, *other, *more, "logged_force", *OF_DRIVE))
    table = DriveUnits(given, rotary, gain).converted()
    gains = {name: _number(table, name, low=0.0, above=True) for name in names[:-1]}
    return Servo(
        law,
        Ts=_period(table),
        force_limit=_number(table, "force_limit", low=0.0, above=True),
        window=_whole(table, "window", 2, low=1, high=LONGEST_WINDOW),
        quantum=_number(table, "quantum", low=0.0) if "quantum" in table else OF_RECORD,
        velocity_feedforward=_flag(table, "velocity_feedforward", False),
        inertia_feedforward=_number(table, "inertia_feedforward", 0.0, low=0.0),
        mass=_number(table, "mass", low=0.0, above=True) if "mass" in table else None,
        gains={**gains, names[-1]: _number(table, names[-1], *OPTIONAL_GAINS.get(names[-1], ()), low=0.0)},
        delay=_whole(table, "delay", 0, low=0, high=LONGEST_DELAY),
        noise=_number(table, "noise", 0.0, low=0.0),
        velocity_filter=_lowpass(table),
        notch=_notch(table),
        coulomb_feedforward=_number(table, "coulomb_feedforward", 0.0, low=0.0),
        viscous_feedforward=_number(table, "viscous_feedforward", 0.0, low=0.0),
        current_loop=_number(table, "current_loop", 0.0, low=0.0),
        logged_force=table.choice("logged_force", LOGGED_FORCES, ""),
    )


def _filter(servo: TomlTable, key: str, frequency: str, *others: str) -> tuple[float, TomlTable] | None:
    """Return the frequency of a filter and its inline table; None without it."""
    if key not in servo:
        return None
    table = TomlTable(servo.content[key], f"{servo.where} {key},", ConfigError)
    table.known((frequency, *others))
    most = 0.5 / _period(servo)
    remedy = f"a frequency in Hz above 0 and below {most:g}, half of the sample rate"
    return table.take(frequency, lambda value: f if (f := finite(value)) and 0.0 < f < most else None, remedy), table


def _lowpass(servo: TomlTable) -> LowPass | None:
    own = _filter(servo, "velocity_filter", "cutoff", "order")
    return None if own is None else LowPass(_whole(own[1], "order", 1, low=1, high=2, unit=""), own[0])


def _notch(servo: TomlTable) -> Notch | None:
    own = _filter(servo, "notch", "frequency", "damping", "depth")
    if own is None:
        return None
    damping = _number(own[1], "damping", low=0.0, above=True)
    return Notch(own[0], damping, _number(own[1], "depth", 0.0, low=0.0))


def _period(table: TomlTable) -> float:
    """Return the sample time; outside of `PERIODS` a record could be neither simulated nor evaluated."""
    least, most = PERIODS
    remedy = f"a sample time from {least:g} to {most:g} s"
    return table.take("Ts", lambda value: Ts if (Ts := finite(value)) and least <= Ts <= most else None, remedy)


def _compensation(table: TomlTable) -> Compensation:
    known = ("compensators", "gains", "mismatch", "mass_mismatch", "motion_feedforward", "duration", "delays", "Ms")
    table.known((*known, "delay_margin"))
    default = Compensation()
    remedy = "a list of numbers above 0 and up to 2"
    gains = table.take("gains", lambda value: _list(value, lambda each: 0 < each <= 2), remedy, default.gains)
    if not any(0.0 < gain <= 1.0 for gain in gains):
        raise ConfigError(f"{table.where} has gains = {list(gains)}, none of them above 0 and up to 1; add 1.0.")
    return Compensation(
        _names(table, "compensators", BEST_KNOWN_LAWS),
        gains,
        _number(table, "mismatch", default.mismatch, low=0.0, high=0.9),
        _number(table, "mass_mismatch", default.mass_mismatch, low=0.0, high=0.9),
        _flag(table, "motion_feedforward", default.motion_feedforward),
        _number(table, "duration", low=0.0, above=True) if "duration" in table else None,
        _delays(table),
        Limits(
            _number(table, "Ms", default.limits.Ms, low=1.0, above=True),
            _number(table, "delay_margin", default.limits.delay, low=0.0),
        ),
    )


def _delays(table: TomlTable) -> tuple[int, ...]:
    def read(value: object) -> tuple[int, ...] | None:
        found = _list(value, lambda each: each == int(each) and 1 <= each <= LONGEST_DELAY)
        return () if value == [] else None if found is None else tuple(int(each) for each in found)

    return table.take("delays", read, f"a list of integers from 1 to {LONGEST_DELAY}", Compensation.delays)


def _table(content: Mapping[str, Any], name: str, origin: str) -> TomlTable:
    return TomlTable(content.get(name, {}), f"{origin}, [{name}],", ConfigError)


def _number(
    table: TomlTable, key: str, *default: float, low: float, high: float = math.inf, above: bool = False
) -> float:
    def read(value: object) -> float | None:
        found = finite(value)
        return None if found is None or not low <= found <= high or (above and found == low) else found

    limits = f"above {low:g}" if above else f"from {low:g}" + (f" to {high:g}" if high < math.inf else "")
    return table.take(key, read, f"a number {limits}", *default)


def _whole(table: TomlTable, key: str, default: int, *, low: int, high: int, unit: str = " number of samples") -> int:
    def read(value: object) -> int | None:
        found = finite(value)
        return int(found) if found is not None and found == int(found) and low <= found <= high else None

    return table.take(key, read, f"an integer{unit} from {low} to {high}", default)


def _flag(table: TomlTable, key: str, default: bool) -> bool:
    return table.take(key, flag, "true or false", default)


def _list(value: object, fits: Callable[[float], bool]) -> tuple[float, ...] | None:
    """Return a list of numbers, or None if it is empty or has another element."""
    found = [finite(each) for each in value] if isinstance(value, list) else []
    good = [each for each in found if each is not None and fits(each)]
    return tuple(sorted(set(good))) if found and len(good) == len(found) else None


def _names(table: TomlTable, key: str, default: tuple[str, ...] | str) -> tuple[str, ...] | str:
    if table.content.get(key) == ALL:
        return ALL
    if key not in table.content:
        return default
    return table.take(key, lambda value: tuple(dict.fromkeys(texts(value) or ())) or None, '"all" or a list of names')
