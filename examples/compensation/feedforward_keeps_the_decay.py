"""Feedforward does not change how fast disturbances decay

A feedforward force depends on the reference alone. It changes where the axis goes, but not how the axis returns after a
disturbance: that depends on the poles of the loop. With and without feedforward, the difference of two runs, one with 2
mm/s more at the start, is the same.

The axis has LuGre friction under a PID controller, on a sine of 5 mm at 1 Hz, in its first 0.2 s, where it slides and
Coulomb friction is constant. The model in the feedforward begins at rest and is wrong for the first milliseconds. The
difference of the runs is the free motion of the sampled loop of mass and viscous friction, computed from its matrix.
On an axis with viscous friction only, every feedforward here is wrong, and the difference is still that free motion.

Source: the superposition of linear systems; for friction: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica
30(7), 1994 (compensation without feedback of the friction does not affect stability).
"""

from math import exp, pi
from pathlib import Path

import numpy as np

from _axis import Block, error, follow
from _effect import Effect, command_line, small
from _loop import BLACK, BLUE, FC, GAINS, RED, TS, Array, panels, save

A, F, KICK = 0.005, 1.0, 0.002  # amplitude [m], frequency [Hz], additional velocity at the start [m/s]
START = 2.0 * pi * F * A  # velocity of the reference at the start [m/s]
STOP = 0.2  # [s]
SIGMA0, SIGMA2 = 1e5, 0.4  # of the friction model [N/m], [N s/m]
SINE = ("Sine", {"amplitude[1]": A, "frequency[1]": F})
FRICTION: dict[str, Block] = {
    "viscous friction": ("Viscous", {"Fv": SIGMA2}),
    "LuGre": ("LuGre", {"z": FC / SIGMA0}),  # slides already
}


def free_motion(n: int) -> Array:
    """Position of the sampled loop with viscous friction after the kick, in n samples."""
    a = exp(-SIGMA2 * TS)  # of the velocity in a sample
    moved = (1.0 - a) / SIGMA2
    pushed = np.array([(TS - moved) / SIGMA2, moved])  # position and velocity, for 1 N
    state, integral = np.array([0.0, KICK]), 0.0
    positions = []
    for _ in range(n):
        positions.append(state[0])
        force = -GAINS["Kp"] * state[0] - GAINS["Kd"] * state[1] + GAINS["Ki"] * integral
        integral -= TS * state[0]
        state = np.array([state[0] + moved * state[1], a * state[1]]) + pushed * force
    return np.array(positions)


def pair(friction: Block, added: str | None) -> tuple[Array, Array]:
    """Error of the run with the velocity of the reference, and what the other one differs by in position [m]."""
    compensators = {"forward": (added, {"m": 0.0})} if added else {}
    runs = [
        follow(SINE, ("PID", GAINS), STOP, added=compensators, friction=friction, mass={"v0": start}, inner=4)
        for start in (START, START + KICK)
    ]
    straight, kicked = (each["mass.x"].to_numpy() for each in runs)
    return error(runs[0], -1.0), kicked - straight


def main(folder: Path, full: bool = False) -> Effect:
    """Draw errors and differences, check them against the free motion."""
    figure, axes = panels("Feedforward does not change how fast disturbances decay", 1, 2, (9.0, 3.8))
    free = free_motion(round(STOP / TS) + 1)
    peak = np.abs(free).max()
    t = 1e3 * TS * np.arange(free.size)
    checks = []
    differences = {}
    forward = ("LuGreFeedforward", "StaticFeedforward", "GMSFeedforward") if full else ("LuGreFeedforward",)
    for plant, friction in FRICTION.items():
        for added in (None, *forward):
            straight, difference = pair(friction, added)
            name = f"{plant}, {added or 'no feedforward'}"
            share = float(np.abs(difference - free).max() / peak)
            most = 1e-5 if plant == "LuGre" else 1e-6
            checks.append(small(f"{name}: difference from the free motion over its peak", share, most))
            differences[name] = difference
            if plant == "LuGre" and added in (None, "LuGreFeedforward"):
                colour, width, label = (BLUE, 3.0, "feedforward") if added else (RED, 1.4, "none")
                axes[0].plot(t, 1e6 * straight, color=colour, lw=1.5, label=label)
                axes[1].semilogy(t, 1e6 * np.abs(difference), color=colour, lw=width, label=label, zorder=5.0 - width)
    axes[0].set(xlabel="time [ms]", ylabel="error [µm]")
    axes[0].set_title("without the additional velocity", fontsize=10)
    axes[1].semilogy(t, 1e6 * np.abs(free), color=BLACK, ls=":", lw=1.6, label="free motion", zorder=6)
    axes[1].set(xlabel="time [ms]", ylabel="|difference| [µm]", ylim=(1e-5, 30.0))
    axes[1].set_title("difference that 2 mm/s at the start makes", fontsize=10)
    for axis in axes:
        axis.legend(fontsize=9)
    save(figure, __file__, folder)

    with_it, without = differences["LuGre, LuGreFeedforward"], differences["LuGre, no feedforward"]
    share = float(np.abs(with_it - without).max() / peak)
    checks.append(small("LuGre: change by the feedforward over the peak", share, 1e-5))
    return Effect(
        f"The additional velocity moves the axis by {1e6 * peak:.1f} µm, and feedforward of the friction changes this "
        "motion by less than 1e-5 of it.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
