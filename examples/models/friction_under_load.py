"""Friction under load holds an arm at any angle or at none; constant friction holds it near the bottom

An arm of 0.49 kg at 0.1 m is put to 20, 60 and 100 degrees and let go. Constant friction of half of the largest torque
of gravity holds it up to 30 degrees. Behind a worm gear, friction grows with the torque of gravity: with an efficiency
of back-driving below zero the worm is self-locking, and the arm stays wherever it is put; with 0.2 it comes down.

On the way down, the worm leaves 0.2 of the torque of gravity, and on the way up behind the bottom it takes 1/0.4 of it
(efficiency of driving 0.4). By the balance of energy, the arm turns at the angle b with (1 - cos b)/0.4 = 0.2 (1 - cos
a), if it was let go at a.

Source: Budynas, Nisbett, Shigley's Mechanical Engineering Design, 2015 (efficiencies, self-locking).
"""

from math import acos, cos, degrees, radians, sin
from pathlib import Path
from tempfile import TemporaryDirectory

from _common import BLUE, GREEN, RED, Array, command_line, panels, save
from friction_fmus import build
from harness import CallablePart, FmuPart, Port, System

M, L, GRAVITY = 0.49, 0.1, 9.81  # [kg], [m], [m/s2]
TORQUE = M * L * GRAVITY  # largest torque of gravity [N m]
DRIVING = 0.4  # efficiency of motion against the load
ANGLES = (20.0, 60.0, 100.0)  # [degree]


def let_go(angle: float, back: float | None) -> tuple[Array, Array]:
    """Time [s] and angle [degree] of the arm with this efficiency of back-driving, or with constant friction."""
    pull = CallablePart(
        "gravity",
        lambda t, u, x: [-TORQUE * sin(u[0])],
        inputs=[Port("q", "rad")],
        outputs=[Port("tau", "N.m")],
    )
    wires = ["arm.x -> gravity.q", "gravity.tau -> arm.F_load", "arm.v -> friction.v", "arm.F_ext -> friction.F_ext"]
    wires += ["friction.F -> arm.F_friction"]
    start = {"arm.m": M * L**2, "arm.x0": radians(angle), "arm.F_drive": 0.0, "friction.Fv": 0.0}
    level = 1.0 if back is not None else 0.5 * TORQUE
    start |= {"friction.Fc": level, "friction.Fs": level}
    blocks = {"arm": "Mass", "friction": "Stribeck"}
    if back is not None:
        blocks["load"] = "EfficiencyLoad"
        wires += ["gravity.tau -> load.F_load", "arm.v -> load.v", "arm.F_ext -> load.F_ext", "load.Fn -> friction.Fn"]
        start |= {"load.eta_drive": DRIVING, "load.eta_back": back}
    with TemporaryDirectory() as folder:
        parts = [pull, *(FmuPart(n, build(m, Path(folder), domain="rotational")) for n, m in blocks.items())]
        with System(parts, wires, start) as system:
            run = system.run(stop=1.5, step=1e-3, master="newton")
    return run["time"].to_numpy(), run["arm.x"].to_numpy() * degrees(1.0)


def main(folder: Path) -> str:
    """Draw the arm with each friction, check where it stays and where it turns."""
    figure, axes = panels("Friction under load holds an arm at any angle or at none", 1, 3, (9.0, 3.6))
    cases = (("constant friction", None), ("self-locking worm", -0.1), ("worm, back-driving efficiency 0.2", 0.2))
    turns = {}
    for axis, (title, back) in zip(axes, cases, strict=True):
        for angle, colour in zip(ANGLES, (GREEN, BLUE, RED), strict=True):
            t, q = let_go(angle, back)
            axis.plot(t, q, color=colour, lw=1.5)
            stays = bool(abs(q - angle).max() < 1e-9)
            assert stays == (angle < 30.0 if back is None else back < 0.0)
            turns[back, angle] = -float(q.min()), float(q[q.argmin() :].max())
        axis.set(xlabel="time [s]", ylabel="angle [degree]", ylim=(-60.0, 110.0))
        axis.set_title(title, fontsize=10)
    save(figure, __file__, folder)

    for angle in ANGLES:
        turn = angle
        for found in turns[0.2, angle]:  # behind the bottom, and back
            turn = degrees(acos(1.0 - 0.2 * DRIVING * (1.0 - cos(radians(turn)))))
            assert abs(found - turn) < 0.05
    return (
        "Constant friction of half of the largest torque holds the arm at 20 degrees only, the self-locking worm at "
        "each angle. The other worm lets it go at each angle; from 100 degrees it turns "
        f"{turns[0.2, 100.0][0]:.1f} degrees behind the bottom."
    )


if __name__ == "__main__":
    command_line(main)
