"""Random log files of an axis that is known: how many are read right, asked about, refused, or read wrongly.

``python tests/slow/log_variants.py 300`` prints the counts; ``--keep DIR`` writes the files, and ``--first N`` starts
with that seed. A wrong one ends the script with status 1. The test of the fast suite runs a few of them.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from friction_fmus.errors import FrictionError
from friction_fmus.identification import Measurement, read_measurement
from friction_fmus.identification.fit.first_look import first_look

INERTIA, COULOMB, VISCOUS, OFFSET = 0.012, 0.8, 0.05, 0.04

#: Styles of headings: names of time, position, reference, velocity, drive; empty for none.
STYLES: dict[str, tuple[str, str, str, str, str] | None] = {
    "english": (
        "Time",
        "Position actual value",
        "Position demand value",
        "Velocity actual value",
        "{drive} actual value",
    ),
    "short": ("t", "pos", "pos_ref", "vel", "{short}"),
    "symbols": ("t", "q", "q_ref", "dq", "{symbol}"),
    "german": ("Zeit", "Istposition", "Sollposition", "Istdrehzahl", "{german}"),
    "japanese": ("Time", "Feedback position", "Command position", "Feedback speed", "{drive} feedback"),
    "chinese": ("Sampling time", "Motor feedback position", "Position reference", "Motor speed", "{drive} feedback"),
    "path": ("Timestamp", "Axis1.ActPos", "Axis1.SetPos", "Axis1.ActVelo", "Axis1.Act{drive}"),
    "none": None,
}
DRIVES = {
    "N.m": ("Torque", "trq", "tau", "Istmoment", 1.0),
    "Nm": ("Torque", "torque", "tau", "Drehmoment", 1.0),
    "A": ("Current", "cur", "iq", "Iststrom", 2.0),
    "mA": ("Current", "current", "i", "Motorstrom", 2e3),
    "%": ("Torque", "torque", "tau", "Istmoment", 100.0 / 6.0),
}
POSITIONS = {"rad": 1.0, "deg": 180.0 / np.pi, "°": 180.0 / np.pi, "rev": 0.5 / np.pi, "inc": 8192 * 0.5 / np.pi}
VELOCITIES = {"rad/s": 1.0, "rpm": 30.0 / np.pi, "deg/s": 180.0 / np.pi, "1/min": 30.0 / np.pi}
TIMES = {"s": 1.0, "ms": 1e3, "us": 1e6}


@dataclass
class Axis:
    """Simulated motion of an axis under a servo."""

    t: np.ndarray
    q: np.ndarray
    reference: np.ndarray
    v: np.ndarray
    torque: np.ndarray


def simulated(rng: np.random.Generator, seconds: float, step: float) -> Axis:
    """Return an axis with Coulomb and viscous friction that follows a sum of sines; it sticks where it must."""
    count, inner = round(seconds / step), max(1, round(step / 2.5e-4))
    h = step / inner
    w = 2.0 * np.pi * rng.uniform(0.25, 2.0, 3)
    size, phase = rng.uniform(0.3, 1.2, 3), rng.uniform(0.0, 6.0, 3)

    def reference(t: float) -> float:
        return float(size @ (np.sin(w * t + phase) - np.sin(phase)))

    q = v = 0.0
    kv = INERTIA * 2.0 * np.pi * 25.0
    rows = []
    for k in range(count):
        r = reference(k * step)
        rd = (reference(k * step + 1e-5) - r) / 1e-5
        u = kv * (15.0 * (r - q) + rd - v)
        rows.append((k * step, q, r, v, u))
        for _ in range(inner):
            drive = u - OFFSET
            if v == 0.0 and abs(drive) <= COULOMB:
                continue
            direction = np.sign(v) if v else np.sign(drive)
            after = v + h * (drive - COULOMB * direction - VISCOUS * v) / INERTIA
            v = 0.0 if v and after * v < 0.0 else after
            q += h * v
    return Axis(*np.array(rows).T)


@dataclass
class Variant:
    """A file with what is right about it."""

    path: Path
    coulomb: float  # in the unit of the channel
    viscous: float  # in the unit of the channel over rad/s
    motion: tuple[str, ...]  # names of position and velocity
    force: str  # name of the drive signal
    what: dict[str, object] = field(default_factory=dict)


def written(seed: int, folder: Path) -> Variant:
    """Write a random file."""
    rng = np.random.default_rng(seed)

    def one(*choices: object) -> object:
        return choices[int(rng.integers(len(choices)))]

    step = float(one(1e-3, 2e-3, 4e-3, 5e-3))
    axis = simulated(rng, float(rng.uniform(5.0, 9.0)), step)
    other = simulated(rng, len(axis.t) * step + 0.1, step)
    style = str(one(*STYLES))
    names = STYLES[style]
    where, speed, force, clock = (str(one(*known)) for known in (POSITIONS, VELOCITIES, DRIVES, TIMES))
    titled = style != "none"
    units = titled and rng.random() < 0.7
    drive, short, symbol, german, scale = DRIVES[force]
    words = {"drive": drive, "short": short, "symbol": symbol, "german": german}
    noise = 10.0 ** rng.uniform(-3.0, -1.7)
    torque = scale * (axis.torque + noise * rng.standard_normal(len(axis.t)))
    quantum = 2.0 * np.pi / 2 ** int(rng.integers(13, 21))
    q = np.round(axis.q / quantum) * quantum * POSITIONS[where]
    r = axis.reference * POSITIONS[where]
    v = (np.round(axis.v / 1e-3) * 1e-3) * VELOCITIES[speed]
    t = axis.t * TIMES[clock]
    if rng.random() < 0.2:
        t = t + 1203.0 * TIMES[clock]
    columns = [("time", t, clock), ("position", q, where), ("force", torque, force)]
    columns += [("reference", r, where)] if rng.random() < 0.6 else []
    columns += [("velocity", v, speed)] if rng.random() < 0.6 else []
    unrelated = {
        "Motor temperature": (40.0 + 0.1 * axis.t + 0.02 * rng.standard_normal(len(axis.t)), "degC"),
        "Sample counter": (np.arange(float(len(axis.t))), ""),
        "DC bus voltage": (325.0 + rng.standard_normal(len(axis.t)), "V"),
        "Status word": (np.full(len(axis.t), 39.0), ""),
        "Vibration": (rng.standard_normal(len(axis.t)), ""),
    }
    count = int(rng.integers(0, 4))
    extra = [(name, *unrelated[name]) for name in rng.permutation([*unrelated])[:count]]
    second = rng.random() < 0.25
    if second:
        n = len(axis.t)
        extra += [
            ("Axis 2 position", 0.4 * other.q[:n] * POSITIONS[where], where),
            ("Axis 2 torque", scale * (other.torque[:n] + noise * rng.standard_normal(n)), force),
        ]
    every = [*columns, *extra]
    if rng.random() < 0.6:
        every = [every[0], *(every[1 + int(i)] for i in rng.permutation(len(every) - 1))]
    roles = dict(zip(("time", "position", "reference", "velocity", "force"), names or [""] * 5, strict=True))
    headings = [roles.get(role, role).format(**words) for role, _, _ in every]
    keep = np.ones(len(t), dtype=bool)
    if rng.random() < 0.2:
        begin = int(rng.integers(len(t) // 3, len(t) // 2))
        keep[begin : begin + int(rng.integers(20, 200))] = False
    delimiter = str(one(",", ";", "\t"))
    comma = delimiter == ";" and rng.random() < 0.5
    digits = {"us": 0, "ms": 3, "s": 6}
    lines = []
    if titled and rng.random() < 0.4:
        lines += [f"Recorder{delimiter}model {seed}", f"Date{delimiter}2026-03-02", ""][: int(rng.integers(1, 4))]
    if titled and units and rng.random() < 0.4:
        lines += [delimiter.join(headings), delimiter.join(unit for _, _, unit in every)]
    elif titled:
        lines += [
            delimiter.join(f"{h} [{u}]" if units and u else h for h, (_, _, u) in zip(headings, every, strict=True))
        ]
    formats = [f"%.{digits[clock]}f" if role == "time" else "%.7g" for role, _, _ in every]
    for row in np.column_stack([values for _, values, _ in every])[keep]:
        line = delimiter.join(form % value for form, value in zip(formats, row, strict=True))
        lines.append(line.replace(".", ",") if comma else line)
    encoding = str(one("utf-8", "utf-8-sig", "iso-8859-1", "utf-16"))
    path = folder / f"variant_{seed}.{one('csv', 'txt')}"
    path.write_text("\n".join(lines) + "\n", encoding=encoding)
    shown = headings if titled else [f"column {i}" for i in range(1, len(every) + 1)]
    names_of = dict(zip((role for role, _, _ in every), shown, strict=True))
    motion = tuple(names_of[role] for role in ("position", "velocity") if role in names_of)
    what = {"style": style, "units": units, "time": clock, "position": where, "force": force, "second": second}
    return Variant(path, COULOMB * scale, VISCOUS * scale, motion, names_of["force"], what)


def judged(variant: Variant) -> tuple[str, str]:
    """Return ``right``, ``asked``, ``refused`` or ``wrong``, and why."""
    try:
        measurement = read_measurement(variant.path)
    except FrictionError as error:
        choices = getattr(error, "choices", ())
        return ("asked" if choices else "refused"), " ".join(str(error).split())[:160]
    return ("right", "") if not (why := wrong(variant, measurement)) else ("wrong", why)


def wrong(variant: Variant, measurement: Measurement) -> str:
    """Return what is wrong with a measurement; empty if nothing is."""
    text = " | ".join(text for _, text in measurement.understood)
    used = {role: column.column for role, column in measurement.mapping.columns.items()}
    second = used.get("position") == "Axis 2 position" and used["force"] == "Axis 2 torque"
    if second and f"other axes, not used: {variant.motion[0]!r}" in text:
        return ""
    for role, right in (("position", variant.motion), ("velocity", variant.motion), ("force", (variant.force,))):
        if role in used and used[role] not in right:
            return f"{used[role]!r} is not the {role}: {text}"
    looked = first_look(measurement.records)
    if not looked:
        return f"no result: {text}"
    record = measurement.records[0]
    units = record.units
    found = looked["Fc"].value
    if abs(found / variant.coulomb - 1.0) > 0.1:
        return f"Coulomb {found:.4g} {units.force} instead of {variant.coulomb:.4g}: {text}"
    if units.position == "rad" and abs(looked["Fv"].value / variant.viscous - 1.0) > 0.35:
        return f"viscous {looked['Fv'].value:.4g} instead of {variant.viscous:.4g}: {text}"
    seconds = measurement.records[-1].t[-1] - record.t[0]
    if not 4.0 < seconds < 10.0:
        return f"time {seconds:.4g} s: {text}"
    return ""


def main() -> int:
    """Write and read the variants, and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int, nargs="?", default=300)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.keep or Path(scratch)
        folder.mkdir(exist_ok=True)
        for seed in range(options.first, options.first + options.count):
            variant = written(seed, folder)
            outcome, why = judged(variant)
            counts[outcome] += 1
            if outcome != "right":
                print(f"{seed} {outcome}: {why} {json.dumps(variant.what)}", flush=True)
    print(", ".join(f"{name} {counts[name]}" for name in ("right", "asked", "refused", "wrong")))
    return 1 if counts["wrong"] else 0


if __name__ == "__main__":
    sys.exit(main())
