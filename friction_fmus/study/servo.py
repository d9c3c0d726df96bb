"""The measured servo as a system of FMUs: build them, wire them, run them.

Nothing here computes a control law, a plant or a friction force; all of that is in the FMUs.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from friction_fmus.data import MeasuredAxis, ServoSettings
from friction_fmus.identification import Array, FitError, filtered_motion
from friction_fmus.package import build, build_record
from harness import Experiment, FmuPart, SeriesPart, System

from .figures import Trace
from .parameters import Parameter

#: What is recorded of a run: position, velocity and commanded force, at every sample of the servo.
RECORDED = ("axis.x", "axis.v", "servo.u")

#: Parameter of the model -> parameters of the parts that carry it.
CARRIERS: Mapping[str, str] = {
    "M": "axis.m",
    "Fc": "friction.Fc",
    "Fs": "friction.Fs",
    "Fv": "friction.Fv",
    "vs": "friction.vs",
    "delta": "friction.delta",
    "OF": "friction.offset",
}


@dataclass(frozen=True)
class ServoFmus:
    """Paths of the FMUs of one servo; `feedforward` only where it has one."""

    reference: Path
    encoder: Path
    velocity: Path
    servo: Path
    axis: Path
    friction: Path
    feedforward: Path | None = None


def friction_parameters(model: Mapping[str, float]) -> dict[str, float]:
    """Return the start values of `Stribeck` and `StaticFeedforward` for a friction model.

    Parameters
    ----------
    model : mapping of str to float
        Fc, Fv, OF, and Fs, vs, delta where it is a Stribeck curve; without them Fs = Fc, which is Coulomb
        friction.

    Returns
    -------
    dict of str to float
        Fc, Fs, Fv [N.s/m], vs [m/s], delta, offset [N].
    """
    return {
        "Fc": model["Fc"],
        "Fs": model.get("Fs", model["Fc"]),
        "Fv": model["Fv"],
        "vs": model.get("vs", 1e-2),
        "delta": model.get("delta", 2.0),
        "offset": model["OF"],
    }


def build_fixed(axis: MeasuredAxis, folder: Path, prefix: str) -> dict[str, Path]:
    """Build the FMUs that do not depend on the identification: reference, encoder, velocity estimate and
    controller.

    Parameters
    ----------
    axis : MeasuredAxis
        Record and servo.
    folder : Path
        Where the FMUs go.
    prefix : str
        Begins their names.

    Returns
    -------
    dict of str to Path
        By the name of the part.
    """
    record, servo = axis.record, axis.servo
    times = servo.Ts * np.arange(len(record))
    r = record.column("reference")
    rd = np.gradient(r, servo.Ts)
    rdd = np.gradient(rd, servo.Ts)
    gains = {"kp": servo.kp, "kv": servo.kv, "ki": 0.0, **_limits(servo)}
    with ThreadPoolExecutor(2) as pool:
        jobs = {
            "reference": pool.submit(build_record, times, r, rd, rdd, folder, name=f"{prefix}Reference"),
            "servo": pool.submit(build, "CascadePPI", folder, {"Ts": servo.Ts, **gains}, name=f"{prefix}Servo"),
            "encoder": pool.submit(build, "Quantiser", folder, {"q": servo.quantum}, name=f"{prefix}Encoder"),
            "velocity": pool.submit(
                build,
                "Differentiator",
                folder,
                # the record starts in motion
                {"Ts": servo.Ts, "window": servo.window, "v0": float(filtered_motion(record).v[0])},
                name=f"{prefix}Velocity",
            ),
        }
        return {part: job.result() for part, job in jobs.items()}


def build_axis(
    axis: MeasuredAxis, model: Mapping[str, float], folder: Path, prefix: str, suffix: str
) -> dict[str, Path]:
    """Build the FMUs that carry identified parameters as start values: axis, friction and feedforward.

    Parameters
    ----------
    axis : MeasuredAxis
        Gives the state at the beginning of the record.
    model : mapping of str to float
        Identified parameters: M and those of `friction_parameters`.
    folder : Path
        Where the FMUs go.
    prefix, suffix : str
        Begin and end of their names.

    Returns
    -------
    dict of str to Path
        By the name of the part.
    """
    motion = filtered_motion(axis.record)
    state = {"m": model["M"], "x0": float(axis.record.column("q")[0]), "v0": float(motion.v[0])}
    curve = friction_parameters(model)
    forward = {**curve, "m": 0.0, **_limits(axis.servo)}
    with ThreadPoolExecutor(2) as pool:
        jobs = {
            "axis": pool.submit(build, "Mass", folder, state, name=f"{prefix}Axis{suffix}"),
            "friction": pool.submit(build, "Stribeck", folder, curve, name=f"{prefix}Friction{suffix}"),
            "feedforward": pool.submit(
                build, "StaticFeedforward", folder, forward, name=f"{prefix}Feedforward{suffix}"
            ),
        }
        return {part: job.result() for part, job in jobs.items()}


def write_servo(
    path: Path, fmus: ServoFmus, samples: int, settings: ServoSettings, step: float, motion_mass: float | None = None
) -> Path:
    """Wire the servo and write it as a system file.

    Parameters
    ----------
    path : Path
        The TOML file; the FMUs are referred to relative to it.
    fmus : ServoFmus
        What the servo is made of; with a feedforward FMU its output is added to the controller's.
    samples : int
        Samples of the record: the run lasts that many sampling periods.
    settings : ServoSettings
        Gives the sampling period.
    step : float
        Communication step between mass and friction [s], a whole part of the sampling period. What is
        sampled is stepped once a sampling period.
    motion_mass : float, optional
        Mass for a feedforward of the reference velocity and acceleration [kg]; without it there is none, as
        in the servo of the record.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    FitError
        The step is no whole part of the sampling period.
    """
    every = round(settings.Ts / step)
    if every < 1 or abs(every * step - settings.Ts) > 1e-9 * settings.Ts:
        raise FitError(
            f"The communication step {step:g} s is no whole part of the sampling period {settings.Ts:g} s; choose one."
        )
    parts = [
        FmuPart("reference", fmus.reference, every=every),
        FmuPart("velocity", fmus.velocity, every=every),
        FmuPart("servo", fmus.servo, every=every),
        FmuPart("axis", fmus.axis),
        FmuPart("friction", fmus.friction),
        FmuPart("encoder", fmus.encoder, every=every),
    ]
    wires = [
        "reference.r -> servo.r",
        "axis.x -> encoder.x",
        "encoder.y -> velocity.x",
        "encoder.y -> servo.x",
        "velocity.v -> servo.v",
        "servo.u -> axis.F_drive",
        "axis.v -> friction.v",
        "friction.F -> axis.F_friction",
    ]
    if any(port.name == "F_ext" for port in parts[4].inputs):
        wires.append("axis.F_ext -> friction.F_ext")
    start: dict[str, float | int | bool | str] = {}
    if motion_mass is None:
        start |= {"servo.rd": 0.0, "servo.rdd": 0.0}
    else:
        start["servo.m"] = motion_mass
        wires += ["reference.rd -> servo.rd", "reference.rdd -> servo.rdd"]
    if fmus.feedforward is not None:
        parts.append(FmuPart("feedforward", fmus.feedforward, every=every))
        wires += ["reference.rd -> feedforward.rd", "reference.rdd -> feedforward.rdd"]
        wires.append("feedforward.u -> servo.f")
    experiment = Experiment(stop=samples * settings.Ts, step=settings.Ts / every, record=RECORDED, decimate=every)
    with System(parts, wires, start, experiment, path.stem) as system:
        system.to_toml(path)
    return path


@dataclass(frozen=True)
class ServoRun:
    """Simulator of a servo: from parameters of the model to the signals at the samples of the record.

    Picklable, so that several can run in processes of their own; each process keeps the systems it has
    loaded.

    Attributes
    ----------
    path : Path
        The system file.
    fixed : tuple of (str, float)
        Parameters of the model that stay as they are.
    """

    path: Path
    fixed: tuple[tuple[str, float], ...] = ()

    def __call__(self, parameters: Mapping[str, float]) -> dict[str, Array]:
        """Return "q" [m] and "force" [N], shape (samples,), for these parameters (see `CARRIERS`)."""
        trace = run_servo(self.path, {**dict(self.fixed), **parameters})
        return {"q": trace.q, "force": trace.force}


def run_servo(path: Path, parameters: Mapping[str, float] | None = None) -> Trace:
    """Run a servo from its system file.

    Parameters
    ----------
    path : Path
        Written by `write_servo`.
    parameters : mapping of str to float, optional
        Parameters of the model that are to differ from the start values of the FMUs (see `CARRIERS`).

    Returns
    -------
    Trace
        Position, and the force commanded at the same instant, for every sample of the record.
    """
    values = {CARRIERS[name]: value for name, value in (parameters or {}).items()}
    result = _loaded(path.resolve(), path.stat().st_mtime_ns).with_start(values).run()
    # A row holds the position at its instant and the force of the sampling period that ends there.
    return Trace(
        q=np.asarray(result["axis.x"].to_numpy(), dtype=np.float64)[:-1],
        force=np.asarray(result["servo.u"].to_numpy(), dtype=np.float64)[1:],
    )


def forget_systems() -> None:
    """Unload the systems that `run_servo` has kept loaded in this process."""
    _loaded.cache_clear()


def friction_curve(fmu: Path, velocities: Array) -> Array:
    """Let a friction FMU draw its curve.

    Parameters
    ----------
    fmu : Path
        A friction FMU with the inputs v and F_ext and the output F.
    velocities : array, shape (n,)
        Velocities [m/s].

    Returns
    -------
    array, shape (n,)
        Friction force at these velocities [N].
    """
    step = 1e-3
    sweep = SeriesPart("sweep", step * np.arange(len(velocities)), {"v": velocities}, {"v": "m/s"})
    experiment = Experiment(stop=step * (len(velocities) - 1), step=step, record=("friction.F",))
    parts = [sweep, FmuPart("friction", fmu)]
    with System(parts, ["sweep.v -> friction.v"], {"friction.F_ext": 0.0}, experiment, "curve") as system:
        return np.asarray(system.run()["friction.F"].to_numpy(), dtype=np.float64)


def model_parameters(
    model: Mapping[str, float],
    errors: Mapping[str, float],
    units: Mapping[str, str],
    meanings: Mapping[str, str],
) -> dict[str, Parameter]:
    """Return the parameters of a model under their names in the system, for a parameter file."""
    return {
        CARRIERS[name]: Parameter(value, units[name], meanings[name], errors.get(name)) for name, value in model.items()
    }


def _limits(servo: ServoSettings) -> dict[str, float]:
    return {"u_min": -servo.force_limit, "u_max": servo.force_limit}


@lru_cache(maxsize=4)
def _loaded(path: Path, _changed: int) -> System:
    return System.from_toml(path)
