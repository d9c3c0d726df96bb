"""Loads of contacts: the models M1 to M6 and efficiencies, against their equations, on arms and screws."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from math import atan, copysign, cos, degrees, exp, pi, radians, sin, tan

import numpy as np
import pytest
from numpy.typing import NDArray
from thorough import some

from friction_fmus import fmu
from harness import CallablePart, Drive, Experiment, FmuPart, Part, Port, SeriesPart, System

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Model:
    """Friction budget of Duclusaud et al., written from the equations of the paper."""

    base: float
    viscous: float
    stribeck: float = 0.0
    load: tuple[float, float] = (0.0, 0.0)
    """Of the drive, and external."""
    load_stribeck: tuple[float, float] = (0.0, 0.0)
    quadratic: tuple[float, float] = (0.0, 0.0)
    speed: float = 1.0
    exponent: float = 1.0

    def budget(self, v: float, motor: float, external: float) -> float:
        """Return the friction without its viscous part."""
        curve = exp(-(abs(v / self.speed) ** self.exponent))
        found = self.base + abs(external * self.load[1] - motor * self.load[0])
        found += curve * (self.stribeck + abs(external * self.load_stribeck[1] - motor * self.load_stribeck[0]))
        if np.sign(motor) != np.sign(external):
            if abs(external) < abs(motor):
                found += curve * self.quadratic[1] * external**2
            elif abs(external) > abs(motor):
                found += curve * self.quadratic[0] * motor**2
        return found

    @property
    def start(self) -> dict[str, float]:
        """Start values of the block."""
        names = ("a_drive", "a_external", "b_drive", "b_external", "c_drive", "c_external")
        pairs = dict(zip(names, (*self.load, *self.load_stribeck, *self.quadratic), strict=True))
        return {"base": self.base, "at_rest": self.stribeck, "vs": self.speed, "delta": self.exponent, **pairs}


MODELS = {
    "M1": Model(0.0128, 0.0037),
    "M2": Model(0.0119, 0.0036, 0.02, speed=0.8, exponent=1.4),
    "M3": Model(0.008, 0.004, load=(0.11, 0.11)),
    "M4": Model(0.007, 0.004, 0.01, (0.09, 0.09), (0.04, 0.04), speed=1.2, exponent=1.1),
    "M5": Model(0.006, 0.005, 0.005, (0.27, 0.02), (0.01, 0.08), speed=2.0, exponent=3.0),
    # published for a servo of the type XL330
    "M6": Model(
        *(0.004771, 0.005360, 0.004676, (0.2668, 8.5e-6), (1.1e-5, 0.0808), (0.00490, 0.00997)),
        **{"speed": 2.890, "exponent": 8.683},
    ),
}


def loads(block: str, start: dict[str, float], **inputs: Array) -> Array:
    """Return Fn for inputs at each sample: the outputs after a step belong to the inputs before it."""
    with closing(Drive(FmuPart("load", fmu(block, "rotational")))) as drive:
        held = {name: np.append(values, 0.0) for name, values in inputs.items()}
        return np.asarray(drive.run(held, ["Fn"], 1e-3, start=start)[1:, 0])


@pytest.mark.parametrize("name", MODELS)
def test_models_are_those_of_the_paper(name: str) -> None:
    model, random = MODELS[name], np.random.default_rng(5)
    v = random.normal(0.0, 2.0 * model.speed, 400)
    motor, external = random.normal(0.0, 0.5, (2, 400))
    motor[:20], external[20:40], v[40:60], external[60:80] = 0.0, 0.0, 0.0, -motor[60:80]
    expected = [model.budget(*each) for each in zip(v, motor, external, strict=True)]
    found = loads("TransmissionLoad", model.start, v=v, F_drive=motor, F_external=external)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert np.all(found >= 0.0)


def series(**columns: tuple[Array, str]) -> SeriesPart:
    """Return inputs, held for a millisecond each."""
    n = len(next(iter(columns.values()))[0])
    values, units = ({name: each[k] for name, each in columns.items()} for k in (0, 1))
    return SeriesPart("given", 1e-3 * np.arange(float(n)), values, units, interpolation="previous", beyond="hold")


@pytest.mark.parametrize("contact", some(["Stribeck", "LuGre", "Dahl", "GMS", "MaxwellSlip"], ["Stribeck", "LuGre"]))
def test_contacts_dissipate_under_changing_load(contact: str) -> None:
    random, n = np.random.default_rng(8), 4000
    v = np.convolve(random.normal(size=n), np.ones(60) / 60.0, "same")
    given = series(
        v=(v, "rad/s"),
        drive=(np.repeat(random.normal(0.0, 0.5, n // 50), 50), "N.m"),
        external=(np.repeat(random.normal(0.0, 0.5, n // 80), 80), "N.m"),
    )
    parts = [
        given,
        FmuPart("load", fmu("TransmissionLoad", "rotational")),
        FmuPart("friction", fmu(contact, "rotational")),
    ]
    wires = ["given.v -> load.v", "given.drive -> load.F_drive", "given.external -> load.F_external"]
    wires += ["given.v -> friction.v", "load.Fn -> friction.Fn"]
    start = {f"load.{name}": value for name, value in MODELS["M6"].start.items()}
    start |= {"friction.F_ext": 0.0} if contact == "Stribeck" else {}
    experiment = Experiment(1e-3 * n, 1e-3, master="gauss-seidel", record=("given.v", "friction.F"))
    with System(parts, wires, start, experiment) as system:
        result = system.run()
    power = (result["friction.F"] * result["given.v"]).to_numpy()
    assert np.sum(power) > 0.0
    if contact == "Stribeck":  # which holds no energy
        assert np.all(power >= 0.0)


M, G, L = 0.49, 9.81, 0.1  # mass [kg], gravity [m/s2], length [m] of an arm


def arm(q0: float, model: Model, torque: float = 0.0) -> tuple[Array, Array]:
    """Return angle and velocity of an arm, 0 when it hangs down, with a load-dependent contact and a motor torque."""
    gravity = CallablePart(
        "gravity",
        lambda t, inputs, state: [-M * G * L * sin(inputs[0])],
        inputs=[Port("q", unit="rad")],
        outputs=[Port("tau", unit="N.m")],
    )
    parts: list[Part] = [gravity, FmuPart("arm", fmu("Mass", "rotational"))]
    parts += [
        FmuPart("load", fmu("TransmissionLoad", "rotational")),
        FmuPart("friction", fmu("Stribeck", "rotational")),
    ]
    wires = ["arm.x -> gravity.q", "gravity.tau -> arm.F_load", "gravity.tau -> load.F_external", "arm.v -> load.v"]
    wires += [
        "load.Fn -> friction.Fn",
        "arm.v -> friction.v",
        "arm.F_ext -> friction.F_ext",
        "friction.F -> arm.F_friction",
    ]
    start = {f"load.{name}": value for name, value in model.start.items()}
    start |= {"friction.Fs": 1.0, "friction.Fv": model.viscous, "arm.m": M * L**2, "arm.x0": q0, "arm.d": 0.0}
    start |= {"arm.F_drive": torque, "load.F_drive": torque}
    experiment = Experiment(2.0, 1e-3, master="newton", record=("arm.x", "arm.v"))
    with System(parts, wires, start, experiment) as system:
        result = system.run()
    return result["arm.x"].to_numpy(), result["arm.v"].to_numpy()


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_an_arm_stays_where_its_load_holds_it(share: float) -> None:
    """Without motor, friction base + a |gravity| holds the arm as long as it is not below the gravity torque."""
    limit = M * G * L * sin(radians(30.0))
    moved, _ = arm(radians(30.0), Model(share * limit / 2.0, 0.0, load=(0.0, share / 2.0)))
    if share > 1.0:
        np.testing.assert_allclose(moved, radians(30.0), atol=1e-12)
    else:
        assert abs(moved[-1] - radians(30.0)) > radians(1.0)


def test_directions_differ_as_the_two_coefficients() -> None:
    """A motor at rest has to give gravity / (1 - a) to lift, and (1 - a_external) / (1 + a_drive) of it to hold."""
    gravity, model = M * G * L, Model(0.0, 0.0, load=(0.25, 0.1))
    # lifting: T - g = |-g a_external - T a_drive| = g a_external + T a_drive
    lifts = gravity * (1.0 + 0.1) / (1.0 - 0.25)
    drops = gravity * (1.0 - 0.1) / (1.0 + 0.25)
    for torque, moves in ((1.01 * lifts, 1.0), (0.99 * lifts, 0.0), (1.01 * drops, 0.0), (0.99 * drops, -1.0)):
        angle, v = arm(pi / 2.0, model, torque)
        assert np.sign(v[50]) == moves
        assert moves != 0.0 or np.ptp(angle) < 1e-12


W, LEAD, RADIUS = 2000.0, 5e-3, 8e-3  # axial force [N], lead [m] and mean radius [m] of a screw


def screw(mu: float) -> tuple[float, dict[str, float]]:
    """Return the torque of the load on a screw without friction, and its efficiencies."""
    angle, friction = atan(LEAD / (2.0 * pi * RADIUS)), atan(mu)
    efficiencies = {"eta_drive": tan(angle) / tan(angle + friction), "eta_back": tan(angle - friction) / tan(angle)}
    return W * LEAD / (2.0 * pi), efficiencies


def thread(mu: float, v: float) -> float:
    """Return the torque of a square thread under the axial force, from the balance of the forces on the flank."""
    angle, s = atan(LEAD / (2.0 * pi * RADIUS)), copysign(1.0, v)  # v > 0 lifts
    normal = W / (cos(angle) - s * mu * sin(angle))
    return normal * RADIUS * (sin(angle) + s * mu * cos(angle))


@pytest.mark.parametrize("mu", [0.02, 0.08, 0.15])
def test_torques_of_a_screw_from_its_flank(mu: float) -> None:
    torque, efficiencies = screw(mu)
    v = np.array([1.0, -1.0])  # v > 0 lifts: the load drives backward
    found = loads("EfficiencyLoad", efficiencies, v=v, F_load=np.full(2, -torque), F_ext=np.zeros(2))
    expected = [abs(thread(mu, each) - torque) for each in v]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize("mu", [0.08, 0.12])
def test_a_screw_drives_back_unless_its_lead_angle_is_below_the_angle_of_friction(mu: float) -> None:
    torque, efficiencies = screw(mu)
    locks = degrees(atan(LEAD / (2.0 * pi * RADIUS))) < degrees(atan(mu))
    parts = [FmuPart(name, fmu(block, "rotational")) for name, block in BLOCKS.items()]
    wires = ["axis.v -> load.v", "axis.F_ext -> load.F_ext", "load.Fn -> friction.Fn", "axis.v -> friction.v"]
    wires += ["axis.F_ext -> friction.F_ext", "friction.F -> axis.F_friction"]
    start = {
        "load.F_load": -torque,
        "axis.F_load": -torque,
        "axis.F_drive": 0.0,
        "axis.m": 1e-3,
        "axis.d": 0.0,
        "friction.Fs": 1.0,
    }
    start |= {"friction.Fv": 0.0, **{f"load.{name}": value for name, value in efficiencies.items()}}
    experiment = Experiment(0.1, 1e-3, master="newton", record=("axis.v",))
    with System(parts, wires, start, experiment) as system:
        v = system.run()["axis.v"].to_numpy()
    if locks:
        assert not v.any()
    else:  # the torque that friction leaves accelerates the screw
        assert v[-1] == pytest.approx(-torque * efficiencies["eta_back"] / 1e-3 * 0.1, rel=1e-9)


BLOCKS = {"axis": "Mass", "load": "EfficiencyLoad", "friction": "Stribeck"}
