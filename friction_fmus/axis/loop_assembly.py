"""Assembly of the closed loop of an axis from FMUs, in which laws, plants and friction are computed."""

from __future__ import annotations

from collections.abc import Callable, Container, Hashable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from types import TracebackType
from typing import Final

import numpy as np

from friction_fmus.axis.servo import SHARES, AxisPlant, Compensator, CurrentLoop, Servo, Trajectory
from friction_fmus.blocks.axis_units import domain_of
from friction_fmus.blocks.catalogue import find
from friction_fmus.export.block_fmu import fmu
from harness import FmuPart, Part, SeriesPart, Wire
from harness.parts.part import StartValue
from harness.system.wire import parse_wire


@dataclass
class PartPool:
    """Parts of loops, to be used again by the next one, because loading an FMU takes longer than a short run."""

    # Loops that share parts must not run at the same time. Used with ``with``, the pool closes the parts at the end.

    _parts: dict[Hashable, FmuPart] = field(default_factory=dict)

    def part(self, name: str, fmu: Hashable, path: Callable[[], Path], every: int) -> FmuPart:
        """Return a part."""
        key = name, fmu, every
        if key not in self._parts:
            self._parts[key] = FmuPart(name, path(), every=every)
        return self._parts[key]

    def __enter__(self) -> PartPool:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for part in self._parts.values():
            part.close()


def block(name: str, rotary: bool = False) -> Path:
    """Return the FMU of a block with its default start values."""
    path = _built(name, rotary)
    if not path.exists():  # the cache was removed
        _built.cache_clear()
    return path if path.exists() else _built(name, rotary)


@cache
def _built(name: str, rotary: bool) -> Path:
    return fmu(name, domain_of(rotary))


def typed(part: Part, values: Mapping[str, float]) -> dict[str, float | int | bool]:
    """Return the values that are parameters of a part, converted to the parameter's type."""
    kinds: dict[str, type[float | int | bool]] = {"Real": float, "Integer": int, "Boolean": bool}
    types = {port.name: kinds[port.type] for port in part.parameters if port.type in kinds}
    return {name: types[name](value) for name, value in values.items() if name in types}


@dataclass
class AxisAssembly:
    """Parts, connections and start values of an axis, added one after the other."""

    trajectory: Trajectory  # reference, initial state and disturbances
    every: int  # number of communication steps between mass and friction in a sample of the servo
    fmus: Mapping[str, Path]  # FMUs to use instead of those of the library, by name of the part
    pool: PartPool  # parts of other loops to use again
    plant: AxisPlant  # mass and friction
    parts: list[Part] = field(default_factory=list)
    wires: list[str | Wire] = field(default_factory=list)
    start: dict[str, StartValue] = field(default_factory=dict)
    """What has been added."""

    def add(self, name: str, model: str, values: Mapping[str, float], *, sampled: bool = True) -> FmuPart:
        """Add a block with these parameters; those that it does not have are ignored."""
        part = self._part(name, model, lambda: block(model, self.trajectory.rotary), self.every if sampled else 1)
        self.start |= {f"{name}.{key}": value for key, value in typed(part, values).items()}
        return part

    def _part(self, name: str, fmu: Hashable, path: Callable[[], Path], every: int) -> FmuPart:
        given = self.fmus.get(name)
        if given is not None:
            fmu, path = given, partial(Path, given)
        part = self.pool.part(name, fmu, path, every)
        self.parts.append(part)
        return part

    def add_plant(self) -> None:
        """Add mass, friction, and the force over position."""
        trajectory, plant = self.trajectory, self.plant
        sides = {"": FRICTION} if plant.load is None else {"1": FRICTION, "2": OF_LOAD}
        state = {"x0": trajectory.x0, "x1_0": trajectory.x0}
        state |= {f"v{side}_0" if side else "v0": trajectory.v0 for side in sides}
        self.add("axis", "Mass" if plant.load is None else "TwoMass", state, sampled=False)
        self.start |= constant_force(plant, trajectory.load - plant.offset)
        for side, name in sides.items():
            contact = self.add(name, plant.friction, {}, sampled=False)
            self.wires += [f"axis.v{side} -> {name}.v", f"{name}.F -> axis.F_friction{side}"]
            if _has_input(contact, "F_ext"):
                self.wires.append(f"axis.F_ext{side} -> {name}.F_ext")
        self.start |= start_of(plant, {part.name: part for part in self.parts}, trajectory.x0)
        if _has_input(contact, "F_t"):
            self._add_motor(f"{FRICTION}.F_t")
        if plant.loaded:
            self._add_load()
        elif "Fn0" in plant.values and _has_input(contact, "Fn"):  # identified at a constant normal force
            self.start |= {f"{name}.Fn": plant.values["Fn0"] for name in sides.values()}
        if plant.position is not None:
            table = plant.position
            self._part("position", table, lambda: table.fmu(trajectory.rotary), 1)
            self.start |= {f"position.{name}": value for name, value in plant.position.start.items()}
            velocity = "axis.v" if plant.load is None else "axis.v1"
            self.wires += [f"{position_of(self.plant)} -> position.x", f"{velocity} -> position.v"]
            # a step late, so that only mass and friction are solved jointly: the force hardly changes in a step
            self.wires.append(Wire("position.F_position", "axis.F_load", delay=1))

    def _add_load(self) -> None:
        """Add what makes the friction grow with the transmitted force, and one input for both forces of the drive."""
        shares = {name: self.plant.terms[name] for name in SHARES}
        self.add("transmission", "TransmissionLoad", {"base": self.plant.values["Fn0"], **shares}, sampled=False)
        self._add_motor("transmission.F_drive")
        self.wires += ["axis.v -> transmission.v", f"transmission.Fn -> {FRICTION}.Fn"]
        if self.plant.position is not None:
            self.wires.append(Wire("position.F_position", "transmission.F_external", delay=1))

    def _add_motor(self, other: str) -> None:
        """Add one input for the force of the drive, which acts on the axis and is an input of another part."""
        self.add("motor", "Sum", {}, sampled=False)
        wires = [parse_wire(wire) for wire in self.wires]
        self.wires = [replace(wire, target="motor.u1") if wire.target == DRIVE else wire for wire in wires]
        self.wires += [f"motor.y -> {DRIVE}", f"motor.y -> {other}"]


