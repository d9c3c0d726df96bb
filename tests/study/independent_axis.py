"""A simulated axis with servo and encoder, in C: the truth of a study, independent of the FMUs and laws of the project.

The equations are in `independent_axis.c`.
"""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from friction_fmus.codegen.law_export import make_export
from friction_fmus.codegen.sources import header, implementation, table_header, table_source

SOURCE = Path(__file__).with_name("independent_axis.c")
STEP = 1e-5  # longest step of the integration [s]
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC")

DEFAULTS: Mapping[str, float] = {
    **{"kind1": 1.0, "back1": 1.0, "kind2": 1.0, "back2": 1.0, "pitch": 1.0, "tau": 1.0},
    **{"Ts": 1e-3, "window": 2.0, "limit": 1e9},
}
"""Values that are not 0 unless given."""


def compiled(sources: Sequence[Path], folder: Path, name: str) -> ctypes.CDLL:
    """Compile C files and load them."""
    compiler = shutil.which("cc") or "gcc"
    library = folder / f"{name}.so"
    subprocess.run([compiler, *FLAGS, "-o", library, *sources, "-lm"], check=True)
    return ctypes.CDLL(str(library))


def _members(struct: str) -> list[str]:
    body = re.search(rf"^struct {struct} \{{(.*?)^\}};", SOURCE.read_text(), re.DOTALL | re.MULTILINE)
    assert body is not None
    text = re.sub(r"/\*.*?\*/", "", body[1])
    return re.findall(r"\w+", text.replace("double", ""))


class AxisStruct(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_double) for name in _members("axis"))


class ServoStruct(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_double) for name in _members("servo"))


Pointer = ctypes.POINTER(ctypes.c_double)
SIGNALS = ("x1", "x2", "measured", "command", "force")


class LogStruct(ctypes.Structure):
    _fields_ = tuple(
        [(name, Pointer) for name in SIGNALS] + [(name, ctypes.c_double) for name in ("work", "heat", "energy")]
    )


@cache
def _library() -> ctypes.CDLL:
    folder = Path(tempfile.mkdtemp())
    try:
        library = compiled([SOURCE], folder, "independent_axis")
    finally:
        shutil.rmtree(folder, ignore_errors=True)  # a loaded library needs no file
    library.simulate.restype = ctypes.c_int
    return library


@dataclass(frozen=True, eq=False)
class Reference:
    """Position, velocity and acceleration of a reference at the samples."""

    r: np.ndarray
    rd: np.ndarray
    rdd: np.ndarray


@dataclass(frozen=True, eq=False)
class Run:
    """Signals at the samples: positions, measured position, command, and force after delay and current loop."""

    x1: np.ndarray
    x2: np.ndarray
    measured: np.ndarray
    command: np.ndarray
    force: np.ndarray
    work: float
    heat: float
    energy: float
    """Work of the drive, losses, and change of the energy of masses, spring and weight [J]."""
    finite: bool


def simulate(
    axis: Mapping[str, float],
    servo: Mapping[str, float],
    reference: Reference,
    *,
    noise: np.ndarray | None = None,
    load: np.ndarray | None = None,
    extra: np.ndarray | None = None,
    law: Law | None = None,
    step: float = STEP,
) -> Run:
    """Simulate an axis: values of the C structs, others 0 or `DEFAULTS`; arrays of shape (samples,)."""
    plant, drive = (_filled(kind, values) for kind, values in ((AxisStruct, axis), (ServoStruct, servo)))
    arrays = [reference.r, reference.rd, reference.rdd, noise, load, extra]
    inputs = [None if each is None else np.ascontiguousarray(each, dtype=np.float64) for each in arrays]
    n = len(reference.r)
    assert all(each is None or each.shape == (n,) for each in inputs)
    signals = {name: np.zeros(n) for name in SIGNALS}
    log = LogStruct(**{name: values.ctypes.data_as(Pointer) for name, values in signals.items()})
    inner = max(1, round(drive.Ts / step))
    if law is not None:
        law.start()
    failed = _library().simulate(
        ctypes.byref(plant),
        ctypes.byref(drive),
        ctypes.c_long(n),
        ctypes.c_long(inner),
        *(None if each is None else each.ctypes.data_as(Pointer) for each in inputs),
        None if law is None else law.function,
        ctypes.byref(log),
    )
    return Run(**signals, work=log.work, heat=log.heat, energy=log.energy, finite=not failed)


def _filled(kind: type[ctypes.Structure], values: Mapping[str, float]) -> ctypes.Structure:
    known = {name for name, *_ in kind._fields_}
    assert not values.keys() - known, values.keys() - known
    return kind(**({name: value for name, value in DEFAULTS.items() if name in known} | dict(values)))


@dataclass(frozen=True, eq=False)
class Law:
    """The exported C of a study, called once per sample with reference and measured position."""

    start: Callable[[], None]
    function: ctypes.c_void_p
    header: str


