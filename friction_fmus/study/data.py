"""Data of a study: a record of the package, a file, or a simulated record."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi
from pathlib import Path
from typing import Final

import numpy as np

from friction_fmus.axis.servo import AxisPlant, CurrentLoop, Servo, Trajectory, filtered
from friction_fmus.axis.servo_loop import closed_loop, run_loop
from friction_fmus.blocks.axis_units import domain_of
from friction_fmus.data import EMPS_PUBLISHED, load_emps, load_tribometer
from friction_fmus.export.block_fmu import build_record
from friction_fmus.identification import Array, Measurement, Record, read_measurement
from friction_fmus.identification.data.mapping import read_mapping
from friction_fmus.identification.data.reading import default_windows
from friction_fmus.identification.fit.idim import filtered_motion
from friction_fmus.identification.model_comparison import long_enough
from friction_fmus.study.config import ConfigError, StudyConfig
from friction_fmus.study.model_ranking import Measured

LUGRE: Final[Mapping[str, float]] = {
    **{"sigma0": 1e5, "sigma1": 1e5**0.5, "sigma2": 0.4},
    **{"Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "delta": 2.0},
}
"""Friction parameters of the demo: Canudas de Wit, Olsson, Astrom, Lischinsky 1995."""

RESTS: Final = 1e-9  # initial velocity over the largest one that is a rounding error of the filter
PERIOD: Final = 2.0  # period of the reference of the demo [s]


@dataclass(frozen=True, eq=False)
class Data:
    """Measured data of a study."""

    records: tuple[Record, ...]  # segments between gaps
    train: tuple[Record, ...]
    validation: tuple[Record, ...]
    """Data for the fit and for validation."""
    published: Mapping[str, Mapping[str, float]]  # known parameter values, by name of the model
    findings: tuple[str, ...] = ()  # problems found in the data
    measurement: Measurement | None = None  # the data file; None for a record of the package

    @property
    def longest(self) -> Record:
        """Longest segment."""
        return max(self.records, key=len)

    def with_total_force(self, included: bool) -> Data:
        """Return the data with drive forces that contain the injected force."""

        def total(records: tuple[Record, ...]) -> tuple[Record, ...]:
            return tuple(replace(r, injected=None) if included else r.with_total_force() for r in records)

        return replace(self, records=total(self.records), train=total(self.train), validation=total(self.validation))

    @property
    def rotary(self) -> bool:
        """Whether the position is an angle."""
        return self.longest.units.rotary


def load_data(config: StudyConfig, scratch: Path) -> Data:
    """Read or simulate the records of a study."""
    published: Mapping[str, Mapping[str, float]] = {}
    findings: tuple[str, ...] = ()
    windows = dict(config.data.get("windows", {}))
    measurement = None
    if config.record == "emps":
        records: tuple[Record, ...] = (load_emps(),)
        published = {"inverse": dict(EMPS_PUBLISHED)}
    elif config.record == "demo":
        assert config.servo is not None
        records, published = (demo(config.servo, scratch),), {"LuGre": {**LUGRE, "M": 1.0, "OF": 0.0}}
    elif config.record == "tribometer":
        records = (load_tribometer(),)
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            measurement = config.measurement
            if measurement is None:
                measurement = read_measurement(read_mapping(config.data, config.folder, config.name))
        records, findings = measurement.records, tuple(str(finding) for finding in measurement.findings)
        windows = dict(measurement.mapping.windows)
        if any(record.load is not None for record in records):
            raise ConfigError("A study does not use the column load; declare it as injected.")
    return Data(records, *_windows(records, windows, config.name), published, findings, measurement)


def demo(servo: Servo, scratch: Path) -> Record:
    """Simulate a record: 1 kg with LuGre friction under the servo, a sum of two sines, measured by its encoder."""
    t = servo.Ts * np.arange(float(round(2.5 * PERIOD / servo.Ts)))
    w = 2.0 * pi / PERIOD
    r = 4e-3 * (1.0 - np.cos(w * t)) + 0.5e-3 * (1.0 - np.cos(5.0 * w * t))
    reference = build_reference(t, r, scratch, "DemoReference")
    trajectory = Trajectory(reference, len(t), 0.0, 0.0)
    with closed_loop(servo, AxisPlant("LuGre", LUGRE, 1.0), trajectory) as system:
        trace = run_loop(system)
    q = servo.quantum * np.round(trace.q / servo.quantum) if servo.quantum else trace.q
    # the force of a sample acts from the sampling instant on
    return Record("demo", t, q=q, reference=r, force=trace.force, citation="", quantum=servo.quantum)


def build_reference(t: Array, r: Array, folder: Path, name: str, rotary: bool = False) -> Path:
    """Return an FMU that outputs a reference and its derivatives, computed by central differences."""
    # A run ends one sample after the last of the record: for this sample the reference keeps its last velocity.
    Ts = float(t[-1] - t[0]) / (len(t) - 1)  # with the times themselves, rounding would leave a velocity at rest
    t, r = np.append(t, 2.0 * t[-1] - t[-2]), np.append(r, 2.0 * r[-1] - r[-2])
    rd = np.gradient(r, Ts)
    return build_record(t, r, rd, np.gradient(rd, Ts), folder, name=name, domain=domain_of(rotary))


def check_fits(config: StudyConfig, record: Record) -> None:
    """Raise ConfigError if kind of axis or sample time of the servo are not those of the record."""
    servo = config.servo
    if config.rotary is not None and config.rotary != record.units.rotary:
        own, other = ("rotary", "linear") if config.rotary else ("linear", "rotary")
        raise ConfigError(
            f"[servo] has units of a {own} axis, but the position of the record {record.name!r} is that of a {other} "
            f"one, in {record.units.position}; "
            + ('add pitch = "10 mm", the way per turn of the motor.' if config.rotary else "give them for an angle.")
        )
    if servo is None or record.q is None or record.reference is None:
        return
    if abs(record.Ts / servo.Ts - 1.0) > 1e-3:
        raise ConfigError(
            f"[servo] has Ts = {servo.Ts:g} s, but the record {record.name!r} was sampled every {record.Ts:g} s; log "
            "every sample of the servo, or correct Ts."
        )


def measured_servo(data: Data, servo: Servo, folder: Path, name: str, injected: Array | None = None) -> Measured | None:
    """Return the measured servo; None if the record has no position or no reference."""
    record = data.longest
    if record.q is None or record.reference is None:
        return None
    t = servo.Ts * np.arange(float(len(record)))
    reference = build_reference(t, record.reference, folder, f"{name}Reference", data.rotary)
    # the axis may be in motion at the start of the record
    v = filtered_motion(record).v
    v0 = float(v[0]) if abs(v[0]) > RESTS * np.max(np.abs(v)) else 0.0
    trajectory = Trajectory(reference, len(record), float(record.q[0]), v0, rotary=data.rotary, injected=injected)
    force = record.force
    if force is not None and servo.lag and servo.logged_force != "actual":  # the simulated one is behind the lag
        force = filtered(CurrentLoop(servo.lag, servo.Ts), force, servo.Ts)

    def samples(records: tuple[Record, ...]) -> tuple[int, int]:
        if not records:
            return 0, len(record)
        ends = (records[0].t[0] - record.t[0], records[-1].t[-1] - record.t[0])
        first, last = (round(float(end) / servo.Ts) for end in ends)
        return max(0, first), min(len(record), last + 1)

    return Measured(
        servo,
        trajectory,
        record.q,
        force,
        record.reference,
        samples(data.train),
        samples(data.validation or data.train),
    )


def _windows(
    records: tuple[Record, ...], windows: Mapping[str, tuple[float, float]], origin: str
) -> tuple[tuple[Record, ...], tuple[Record, ...]]:
    """Return the data for the fit and for validation."""
    begin, end = records[0].t[0], records[-1].t[-1]
    windows = windows or default_windows(records)

    def cut(name: str) -> tuple[Record, ...]:
        if name not in windows:
            return ()
        low, high = windows[name]
        least = min(50, max(map(len, records)))
        inside = [r for r in records if np.count_nonzero((r.t >= low) & (r.t <= high)) >= least]
        if not inside:
            raise ConfigError(
                f"{origin}, [windows], has {name} = [{low:g}, {high:g}], but the record extends from {begin:g} to "
                f"{end:g} s; choose a window of at least 50 samples inside it."
            )
        return long_enough([replace(r.window(low, high), name=r.name) for r in inside])

    train = cut("train")
    if not train:
        raise ConfigError(f"{origin}, [windows], has no train; add train = [start, end].")
    return train, cut("validation")
