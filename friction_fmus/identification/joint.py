"""Identification of a joint that a servo moves against gravity, with friction that grows with the transmitted torque.

The largest torque of gravity is known and sets the scale: the constants of the motor follow from it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from math import ceil, pi
from typing import Final, TypeAlias

import numpy as np
import scipy.optimize

from friction_fmus.axis.servo_loop import quiet_runs
from friction_fmus.blocks.axis_units import ROTARY
from friction_fmus.errors import FitError, RecordError
from friction_fmus.export.block_fmu import fmu
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.fit.contact_model import ContactModel, DataTraits, contact_model
from friction_fmus.identification.fit.estimate import Estimate, Estimated, score_covariance
from friction_fmus.identification.fit.idim import filtered_motion
from friction_fmus.identification.fit.least_squares import Coordinate
from friction_fmus.identification.fit.scores import rms
from harness import ExperimentError, FmuPart, Part, SeriesPart, System
from harness.processors import available

STEP: Final = 1.25e-3  # longest communication step [s]
FIRST: Final = 5  # samples from which the first velocity is measured
SLOW: Final = 0.02  # speed over the largest one below which rows do not count in the regression of the start values
CORRELATED: Final = 0.25  # time over which errors count as correlated [s]
DIFFERENCE: Final = 0.01  # step of finite differences, relative to the value or, if it may be 0, to its typical size
FAILED: Final = 10.0  # error that counts for values with which the joint cannot be simulated [rad]
MOST_STEPS: Final = 25  # of a search
FARTHEST: Final = 30.0  # factor between a value and its typical size
TOLERANCE: Final = 1e-4  # relative change of the cost at which a search ends

LOADS: Final[Mapping[str, tuple[str, ...]]] = {
    "M1": (),
    "M2": ("at_rest", "vs", "delta"),
    "M3": ("a",),
    "M4": ("at_rest", "vs", "delta", "a", "b"),
    "M5": ("at_rest", "vs", "delta", "a_drive", "a_external", "b_drive", "b_external"),
    "M6": ("at_rest", "vs", "delta", "a_drive", "a_external", "b_drive", "b_external", "c_drive", "c_external"),
}
"""Parameters of `TransmissionLoad` that each model of friction under load has beside base; a and b stand for both."""

#: Units of the parameters beside those of the friction model that have one.
UNITS: Final = {"K": "N.m/A", "R": "Ohm", "inertia": "kg.m2", "q0": "rad", "vs": "rad/s", "distance": "rad"} | {
    **{"base": "N.m", "at_rest": "N.m", "c_drive": "1/(N.m)", "c_external": "1/(N.m)"}
}

#: Function of parameters that returns the simulated angles of records.
Simulator: TypeAlias = Callable[[Mapping[str, float]], list[Array]]

SHARES: Final = 4  # elements of GMS, each of which breaks away at twice the distance of the one before


@dataclass(frozen=True, eq=False)
class JointRecord:
    """Motion of a joint under a servo that turns the error of the angle into a duty cycle.

    Parameters
    ----------
    motion : Record
        Angle q and its reference [rad], of a rotary axis.
    supply : array, shape (n,)
        Supply voltage [V].
    gain : float
        Duty cycle over error of the angle [1/rad].
    on : array, shape (n,), optional
        1 where the motor is switched on, 0 where it is not; by default it is always on.

    Raises
    ------
    RecordError
        If a column is missing, has another length or NaN, the axis is linear, or the gain is not positive.
    """

    motion: Record
    supply: Array
    gain: float
    on: Array | None = None

    def __post_init__(self) -> None:
        name = self.motion.name
        self.motion.column("q"), self.motion.column("reference")
        if not self.motion.units.rotary:
            raise RecordError(f"The record {name!r} has the units of a linear axis; give it units=ROTARY.")
        for what, column in (("supply voltage", self.supply), ("switch of the motor", self.on)):
            if column is not None and (np.shape(column) != self.motion.t.shape or not np.all(np.isfinite(column))):
                raise RecordError(f"The {what} of the record {name!r} is not finite for each sample; correct it.")
        if not (np.isfinite(self.gain) and self.gain > 0.0):
            raise RecordError(f"The gain of the record {name!r} is {self.gain:g}; it must be positive.")

    @property
    def switch(self) -> Array:
        """Whether the motor is on, as 1 or 0, shape (n,)."""
        return np.ones(len(self.motion)) if self.on is None else self.on


@dataclass(frozen=True)
class Joint:
    """What is known of a joint; the angle 0 hangs down.

    Attributes
    ----------
    inertia : float
        Moment of inertia of the arm, without the motor [kg.m2].
    gravity : float
        Largest torque of gravity, m g l [N.m].
    """

    inertia: float
    gravity: float

    def __post_init__(self) -> None:
        if not (self.inertia > 0.0 and self.gravity > 0.0 and np.isfinite(self.inertia + self.gravity)):
            raise FitError(f"The inertia {self.inertia:g} and gravity {self.gravity:g} of a joint must be positive.")


@dataclass(frozen=True, eq=False)
class JointIdentification(Estimated):
    """Identified joint.

    Attributes
    ----------
    model : str
        Friction model, which is ``Stribeck`` for the models M1 to M6 as published.
    load : str
        Dependence on the load, M1 to M6.
    parameters : mapping of str to Estimate
        Motor constant K, resistance R, inertia of the motor, angle q0 by which the zero of the sensor is off,
        parameters of `TransmissionLoad`, and those of the friction model at a friction of 1 N.m.
    rms : float
        Error of the angle in the training data [rad].
    seconds : float
        Elapsed time [s].
    converged : bool
        Whether the search converged.
    joint : Joint
        What was known.
    """

    model: str
    load: str
    parameters: Mapping[str, Estimate]
    rms: float
    seconds: float
    converged: bool
    joint: Joint

    def predict(self, records: Sequence[JointRecord]) -> list[Array]:
        """Simulate the joint from the first angle of each record on, with its reference.

        Parameters
        ----------
        records : sequence of JointRecord
            Records; only reference, supply voltage, switch and the first angles are used.

        Returns
        -------
        list of array, each of shape (n,)
            Angles at the samples [rad].
        """
        with _simulator(self.model, self.joint, records) as run:
            return run(self.values())

    def error(self, records: Sequence[JointRecord]) -> float:
        """Return the error of the simulated angle.

        Parameters
        ----------
        records : sequence of JointRecord
            Records, which may be others than those of the fit.

        Returns
        -------
        float
            Root mean square over all samples [rad].
        """
        pairs = zip(self.predict(records), records, strict=True)
        return rms(np.concatenate([q - record.motion.column("q") for q, record in pairs]))


def identify_joint(
    records: Sequence[JointRecord],
    joint: Joint,
    *,
    model: str = "Stribeck",
    load: str = "M1",
    start: Mapping[str, float] | None = None,
) -> JointIdentification:
    """Identify motor, inertia and friction of a joint so that its simulated angle follows the measured one.

    Parameters
    ----------
    records : sequence of JointRecord
        Training data.
    joint : Joint
        What is known.
    model : str
        Friction block with the input Fn, such as ``Stribeck``, ``LuGre`` or ``GMS``.
    load : str
        Dependence on the load: M1 (none), M2 (more friction at rest), M3 (load), M4 (both), M5 (different for driving
        and being driven) or M6 (quadratic).
    start : mapping of str to float, optional
        Start values, such as those of a simpler model.

    Returns
    -------
    JointIdentification
        Estimates with robust standard errors.

    Raises
    ------
    FitError
        If the model has no normal force, the load is unknown, or the angle contradicts gravity.
    RecordError
        If there is no record or no motion.

    Notes
    -----
    Models M1 to M6: M. Duclusaud, G. Passault, V. Padois, O. Ly, "Extended friction models for the physics simulation
    of servo actuators", IEEE International Conference on Robotics and Automation, 2025. The friction model has a
    friction of 1 N.m at Fn = 1, which `TransmissionLoad` multiplies. Local minima are common: start from the values of
    a simpler model and compare the errors.
    """
    begin = time.perf_counter()
    contact = contact_model(model, ROTARY)
    if not contact.loaded or "Fc" not in contact.parameters:
        raise FitError(f"{model} has no input Fn or no parameter Fc; use Stribeck, LuGre, GMS, Dahl or ElastoPlastic.")
    if load not in LOADS:
        raise FitError(f"There is no load {load!r}; use one of {', '.join(LOADS)}.")
    if not records:
        raise RecordError("There are no records; pass at least one.")
    if wrong := [name for name, value in (start or {}).items() if not np.isfinite(value)]:
        raise FitError(f"The start value of {wrong[0]} is not a finite number; correct it.")
    unknowns = _unknowns(contact, joint, load, records, dict(start or {}))
    measured = np.concatenate([record.motion.column("q") for record in records])
    latest: dict[bytes, Array] = {}
    with _simulator(model, joint, records) as run:

        def residual(x: Array) -> Array:
            values = {c.name: c.value(float(at)) for c, at in zip(unknowns, x, strict=True)}
            try:
                q = np.concatenate(run(values))
            except ExperimentError:  # a load that jumps can leave the loop without a solution; take a shorter step
                return np.full(len(measured), FAILED / np.sqrt(len(measured)))
            latest.clear()
            error: Array = (q - measured) / np.sqrt(len(measured))
            latest[x.tobytes()] = error
            return error

        def jacobian(x: Array) -> Array:
            centre = latest.get(x.tobytes())
            centre = residual(x) if centre is None else centre
            return np.column_stack([(residual(x + DIFFERENCE * each) - centre) / DIFFERENCE for each in np.eye(len(x))])

        found = scipy.optimize.least_squares(
            residual,
            [c.at(c.start) for c in unknowns],
            jacobian,
            bounds=([c.at(c.lower) for c in unknowns], [c.at(c.upper) for c in unknowns]),
            ftol=TOLERANCE,
            xtol=TOLERANCE,
            gtol=None,
            max_nfev=MOST_STEPS,
        )
    values = {c.name: c.value(float(at)) for c, at in zip(unknowns, found.x, strict=True)}
    spread = _covariance(np.asarray(found.jac), np.asarray(found.fun), records)
    units = {**{name: parameter.unit for name, parameter in contact.parameters.items()}, **UNITS}
    estimates = {}
    for c, error in zip(unknowns, spread.tolist(), strict=True):
        size = values[c.name] if c.log else c.scale
        estimates[c.name] = Estimate(c.name, values[c.name], size * error, units.get(c.name, "1"))
    whole, seconds = float(np.linalg.norm(found.fun)), time.perf_counter() - begin
    if whole >= FAILED:
        raise FitError("The joint cannot be simulated with the start values; give others.")
    return JointIdentification(model, load, estimates, whole, seconds, found.status > 0, joint)


def _covariance(J: Array, residual: Array, records: Sequence[JointRecord]) -> Array:
    """Return the robust standard errors of the coordinates, infinite where the angle does not depend on one."""
    lengths, lag = [len(record.motion) for record in records], round(CORRELATED / records[0].motion.Ts)
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-10)
    spread = np.sqrt(np.diag(inverse @ score_covariance(J, residual, lengths, lag) @ inverse))
    return np.where(np.linalg.norm(J, axis=0) > 0.0, spread, np.inf)


def _unknowns(
    contact: ContactModel, joint: Joint, load: str, records: Sequence[JointRecord], start: Mapping[str, float]
) -> list[Coordinate]:
    """Return the unknowns, with start values from a regression of the torque."""
    K, R, viscous, Coulomb, inertia = _regression(joint, records)
    speed = max(float(np.max(np.abs(filtered_motion(record.motion).v))) for record in records)
    for short in "ab":  # the values of a model that does not distinguish the sides
        if short in start:
            start = {**start, **{f"{short}_{side}": start[short] for side in ("drive", "external")}}
    loaded = load not in ("M1", "M2")
    sizes = {"K": K, "R": R, "inertia": inertia, "vs": 0.1 * speed, "delta": 2.0, "distance": 0.003 * speed}
    logarithmic = set(sizes)
    sizes |= {"q0": 0.02, "base": Coulomb, "at_rest": Coulomb, **dict.fromkeys(("a", "a_drive", "a_external"), 0.2)}
    sizes |= {**dict.fromkeys(("b", "b_drive", "b_external"), 0.1), "c_drive": 0.2 / joint.gravity}
    sizes["c_external"] = sizes["c_drive"]
    begin = {**sizes, "q0": 0.0, "base": 0.5 * Coulomb if loaded else Coulomb, "at_rest": 0.2 * Coulomb}
    begin |= {name: 0.2 * sizes[name] for name in sizes if name[:2] in ("b", "b_", "c_")}
    traits = DataTraits(1.0, 1.0, viscous, 1.0 / (0.01 * speed), 0.01 / speed, speed)
    mine = [n for n in contact.identified(set(), {}) if n not in ("Fc", "Fs", "vs", "delta", "Fn0")]
    for name in mine:
        fit = contact.fit_of(name)
        sizes[name] = begin[name] = (traits.value(fit.start) if fit else contact.parameters[name].start) or 1.0
        if contact.parameters[name].lower > 0.0:
            logarithmic.add(name)
    names = ["K", "R", "inertia", "q0", "base", *LOADS[load], *mine]
    names += ["distance"] if "alpha[1]" in contact.parameters else []
    found = []
    for name in names:
        size, log = sizes[name], name in logarithmic
        low, high = (size / FARTHEST, size * FARTHEST) if log else (-pi if name == "q0" else 0.0, np.inf)
        high = min(high, 50.0) if name == "delta" else high
        least = 1.001 * low if log else low if name == "q0" else 1e-3 * size  # inside
        value = min(max(start.get(name, begin[name]), least), 0.999 * high)
        found.append(Coordinate(name, size, value, low, high, log))
    return found


def _regression(joint: Joint, records: Sequence[JointRecord]) -> tuple[float, float, float, float, float]:
    """Return motor constant, resistance, viscous and Coulomb friction, and inertia of the motor."""
    # on K/R U duty = J a + gravity sin q + (Fv + K^2/R) v + Fc sgn v; four fifths of the viscous part count as K^2/R
    rows, torques = [], []
    for record in records:
        motion = filtered_motion(record.motion)
        duty = np.clip(record.gain * (record.motion.column("reference") - record.motion.column("q")), -1.0, 1.0)
        u = record.supply * duty
        moves = (np.abs(motion.v) > SLOW * float(np.max(np.abs(motion.v)))) & (record.switch > 0.0)
        columns = np.column_stack([u, -motion.v, -np.sign(motion.v), -motion.a])
        rows.append(columns[moves])
        torques.append((joint.gravity * np.sin(motion.q) + joint.inertia * motion.a)[moves])
    A, b = np.concatenate(rows), np.concatenate(torques)
    size = np.linalg.norm(A, axis=0)
    if len(A) < 10 * A.shape[1] or not np.all(size > 0.0):
        raise RecordError("The joint hardly moves while its motor is on; use records with motion.")
    ratio, viscous, Coulomb, inertia = (np.linalg.lstsq(A / size, b, rcond=None)[0] / size).tolist()
    if ratio <= 0.0:
        raise FitError(
            "The motor pushes towards gravity where it should hold against it: count the angle from where the arm "
            "hangs down, and give reference and angle the same sign."
        )
    viscous = max(viscous, 1e-3 * joint.gravity)
    K = 0.8 * viscous / ratio
    return K, K / ratio, 0.2 * viscous, max(Coulomb, 0.02 * joint.gravity), max(inertia, 0.05 * joint.inertia)


@contextmanager
def _simulator(model: str, joint: Joint, records: Sequence[JointRecord]) -> Iterator[Simulator]:
    """Provide a function that returns the simulated angle of each record for parameters."""
    contact = contact_model(model, ROTARY)
    with ExitStack() as stack:
        stack.enter_context(quiet_runs())
        systems = [stack.enter_context(_system(contact, joint, record)) for record in records]
        threads = stack.enter_context(ThreadPoolExecutor(max(1, min(available(), len(records)))))

        def run(values: Mapping[str, float]) -> list[Array]:
            angle = partial(_angle, _start(contact, joint, values))
            runs = [threads.submit(angle, *each) for each in zip(systems, records, strict=True)]
            wait(runs)  # also for those beside one that fails: the next call uses their systems
            return [each.result() for each in runs]

        yield run


def _system(contact: ContactModel, joint: Joint, record: JointRecord) -> System:
    """Return the loop of servo, motor, arm and friction for a record."""
    t = record.motion.t - record.motion.t[0]
    logged = {"r": record.motion.column("reference"), "U": record.supply}
    parts: list[Part] = [
        SeriesPart("log", t, logged, {"r": "rad", "U": "V"}, interpolation="linear", beyond="hold"),
        SeriesPart("switch", t, {"on": record.switch}, {"on": "1"}, interpolation="previous", beyond="hold"),
    ]
    blocks = {"error": "Sum", "motor": "DCMotor", "arm": "Mass", "gravity": "Cogging", "load": "TransmissionLoad"}
    parts += [FmuPart(name, fmu(block, "rotational")) for name, block in blocks.items()]
    parts.append(friction := FmuPart("friction", contact.path))
    wires = ["log.r -> error.u1", "arm.x -> error.u2", "error.y -> motor.duty", "log.U -> motor.U"]
    wires += ["switch.on -> motor.on", "arm.v -> motor.v", "motor.F -> arm.F_drive", "arm.x -> gravity.x"]
    wires += ["gravity.F -> arm.F_load", "arm.v -> friction.v", "friction.F -> arm.F_friction", "arm.v -> load.v"]
    wires += ["motor.F -> load.F_drive", "gravity.F -> load.F_external", "load.Fn -> friction.Fn"]
    if "F_ext" in {port.name for port in friction.inputs}:
        wires.append("arm.F_ext -> friction.F_ext")
    gains = {"error.gain[1]": record.gain, "error.gain[2]": -record.gain}
    q = record.motion.column("q")[:FIRST]
    first = {"arm.x0": float(q[0]), "arm.v0": float(np.polyfit(t[:FIRST], q, 1)[0])}
    return System(parts, wires, {**gains, **first, "gravity.pitch": 2.0 * pi, "gravity.amplitude[1]": -joint.gravity})


def _start(contact: ContactModel, joint: Joint, values: Mapping[str, float]) -> dict[str, float]:
    """Return the start values of the loop for parameters of the identification."""
    found = {"motor.K": values["K"], "motor.R": values["R"], "arm.m": joint.inertia + values["inertia"]}
    found["gravity.phase[1]"] = values["q0"]
    both = {f"{short}_{side}": values.get(short, 0.0) for short in "ab" for side in ("drive", "external")}
    given = {**both, "at_rest": 0.0, **values}
    load = ("base", "at_rest", *both, "c_drive", "c_external", "vs", "delta")
    found |= {f"load.{name}": given[name] for name in load if name in given}
    found |= {f"friction.{name}": 1.0 for name in ("Fc", "Fs", "Fn0") if name in contact.parameters}
    own = (contact.parameters.keys() & values.keys()) - set(load)
    found |= {f"friction.{name}": values[name] for name in own}
    if "distance" in values:
        found["friction.N"] = SHARES
        for i in range(1, SHARES + 1):
            found[f"friction.alpha[{i}]"] = 1.0 / SHARES
            found[f"friction.k[{i}]"] = 1.0 / (SHARES * values["distance"] * 2.0 ** (i - 1))
    return found


def _angle(start: Mapping[str, float], system: System, record: JointRecord) -> Array:
    """Return the simulated angle at the samples of a record."""
    Ts = record.motion.Ts
    every = ceil(Ts / STEP - 1e-9)
    stop = Ts * (len(record.motion) - 1)
    result = system.with_start(start).run(stop=stop, step=Ts / every, master="newton", record=["arm.x"])
    return result["arm.x"].to_numpy()[::every][: len(record.motion)]
