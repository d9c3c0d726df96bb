"""Friction feedforward with load halves the error of an arm that constant friction leaves

An arm of 1 kg at 0.3 m swings by 60 degrees every four seconds. Its gear has a constant friction of 0.1 N m and one of
15 % of the torque that it transmits. A PID controller at 1 kHz follows the reference, with the torque of gravity and of
inertia as feedforward. The friction of a feedforward is the model itself, fed with the reference: at the mean of its
friction, or behind `TransmissionLoad` with the torques of the reference.

Source: Duclusaud, Passault, Padois, Ly, IEEE International Conference on Robotics and Automation, 2025 (load).
"""

from __future__ import annotations

from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from _common import BLUE, GREEN, GREY, RED, Array, command_line, panels, save
from friction_fmus import build
from harness import FmuPart, System

M, L, GRAVITY = 1.0, 0.3, 9.81  # [kg], [m], [m/s2]
INERTIA, TORQUE = M * L**2, M * L * GRAVITY
BASE, SHARE, VISCOUS = 0.1, 0.15, 0.05  # friction [N m], over torque, [N m s/rad]
SWING, PERIOD = pi / 3.0, 4.0  # amplitude [rad], [s]
FREQUENCY = 6.0  # bandwidth of the controller [Hz]


def errors(friction: str) -> tuple[Array, Array]:
    """Time [s] and error of the arm [degree] with this friction in the feedforward: none, constant or load."""
    blocks = {"reference": "Sine", "servo": "PID", "arm": "Mass", "gravity": "Cogging", "load": "TransmissionLoad"}
    blocks |= {"friction": "Stribeck", "known_gravity": "Cogging", "known_load": "TransmissionLoad"}
    blocks |= {"known_friction": "Stribeck", "known_torque": "Sum", "forward": "Sum"}
    wires = ["reference.r -> servo.r", "reference.rd -> servo.rd", "arm.x -> servo.x", "arm.v -> servo.v"]
    wires += ["servo.u -> arm.F_drive", "arm.x -> gravity.x", "gravity.F -> arm.F_load", "arm.v -> friction.v"]
    wires += ["arm.F_ext -> friction.F_ext", "friction.F -> arm.F_friction", "arm.v -> load.v"]
    wires += ["servo.u -> load.F_drive", "gravity.F -> load.F_external", "load.Fn -> friction.Fn"]
    # the same with the reference: gravity and inertia are what the motor has to give
    wires += [
        "reference.r -> known_gravity.x",
        "known_gravity.F -> known_torque.u1",
        "reference.rdd -> known_torque.u2",
    ]
    wires += [
        "reference.rd -> known_friction.v",
        "reference.rd -> known_load.v",
        "known_torque.y -> known_load.F_drive",
    ]
    wires += ["known_gravity.F -> known_load.F_external", "known_load.Fn -> known_friction.Fn"]
    wires += ["known_torque.y -> forward.u1", "known_friction.F -> forward.u2", "forward.y -> servo.f"]
    w = 2.0 * pi * FREQUENCY
    start = {"servo.Kp": INERTIA * w**2, "servo.Kd": 1.4 * INERTIA * w, "servo.Ki": 0.0, "servo.Ts": 1e-3}
    start |= {"servo.u_min": -50.0, "servo.u_max": 50.0, "servo.rdd": 0.0, "arm.m": INERTIA, "arm.x0": 0.0}
    start |= {
        "reference.amplitude[1]": SWING,
        "reference.frequency[1]": 1.0 / PERIOD,
        "arm.v0": 2.0 * pi * SWING / PERIOD,
    }
    for part in ("gravity", "known_gravity"):
        start |= {f"{part}.pitch": 2.0 * pi, f"{part}.amplitude[1]": -TORQUE}
    for part, share in (("load", SHARE), ("known_load", SHARE if friction == "load" else 0.0)):
        mean = BASE + (2.0 * SHARE * TORQUE * 0.5 if part == "known_load" and friction == "constant" else 0.0)
        start |= {f"{part}.base": mean, f"{part}.a_drive": share, f"{part}.a_external": share}
    for part in ("friction", "known_friction"):
        start |= {f"{part}.Fc": 1.0, f"{part}.Fs": 1.0, f"{part}.Fv": VISCOUS}
    start |= {"known_torque.gain[1]": -1.0, "known_torque.gain[2]": INERTIA, "known_friction.F_ext": 0.0}
    start |= {"forward.gain[1]": 1.0, "forward.gain[2]": float(friction != "none")}
    with TemporaryDirectory() as folder:
        parts = [FmuPart(name, build(block, Path(folder), domain="rotational")) for name, block in blocks.items()]
        with System(parts, wires, start) as system:
            run = system.run(stop=2.0 * PERIOD, step=1e-3, master="newton")
    late = run["time"].to_numpy() > PERIOD
    error = np.degrees(run["reference.r"].to_numpy() - run["arm.x"].to_numpy())
    return run["time"].to_numpy()[late] - PERIOD, error[late]


def main(folder: Path) -> str:
    """Draw the errors with each feedforward, check their order."""
    cases = (
        ("gravity and inertia", RED, "none"),
        ("and constant friction", BLUE, "constant"),
        ("and friction under load", GREEN, "load"),
    )
    figure, (axis,) = panels("Error of an arm with each feedforward", 1, 1, (8.0, 3.6))
    rms = {}
    for name, colour, friction in cases:
        t, error = errors(friction)
        axis.plot(t, error, color=colour, lw=1.5, label=name)
        rms[name] = float(np.sqrt(np.mean(error**2)))
    axis.axhline(0.0, color=GREY, lw=0.8)
    axis.set(xlabel="time [s]", ylabel="error [degree]")
    axis.legend()
    save(figure, __file__, folder)
    none, constant, load = rms.values()
    assert load < 0.5 * constant < 0.25 * none
    return (
        f"The error is {none:.3g} degrees rms with gravity and inertia, {constant:.3g} with constant friction at its "
        f"mean and {load:.2g} with friction under load."
    )


if __name__ == "__main__":
    command_line(main)