@dataclass
class LoopAssembly(AxisAssembly):
    """The same with a servo and compensators."""

    servo: Servo = field(kw_only=True)  # feedback and sensors

    @property
    def position(self) -> str:
        """Output with the measured position."""
        return "encoder.y" if self.servo.quantum else self._exact

    @property
    def velocity(self) -> str:
        """Output with the measured velocity."""
        lowpass = self.servo.velocity_filter
        return "velocity.v" if lowpass is None or lowpass.order == 1 else "lowpass.y"

    @property
    def _exact(self) -> str:
        """Output with the measured position before it is rounded."""
        return "measured.y" if self.servo.noise else position_of(self.plant)

    def add_sensors(self) -> None:
        """Add the reference, and the measurement of position and velocity."""
        servo, trajectory = self.servo, self.trajectory
        self._part("reference", trajectory.reference, lambda: trajectory.reference, 1)
        lowpass = servo.velocity_filter
        tau = 0.0 if lowpass is None else lowpass.tau
        own = {"Ts": servo.Ts, "window": servo.window, "v0": trajectory.v0, "tau": tau}
        self.add("velocity", "Differentiator", own)
        self.wires.append(f"{self.position} -> velocity.x")
        if lowpass is not None and lowpass.order == 2:
            self.add("lowpass", "SecondOrderFilter", {**lowpass.parameters, "Ts": servo.Ts})
            self.wires.append("velocity.v -> lowpass.u")
        if servo.noise:
            noise = trajectory.noise
            if noise is None:
                raise ValueError("a servo with noise needs an FMU that outputs the noise")
            self._part("noise", noise, lambda: noise, 1)
            self.add("measured", "Sum", {"gain[2]": servo.noise}, sampled=False)
            self.wires += [f"{position_of(self.plant)} -> measured.u1", "noise.r -> measured.u2"]
        if servo.quantum:
            self.add("encoder", "Quantiser", {"q": servo.quantum}, sampled=False)
            self.wires.append(f"{self._exact} -> encoder.x")

    def add_servo(self) -> None:
        """Add the feedback law."""
        servo, motion, given, mass = self.servo, self.trajectory.motion, self.trajectory.inertia, self.plant.mass
        inertia = (mass if given is None else given) if motion else servo.inertia_feedforward
        values = {**servo.gains, **self.limits, "Ts": servo.Ts, "m": inertia}
        values |= {"d": self.trajectory.viscous} if motion else {}
        self.add("servo", servo.law, values)
        self.wires += ["reference.r -> servo.r", f"{self.position} -> servo.x", f"{self.velocity} -> servo.v"]
        command = "servo.u"
        if servo.notch is not None:
            self.add("notch", "SecondOrderFilter", {**servo.notch.parameters, "Ts": servo.Ts})
            self.wires.append(f"{command} -> notch.u")
            command = "notch.y"
        if servo.lag:
            self.add("current", "SecondOrderFilter", {**CurrentLoop(servo.lag, servo.Ts).parameters, "Ts": servo.Ts})
            self.wires.append(f"{command} -> current.u")
            command = "current.y"
        self.wires.append(Wire(command, DRIVE, delay=self.every * servo.delay))
        for name, known in (("rd", motion or servo.velocity_feedforward), ("rdd", inertia > 0.0)):
            if known:
                self.wires.append(f"reference.{name} -> servo.{name}")
            else:
                self.start[f"servo.{name}"] = 0.0

    @property
    def limits(self) -> dict[str, float]:
        """Limits of the force."""
        return {"u_min": -self.servo.force_limit, "u_max": self.servo.force_limit}

    def add_compensation(self, compensator: Compensator | None, feedforward: Compensator | None) -> None:
        """Add the forces of feedforward and compensator and the constant force to the output of the servo."""
        offset, injected = self.trajectory.offset, self.trajectory.injected
        if injected is not None and compensator is not None:
            raise ValueError("a loop with a compensator has no injected force")
        forces = self._add_forces(*with_friction(self.servo, compensator, feedforward))
        if injected is not None:
            t = self.servo.Ts * np.arange(float(len(injected)))
            unit = {"F": self.trajectory.words.N}
            self.parts.append(SeriesPart("injected", t, {"F": injected}, unit, interpolation="previous", beyond="hold"))
            forces.append(Wire("injected.F", ""))
        if not forces:
            self.start["servo.f"] = offset
            return
        if len(forces) == 1:
            self.wires.append(replace(forces[0], target="servo.f", offset=offset))
        else:
            self.add("force", "SampledSum", {"Ts": self.servo.Ts})
            self.wires += [replace(wire, target=f"force.u{i}") for i, wire in enumerate(forces, start=1)]
            self.wires.append(Wire("force.y", "servo.f", offset=offset))
        part = next((part for part in self.parts if part.name == "compensator"), None)
        if part is None or not _has_input(part, "u_prev"):
            return
        # without the known forces, so that an estimator does not see them: constant force, feedforward, and table
        fed_back = Wire("servo.u", "compensator.u_prev", offset=-offset, delay=self.every)
        known = forces[1:]
        if not known:
            self.wires.append(fed_back)
            return
        gains = {f"gain[{i}]": -1.0 for i in range(2, 2 + len(known))}
        self.add("unexplained", "SampledSum", {**gains, "Ts": self.servo.Ts})
        self.wires.append(replace(fed_back, target="unexplained.u1"))
        self.wires += [
            replace(wire, target=f"unexplained.u{i}", delay=self.every) for i, wire in enumerate(known, start=2)
        ]
        self.wires.append("unexplained.y -> compensator.u_prev")

    def _add_forces(self, compensator: Compensator | None, feedforward: Compensator | None) -> list[Wire]:
        """Add the laws and the table over position; return a connection without target for the force of each."""
        laws = {"compensator": compensator, "feedforward": feedforward}
        given = {name: law for name, law in laws.items() if law is not None}
        for name, law in reversed(given.items()):
            self._add_law(name, law)
        forces = [Wire(f"{name}.{law.output}", "") for name, law in given.items()]
        gravity = load_feedforward(self.plant) if self.trajectory.motion else None
        if gravity is not None:
            self._add_law("load", gravity)
            forces.append(Wire("load.u", ""))
        table = self.trajectory.table
        if table is not None:
            self._part("table", table, lambda: table.fmu(self.trajectory.rotary), 1)
            self.start |= {f"table.{name}": value for name, value in table.start.items()}
            self.wires += ["reference.r -> table.x", "reference.rd -> table.v"]
            forces.append(Wire("table.F_position", "", gain=-1.0))
        return forces

    def _add_law(self, name: str, law: Compensator) -> FmuPart:
        """Add a law with its limits, and connect the signals that it uses."""
        part = self.add(name, law.model, {**self.limits, "Ts": self.servo.Ts, **law.values})
        known = {"x": self.position, "v": self.velocity, **{port: f"reference.{port}" for port in ("r", "rd", "rdd")}}
        taken = {port.name for port in part.inputs}
        # a friction without Fn0, such as that of the drive, was not identified under load: it is constant
        if "Fn" in taken and "Fn0" in law.values and self.plant.loaded and self.trajectory.motion:
            known["Fn"] = "load.Fn"
        elif "Fn" in taken:
            self.start[f"{name}.Fn"] = law.values.get("Fn0", 1.0)
        self.wires += [f"{source} -> {name}.{port}" for port, source in known.items() if port in taken]
        return part


