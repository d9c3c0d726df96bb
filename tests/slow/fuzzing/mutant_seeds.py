"""Valid files that mutants are made from, and tables with odd cells."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from random import Random

import h5py
import numpy as np
import pandas as pd
from robustness.mutate import zipped
from scipy.io import savemat

from friction_fmus import build, fmu
from friction_fmus.__main__ import main
from harness import System, save_result

SYSTEM = """\
name = "servo"
wires = [
    "pid.u -> mass.F_drive",
    "mass.x -> pid.x",
    { wire = "mass.v -> pid.v", gain = 1.0, offset = 0.0, delay = 1 },
    "reference.r -> pid.r",
    "mass.v -> friction.v",
    "friction.F -> mass.F_friction",
]

[experiment]
start = 0.0
stop = 0.05
step = 1e-3
master = "newton"
record = ["mass.*", "friction.F"]
decimate = 2
order = ["reference", "pid", "mass", "friction"]
extrapolation = 0
tolerance = 1e-6

[[experiment.manipulators]]
kind = "drop-out"
input = "friction.v"
probability = 0.2
seed = 1
start = 0.01
stop = 0.02

[[experiment.manipulators]]
kind = "noise"
input = "pid.x"
sigma = 1e-6
seed = 7

[parts.reference]
record = "reference.csv"
interpolation = "linear"
beyond = "hold"

[parts.pid]
model = "PID"
start = { Kp = 400.0, Kd = 40.0, Ki = 1.0, Ts = 1e-3, rd = 0.0, rdd = 0.0 }

[parts.mass]
model = "Mass"
every = 1
start = { m = 1.0, v_support = 0.1, F_load = 0.0 }

[parts.friction]
model = "LuGre"
start = { Fc = 1.0, sigma0 = 1e5 }
"""

ARRAYS = """\
name = "arrays"
wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]

[experiment]
stop = 0.05
step = 1e-3
master = "newton"

[parts.mass]
model = "Mass"
start = { F_drive = 0.0, F_load = 0.0, k = 2e3, v_support = 0.1 }

[parts.friction]
fmu = "part.fmu"
start = { N = 3, "k[2]" = 2e4 }
"""

KEYS = (
    *("name", "wires", "parts", "experiment", "start", "stop", "step", "master", "record", "decimate", "tolerance"),
    *("order", "extrapolation", "manipulators", "kind", "input", "value", "seed", "sigma", "probability", "samples"),
    *("model", "fmu", "every", "interpolation", "beyond", "gain", "offset", "delay", "wire"),
)
"""What a system file may have somewhere."""

REFERENCE = "time [s],r [m]\n0.0,0.0\n0.02,1e-3\n0.05,1e-3\n"

MAPPING = """\
[data]
file = "data{suffix}"
name = "axis"

[columns]
time = {{ column = "t", unit = "s" }}
position = {{ column = "x", unit = "mm" }}
force = {{ column = "u", unit = "V", gain = "35.15 N/V", sign = 1 }}

[windows]
train = [0.0, 1.2]
validation = [1.2, 2.0]
"""

STUDY = """
[servo]
law = "CascadePPI"
kp = 40.0
kv = 1500.0
Ts = 1e-3
force_limit = 350.0
window = 2
quantum = 1e-7
velocity_feedforward = false

[identify]
models = ["Coulomb"]

