"""The file of settings that a study of a bare data file writes for the next step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from friction_fmus.axis.servo import GAIN_UNITS, GAINS, Servo
from friction_fmus.blocks.axis_units import SLIDING
from friction_fmus.export.targets import write_file
from friction_fmus.identification import Measurement
from friction_fmus.identification.data.column_headings import columns_text, quoted
from friction_fmus.identification.data.formats import read_table
from friction_fmus.identification.data.mapping import MISSING, Column
from friction_fmus.identification.data.reading import default_windows
from friction_fmus.identification.data.tables import DataTable
from friction_fmus.study.config import BEST_KNOWN_MODELS, OPTIONAL_GAINS, StudyConfig
from friction_fmus.study.data import Data
from friction_fmus.study.study_result import WrittenFile
from harness.storage.files import relative

SETTINGS_FILE: Final = "study.toml"


@dataclass(frozen=True)
class Known:
    """What is known of an axis when its file of settings is written."""

    columns: Mapping[str, Column]
    suggestions: Mapping[str, Column] = field(default_factory=dict)
    """Columns by role, and those of which an entry is missing."""
    servo: Mapping[str, str] = field(default_factory=dict)  # entries of ``[servo]`` as TOML; empty if it is unknown
    measurement: Measurement | None = None  # the record; None if entries of its columns are missing


def write_settings(folder: Path, table: DataTable, known: Known) -> Path:
    """Write the settings of a study, complete as far as they are known, with comments on the rest."""
    path = folder / SETTINGS_FILE
    more = [] if known.measurement is None else [relative(file, folder) for file in known.measurement.mapping.more]
    write_file(settings_text(table, known, relative(table.file, folder), more), path)
    return path


def settings_of(config: StudyConfig, data: Data, out: Path) -> tuple[WrittenFile, ...]:
    """Write the settings of a study that was started with a data file; an existing file is kept."""
    if not config.bare or data.measurement is None or data.measurement.mapping.file is None or data.measurement.static:
        return ()
    if not (out / SETTINGS_FILE).exists():
        known = Known(data.measurement.mapping.columns, servo=_entries(config.servo), measurement=data.measurement)
        write_settings(out, read_table(data.measurement.mapping.file), known)
    return (WrittenFile(SETTINGS_FILE, "Settings of the study, to add the controller of the axis"),)


def settings_text(table: DataTable, known: Known, file: str, more: Sequence[str] = ()) -> str:
    """Return the settings of a study as TOML; see `write_settings`."""
    name = table.file.name.partition(".")[0]
    files = f"[{', '.join(map(quoted, [file, *more]))}]"
    return "\n".join(
        [
            "# Settings of a study, for the commands",
            f"#   friction-fmus study {SETTINGS_FILE} -o out       models, and compensators if there is [servo]",
            f"#   friction-fmus identify {SETTINGS_FILE} -o out    models with figures and FMUs",
            "",
            "[data]",
            f"file = {files if more else quoted(file)}",
            f"name = {quoted(name)}",
            "",
            columns_text(table, known.columns, known.suggestions),
            "",
            *_windows(known.measurement),
            "",
            "[identify]",
            f'models = [{", ".join(map(quoted, BEST_KNOWN_MODELS))}]  # or "all"',
            "",
            *_servo(known),
            "",
            "# [compensation]",
            '# compensators = ["StaticFeedforward", "DisturbanceObserver"]  # or "all"; default: the best known',
            "",
        ]
    )


def _entries(servo: Servo | None) -> dict[str, str]:
    """Return the entries of ``[servo]`` for a servo; empty without one."""
    if servo is None:
        return {}
    given = {"law": f'"{servo.law}"', **{name: f"{value:.6g}" for name, value in servo.gains.items()}}
    given |= {"Ts": f"{servo.Ts:.6g}", "force_limit": f"{servo.force_limit:.6g}", "window": f"{servo.window}"}
    given |= {"quantum": f"{servo.quantum:.6g}"}
    return given | servo.features


def _windows(measurement: Measurement | None) -> list[str]:
    """Return the windows; they are written so that they can be changed, and are the default."""
    if measurement is None:
        return ["# [windows]  # fitted data and validation data, in s; default: the first 60 %, and the rest"]
    windows = {**default_windows(measurement.records), **measurement.mapping.windows}
    pairs = [f"{name} = [{begin:.9g}, {end:.9g}]" for name, (begin, end) in windows.items()]
    return ["[windows]  # fitted data and validation data [s]", *pairs]


def _servo(known: Known) -> list[str]:
    record = known.measurement.records[0] if known.measurement is not None else None
    u = record.units.words if record is not None else SLIDING
    law = known.servo.get("law", '"CascadePPI"').strip('"')
    units = {name: u.fill(GAIN_UNITS[name]) for name in GAINS[law]}
    blank = f'"{MISSING}"'
    default = {name: f"{value}" for name, (value,) in OPTIONAL_GAINS.items()}
    entries = {name: (known.servo.get(name, default.get(name, blank)), unit) for name, unit in units.items()}
    entries |= {
        "Ts": (known.servo.get("Ts", f"{record.Ts:.6g}" if record else blank), "s, sample time of the controller"),
        "force_limit": (known.servo.get("force_limit", blank), f"{u.N}, largest {u.force}"),
        "window": (known.servo.get("window", "2"), "samples over which the velocity is computed"),
        "quantum": (
            known.servo.get("quantum", f"{record.quantum:.6g}" if record else "0.0"),
            f"{u.m}, step of the encoder; 0: exact",
        ),
    }
    if record is not None and record.force is None:
        entries["mass"] = (known.servo.get("mass", blank), f"{u.kg}, because the record has no drive {u.force}")
    known_others = [name for name in known.servo if name not in (*entries, "law")]
    entries |= {name: (known.servo[name], "estimated from the record") for name in known_others}
    lines = ["[servo]", f'law = "{law}"  # "CascadePPI" with kp, kv, ki, or "PID" with Kp, Kd, Ki']
    lines += [f"{name} = {value}  # {unit}" for name, (value, unit) in entries.items()]
    lines.append('# Units of the drive: kv = "95 mA/rpm" with torque_constant = "0.8 N.m/A", pitch = "20 mm" if linear')
    if known.servo:
        return lines
    return [
        f"# To compare compensators, describe the controller of the axis: remove the # and replace each {MISSING}.",
        "# Guesses of the gains are enough: the study estimates them from the record, and says what to correct.",
        *(f"# {line}" for line in lines),
    ]