def load_feedforward(plant: AxisPlant) -> Compensator | None:
    """Return the law for gravity and load of an axis; None if it has neither."""
    if not plant.terms:
        return None
    rubs = find(plant.friction).about.friction
    within = rubs.level(plant.values).viscous if rubs is not None else 0.0
    viscous = within or plant.values.get("Fv", 0.0)
    given = {"m": 0.0, "offset": plant.offset, "m_moved": plant.mass, "Fv": viscous, "G_sin": 0.0}
    given |= {"Fc": plant.values["Fn0"]} if plant.loaded else dict.fromkeys(SHARES, 0.0)
    return Compensator("LoadFeedforward", "u", {**given, **plant.terms})


REPLACING: Final = ("feedforward", "model feedback")
"""Kinds of compensators that replace the friction feedforward of a drive; it stays beside the others."""


def with_friction(
    servo: Servo, compensator: Compensator | None, feedforward: Compensator | None
) -> tuple[Compensator | None, Compensator | None]:
    """Return compensator and feedforward, with the friction feedforward of the drive unless one of them replaces it."""
    uses = [find(law.model).about.use for law in (compensator, feedforward) if law is not None]
    if servo.friction is None or any(use is not None and use.kind in REPLACING for use in uses):
        return compensator, feedforward
    return (servo.friction, None) if compensator is None else (compensator, servo.friction)