def exported_law(folder: Path, scratch: Path) -> Law:
    """Compile ``recommended/c`` as its README states: assign the inputs, ``loop_table`` to ``f_known``, step."""
    declared = (folder / "loop.h").read_text(encoding="utf-8")
    body = re.search(r"typedef struct \{([^}]*)\} loop_inputs;", declared)
    assert body is not None
    members = set(re.findall(r"\bdouble (\w+);", body[1]))
    tables = [folder / "loop_table.c"] if (folder / "loop_table.c").exists() else []
    table = "    inputs.f_known = loop_table(r, rd);\n" if tables else ""
    known = f'#include "{(folder / "loop_table.h").resolve()}"\n' if tables else ""
    assigned = "".join(f"    inputs.{name} = {name};\n" for name in ("r", "rd", "rdd", "x") if name in members)
    shim = scratch / "shim.c"
    shim.write_text(
        f'#include "{(folder / "loop.h").resolve()}"\n{known}'
        "static loop_parameters parameters;\nstatic loop_states states;\n"
        "static loop_inputs inputs;\nstatic loop_outputs outputs;\n"
        "int start(void)\n{\n    loop_init(&parameters, &states, &inputs, &outputs);\n"
        "    return (int)loop_check(&parameters);\n}\n"
        "double law(double r, double rd, double rdd, double x)\n{\n"
        f"    (void)rd;\n    (void)rdd;\n{assigned}{table}"
        "    loop_step(&parameters, &states, &inputs, &outputs);\n    return outputs.u;\n}\n",
        encoding="utf-8",
    )
    library = compiled([shim, folder / "loop.c", *tables], scratch, f"law_{abs(hash(folder))}")

    def start() -> None:
        assert library.start() == 0

    return Law(start, ctypes.cast(library.law, ctypes.c_void_p), declared)


def law_of_loop(content: Mapping[str, Any], scratch: Path) -> Law:
    """Return the C that `codegen` writes for the tables of a ``loop.toml``, without its tests and costs."""
    file = scratch / "loop.toml"
    file.write_text(tomli_w.dumps(content), encoding="utf-8")
    export = make_export(file)
    texts = {"loop.h": header(export), "loop.c": implementation(export)}
    if export.table is not None:
        texts |= {"loop_table.h": table_header(export), "loop_table.c": table_source(export, export.table)}
    for name, text in texts.items():
        (scratch / name).write_text(text, encoding="utf-8")
    return exported_law(scratch, scratch)


# ---------------------------------------------------------------------------------------------------- references


def resting(n: int, place: float = 0.0) -> Reference:
    """Return a constant reference."""
    return Reference(np.full(n, place), np.zeros(n), np.zeros(n))


def trapezoid(t: np.ndarray, distance: float, speed: float, acceleration: float) -> Reference:
    """Return a move from 0 at t = 0 with a trapezoidal velocity; it rests before and after."""
    far, way = abs(distance), np.sign(distance)
    speed = min(speed, np.sqrt(far * acceleration))
    ramp, total = speed / acceleration, far / speed + speed / acceleration
    t = np.clip(t, 0.0, total)
    up, down = np.minimum(t, ramp), np.maximum(t - (total - ramp), 0.0)
    v = np.where(t < total, acceleration * (up - down), 0.0)  # exactly 0 at rest, for the sign of a feedforward
    x = acceleration * up * (t - up / 2.0) - acceleration * down**2 / 2.0
    a = np.where((t > 0.0) & (t < ramp), acceleration, np.where((t > total - ramp) & (t < total), -acceleration, 0.0))
    return Reference(way * x, way * v, way * a)


def typical_moves(duration: float, Ts: float, stroke: float, speed: float, acceleration: float) -> Reference:
    """Return moves as of a machine, repeated: fast, slow, short with reversals, and a sum of sines.

    A period takes 8 s; each move begins and ends at rest at a multiple of the sample time.
    """
    t = Ts * np.arange(float(round(duration / Ts)))
    period, parts = 8.0, []
    moves = [  # begin, distance, speed, acceleration
        *((0.3, 1.0, 1.0, 1.0), (1.2, -0.6, 0.5, 0.6), (2.1, 0.15, 0.15, 0.4), (2.8, -0.15, 0.15, 0.4)),
        *((3.5, 0.04, 0.3, 0.7), (3.9, -0.04, 0.3, 0.7), (4.2, -0.4, 1.0, 1.0)),
    ]
    for repeat in range(int(np.ceil(duration / period))):
        at = t - repeat * period
        for begin, far, share, hard in moves:
            parts.append(trapezoid(at - begin, far * stroke, share * speed, hard * acceleration))
        begin, length = 5.0, 2.8
        inside = (at >= begin) & (at < begin + length)
        for times, share in ((1, 0.5), (3, 0.12), (8, 0.012)):
            w = 2.0 * np.pi * times / length
            size = min(share * stroke, 0.25 * speed / w, 0.3 * acceleration / w**2)
            s, c = np.sin(w * (at - begin)), np.cos(w * (at - begin))
            wave = (size * (1.0 - c), size * w * s, size * w**2 * c)
            parts.append(Reference(*(np.where(inside, each, 0.0) for each in wave)))
    return Reference(*(sum(getattr(part, name) for part in parts) for name in ("r", "rd", "rdd")))