[compensation]
compensators = ["CoulombFeedforward"]
gains = [1.0]
mismatch = 0.1
motion_feedforward = true
duration = 0.2
"""

STUDY_KEYS = (
    *("file", "record", "name", "time", "position", "velocity", "reference", "force", "friction", "normal", "train"),
    *(
        "validation",
        "law",
        "kp",
        "kv",
        "ki",
        "Kp",
        "Kd",
        "Ki",
        "Ts",
        "force_limit",
        "window",
        "quantum",
        "mass",
        "models",
    ),
    *("velocity_feedforward", "compensators", "gains", "mismatch", "motion_feedforward", "duration", "unit", "column"),
)

PARAMETERS = (
    '<?xml version="1.0"?><ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"'
    ' version="1.0" name="p"><ssv:Parameters><ssv:Parameter name="friction.Fc"><ssv:Real value="1.5" unit="N"/>'
    "</ssv:Parameter></ssv:Parameters></ssv:ParameterSet>"
)

SAMPLES = "friction.Fc,mass.m\n1.0,2.0\n1.5,2.5\n"

LOGS = (".csv", ".parquet", ".mat")
OTHER_LOGS = (".json", ".npz", ".h5", ".lvm", ".zip", ".xlsx")
SUFFIXES = (*LOGS, ".nc")

SWEEP = ("--vary", "friction.Fc=1:1.4:6", "--executor", "serial")

CELLS = (*("", "nan", "inf", "-inf", "1e308", "-1e999", "0x10", "abc", "1,5", '"', "\u2603", "1e-320"), "9" * 400)


def motion(count: int = 2001) -> dict[str, np.ndarray]:
    """Sines of two frequencies with Coulomb friction, as the log of an axis: s, mm, V."""
    t = 1e-3 * np.arange(count)
    w1, w2 = 2.0 * np.pi * 1.0, 2.0 * np.pi * 3.7
    x = 0.02 * np.sin(w1 * t) + 0.004 * np.sin(w2 * t)
    v = 0.02 * w1 * np.cos(w1 * t) + 0.004 * w2 * np.cos(w2 * t)
    a = -0.02 * w1**2 * np.sin(w1 * t) - 0.004 * w2**2 * np.sin(w2 * t)
    noise = np.random.default_rng(1).normal(size=count)
    force = 40.0 * a + 20.0 * np.tanh(v / 1e-3) + 100.0 * v + 0.3 * noise
    return {"t": t, "x": 1e3 * x, "u": force / 35.15}


def write_seeds(folder: Path) -> None:
    """All valid files by the commands themselves, a folder for each group of kinds."""
    _system(folder / "toml")
    _system(folder / "checkpoint")
    _command(folder / "checkpoint", "run", "s.toml", "-o", "o.csv", "--stop", "0.02", "--checkpoint", "state")
    _system(folder / "sweep")
    _command(folder / "sweep", "sweep", "s.toml", *SWEEP, "-o", "out")
    _system(folder / "samples")
    (folder / "samples" / "p.csv").write_text(SAMPLES, encoding="utf-8")
    _system(folder / "parameters")
    (folder / "parameters" / "p.ssv").write_text(PARAMETERS, encoding="utf-8")
    _system(folder / "fmu", SYSTEM.replace('model = "LuGre"', 'fmu = "part.fmu"'))
    (folder / "fmu" / "part.fmu").write_bytes(fmu("LuGre").read_bytes())
    # a record and manipulators have no place in an archive
    blocks = SYSTEM.replace('    "reference.r -> pid.r",\n', "").replace("rd = 0.0", "r = 0.0, rd = 0.0").split("\n\n")
    blocks = [block.replace('["reference", ', "[") for block in blocks if not block.startswith(("[parts.ref", "[["))]
    _system(folder / "ssp", "\n\n".join(blocks))
    with System.from_toml(folder / "ssp" / "s.toml", fmu) as system:
        system.to_ssp(folder / "ssp" / "s.ssp")
    _write_arrays(folder)
    with System.from_toml(folder / "toml" / "s.toml", fmu) as system:
        result = system.run()
    for suffix in SUFFIXES:
        (folder / f"result{suffix}").mkdir()
        save_result(result, folder / f"result{suffix}" / f"result{suffix}")
    for suffix in LOGS:
        for name, text in (("identify", MAPPING), ("study", MAPPING + STUDY)):
            own = folder / f"{name}{suffix}"
            own.mkdir()
            (own / "map.toml").write_text(text.format(suffix=suffix), encoding="utf-8")
            _write_table(motion(), own / f"data{suffix}")
    for suffix in OTHER_LOGS:
        own = folder / f"identify{suffix}"
        own.mkdir()
        (own / "map.toml").write_text(MAPPING.format(suffix=suffix), encoding="utf-8")
        (own / f"data{suffix}").write_bytes(_other_table(motion(), suffix))


def _write_arrays(folder: Path) -> None:
    """An FMI 3.0 FMU whose arrays have another size: in an archive of SSP 2.0, and beside a system file."""
    place = folder / "fmu3"
    _system(place, ARRAYS)
    build("GMS", place, fmi=3).rename(place / "part.fmu")
    (folder / "ssp2").mkdir()
    with System.from_toml(place / "s.toml", fmu) as system:
        system.to_ssp(folder / "ssp2" / "s.ssp")


def _system(folder: Path, text: str = SYSTEM) -> None:
    folder.mkdir(parents=True)
    (folder / "s.toml").write_text(text, encoding="utf-8")
    (folder / "reference.csv").write_text(REFERENCE, encoding="utf-8")


def _command(folder: Path, *arguments: str) -> None:
    os.chdir(folder)
    assert main(list(arguments)) == 0
    Path("o.csv").unlink(missing_ok=True)


def _write_table(table: Mapping[str, object], path: Path) -> None:
    if path.suffix == ".csv":
        pd.DataFrame(table).to_csv(path, index=False)
    elif path.suffix == ".parquet":
        pd.DataFrame(table).to_parquet(path)
    else:
        savemat(path, dict(table))


def _other_table(table: Mapping[str, np.ndarray], suffix: str) -> bytes:
    """A data file of one of the `OTHER_LOGS`."""
    rows = [list(table), *(list(map(float, row)) for row in zip(*table.values(), strict=True))]
    lines = [";".join(map(str, row)) for row in rows]
    whole = io.BytesIO()
    if suffix == ".json":
        return json.dumps({"axis": {name: list(values) for name, values in table.items()}}).encode()
    if suffix == ".lvm":
        head = "LabVIEW Measurement\nX_Columns;One\n***End_of_Header***\nChannels;2\n***End_of_Header***"
        return "\n".join([head, *lines]).encode()
    if suffix == ".npz":
        np.savez_compressed(whole, **table)
    elif suffix == ".h5":
        with h5py.File(whole, "w") as file:
            for name, values in table.items():
                file.create_dataset(name, data=values, chunks=True, compression="gzip")
    elif suffix == ".zip":
        return zipped({"data.csv": "\n".join(lines).encode()})
    else:
        return zipped(_workbook(rows))
    return whole.getvalue()


def _workbook(rows: Sequence[Sequence[object]]) -> dict[str, bytes]:
    """The members of a workbook with one sheet."""
    base = "http://schemas.openxmlformats.org"
    main, office = f"{base}/spreadsheetml/2006/main", f"{base}/officeDocument/2006/relationships"
    links = f'<Relationships xmlns="{base}/package/2006/relationships"><Relationship Id="a" Type="{office}'
    cells = [
        [
            f'<c t="inlineStr"><is><t>{cell}</t></is></c>' if isinstance(cell, str) else f"<c><v>{cell}</v></c>"
            for cell in row
        ]
        for row in rows
    ]
    body = "".join(f"<row>{''.join(row)}</row>" for row in cells)
    sheets = '<sheets><sheet name="a" sheetId="1" r:id="a"/></sheets>'
    texts = {
        "_rels/.rels": f'{links}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{main}" xmlns:r="{office}">{sheets}</workbook>',
        "xl/_rels/workbook.xml.rels": f'{links}/worksheet" Target="worksheets/a.xml"/></Relationships>',
        "xl/worksheets/a.xml": f'<worksheet xmlns="{main}"><sheetData>{body}</sheetData></worksheet>',
    }
    return {name: text.encode() for name, text in texts.items()}


def odd_table(random: Random, columns: Mapping[str, np.ndarray], suffix: str) -> bytes:
    """A data file of that kind whose columns have the wrong shape, kind, order or values, or are not there."""
    table: dict[str, object] = dict(columns)
    for _ in range(random.choice((1, 1, 2))):
        table = _odd(random, random.choice(list(table)), table) if table else table
    whole = io.BytesIO()
    if suffix == ".mat":
        savemat(whole, {name or "x": _cells(np.asarray(values)) for name, values in table.items()})
        return whole.getvalue()
    rows = max((len(values) for values in table.values() if hasattr(values, "__len__")), default=0)
    flat = {name: list(np.ravel(np.asarray(values, dtype=object)))[:rows] for name, values in table.items()}
    if suffix == ".csv":
        text = io.StringIO()
        writer = csv.writer(text)
        writer.writerow(flat)
        writer.writerows(zip(*flat.values(), strict=False))
        return text.getvalue().encode()
    length = min(map(len, flat.values()), default=0)
    try:
        pd.DataFrame({name: values[:length] for name, values in flat.items()}).to_parquet(whole)
    except Exception:  # a column of which there is no Parquet file: as text
        pd.DataFrame({name: list(map(str, values[:length])) for name, values in flat.items()}).to_parquet(whole)
    return whole.getvalue()


def _cells(values: np.ndarray) -> np.ndarray:
    """Values as MATLAB can have them: nothing is an empty matrix."""
    if values.dtype != object:
        return values
    return np.array([np.zeros((0, 0)) if value is None else value for value in values] + [None], dtype=object)[:-1]


def _odd(random: Random, name: str, table: dict[str, object]) -> dict[str, object]:
    """One column of a table made odd, or the whole table."""
    values = np.asarray(table[name])
    k = random.randrange(len(values)) if values.size else 0
    ways = random.randrange(14)
    if ways == 0:
        return {other: value for other, value in table.items() if other != name}
    if ways == 1:
        return {("" if other == name else other): value for other, value in table.items()}
    if ways == 2:
        length = random.choice((0, 1, 2, 3, 10))
        return {other: np.asarray(value)[:length] for other, value in table.items()}
    if ways == 3:
        return table | {name: np.full(len(values), random.choice((0.0, np.nan, np.inf, 1e308, 1e-320)))}
    if ways == 4:
        return table | {name: values[::-1]}
    if ways == 5:
        return table | {name: values.astype(complex) * 1j if values.dtype.kind == "f" else values}
    if ways == 6:
        return table | {name: np.array(["a", "b"] * len(values))[: len(values)]}
    if ways == 7:
        return table | {name: (np.arange(len(values)) % 2).astype(bool)}
    if ways == 8:
        return table | {name: np.random.default_rng(random.randrange(99)).permutation(values)}
    if ways == 9:
        return table | {
            name: values * random.choice((1e300, 1e-300, -1.0, 1e20)) if values.dtype.kind == "f" else values
        }
    if ways == 10:
        return table | {f"{name}{i}": values for i in range(300)}
    changed = values.astype(object)
    if changed.size:
        changed[k] = (
            random.choice((np.nan, np.inf, None, "x", 1e308, -1e308, 0.0)) if ways < 13 else random.choice(CELLS)
        )
    return table | {name: changed}