FRICTION, OF_LOAD = "friction", "load_friction"  # parts with the friction of the motor, or of all, and of a load


DRIVE: Final = "axis.F_drive"  # input of the mass for the force of the drive


def drive_input(parts: Container[str]) -> str:
    """Return the input of an axis for the force of the drive."""
    return "motor.u1" if "motor" in parts else DRIVE


def position_of(plant: AxisPlant) -> str:
    """Return the output with the position of an axis, which of two masses is that of the motor."""
    return "axis.x" if plant.load is None else "axis.x1"


def start_of(plant: AxisPlant, parts: Mapping[str, Part], x0: float) -> dict[str, StartValue]:
    """Return the start values of masses and friction of an axis that begins at x0."""
    friction, load = parts[FRICTION], plant.load
    found: dict[str, StartValue]
    if load is None:
        found, parted = {"axis.m": plant.mass, "axis.d": viscous_beside(friction, plant)}, {FRICTION: 1.0}
    else:
        own = load.parameters(plant.mass)
        found = {f"axis.{name}": value for name, value in own.items()}
        rubs = find(plant.friction).about.friction
        held = load.friction * rubs.level(plant.values).Fc if rubs is not None else 0.0
        spring = plant.offset if abs(plant.offset) > 0.5 * held else 0.0  # holds a weight that friction does not
        found["axis.x2_0"] = x0 - spring / own["k"]
        parted = {FRICTION: 1.0 - load.friction, OF_LOAD: load.friction}
    if "transmission" in parts:
        found |= {"transmission.base": plant.values["Fn0"]}
        found |= {f"transmission.{name}": plant.terms[name] for name in SHARES}
    values, forces = typed(friction, plant.values), forces_of(friction)
    for part, share in parted.items():
        found |= {f"{part}.{name}": share * value if name in forces else value for name, value in values.items()}
    return found


def forces_of(friction: Part) -> list[str]:
    """Return the parameters of a block that are proportional to its force: in N, N/m, ..., and the factors of F_t."""
    factors = ("mu_avg", "mu_dif") if _has_input(friction, "F_t") else ()
    return [
        port.name
        for port in friction.parameters
        if (port.unit and port.unit[0] == "N" and port.name != "Fn0") or port.name in factors
    ]


def viscous_beside(friction: Part, plant: AxisPlant) -> float:
    """Return the coefficient of the viscous friction beside a friction block [N.s/m]; 0 if the block has its own."""
    own = any(port.name == "Fv" for port in friction.parameters)
    return 0.0 if own else float(plant.values.get("Fv", 0.0))


def constant_force(plant: AxisPlant, force: float) -> dict[str, StartValue]:
    """Return the start value that applies a constant force to the axis."""
    if plant.position is not None:
        return {"position.F0": force}
    found: dict[str, StartValue] = {"axis.F_load": force}
    return found | ({"transmission.F_external": force} if plant.loaded else {})


def _has_input(part: Part, name: str) -> bool:
    return name in {port.name for port in part.inputs}
