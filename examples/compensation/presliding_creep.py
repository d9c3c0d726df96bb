"""In presliding, an integral creeps to its target without hunting

For small motions a contact is a spring. The integral winds up against it and the axis follows: there is no break-away
and no overshoot, but it takes time, because the contact is much stiffer than Kp. Around a target at 1 mm, the same
gains hunt.

On the curve of first loading, F = Fs (1 - exp(-sigma0 x/Fs)), the balance Kp e + Ki int e = F gives

    de/dt = -Ki e / (Kp + sigma0 exp(-sigma0 x/Fs)),   x = r - e

The axis is 1 kg on LuGre under a PID controller with three poles at 3 Hz without friction; (Kp + sigma0)/Ki is 15 s.
(With the gains of the 1995 paper it is 7 hours.) The full run has cases that the figure does not show: with three
poles at 5 Hz or above, so also with those at 15 Hz of the other scripts, the axis does not hunt on this contact at
all, even at a target of 1 mm, although Fs is 1.5 Fc and the theory of a rigid contact predicts a cycle for all gains.
The error decays in the presliding range.

The hunting was computed independently, with a Runge-Kutta method at 5 µs from sample to sample.

Source: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994 (presliding); Armstrong, Amin, Automatica
32(5), 1996 (hunting on a rigid contact).
"""

from dataclasses import replace
from math import exp, pi
from pathlib import Path

import numpy as np
from scipy.integrate import quad

from _effect import Check, Effect, command_line, near, small
from _loop import BLACK, BLUE, FS, GREEN, RED, Array, panels, run, save

SIGMA0 = 1e5  # of LuGre [N/m]
POLES = 2.0 * pi * 3.0  # [rad/s]
GOALS = {3e-6: BLUE, 10e-6: GREEN, 30e-6: RED}  # [m]
STOP = 30.0  # [s]
FAR, SWING, WAIT = 1e-3, 247.27e-6, 1.7793  # target [m], largest error of the last 10 s [m], period there [s]

SWINGS = {1.0: 2145.13e-6, 2.0: 544.39e-6, 5.0: 0.0, 10.0: 0.0, 15.0: 0.0}  # of the last quarter [m], by poles [Hz]


def under_pid(target: float, poles: float = POLES, stop: float = STOP) -> tuple[Array, Array, Array]:
    """Time, error and velocity after a jump of the target."""
    gains = {"Kp": 3.0 * poles**2, "Kd": 3.0 * poles, "Ki": poles**3, "m": 0.0}
    start = {"reference.offset": target, "reference.amplitude[1]": 0.0}
    result = run("Sine", {"x": ("r", "rd", "rdd")}, stop, start, gains=gains)
    error = (result["reference.r"] - result["mass_x.x"]).to_numpy()
    return result["time"].to_numpy(), error, result["mass_x.v"].to_numpy()


def creeping(target: float, high: float, low: float) -> float:
    """Time in which the error falls from high to low by the equation [s]."""

    def slowness(e: float) -> float:
        return (3.0 * POLES**2 + SIGMA0 * exp(-SIGMA0 * (target - e) / FS)) / (POLES**3 * e)

    return float(quad(slowness, low, high)[0])


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the errors, check the time of the creep and the hunting."""
    figure, (near_by, far) = panels("In presliding, an integral creeps to its target without hunting", 2, 1, (8.0, 5.5))
    checks: list[Check] = []
    for target, colour in GOALS.items():
        t, e, _ = under_pid(target)
        near_by.plot(t[::20], 1e6 * e[::20], color=colour, lw=1.6, label=f"target at {1e6 * target:g} µm")
        # after the first second, when the jump has died out
        begin, end = int(np.searchsorted(t, 1.0)), int(np.argmax(e < 0.4 * target))
        name = f"target at {1e6 * target:g} µm"
        checks.append(
            near(f"{name}: time to 40 % of it", t[end] - t[begin], creeping(target, e[begin], e[end]), 5e-3, "s")
        )
        checks.append(small(f"{name}: overshoot", 1e6 * max(-e.min(), 0.0), 1e-6, "µm"))
        line = np.geomspace(e[begin], e[-1], 40)
        near_by.plot(
            [t[begin] + creeping(target, e[begin], each) for each in line], 1e6 * line, color=BLACK, ls=":", lw=1.2
        )
    near_by.plot([], [], color=BLACK, ls=":", lw=1.2, label="by the equation")

    t, e, v = under_pid(FAR)
    far.plot(t[::20], 1e6 * e[::20], color=RED, lw=1.3, label="target at 1 mm")
    late = t > STOP - 10.0
    swing = float(np.abs(e[late]).max())
    fast = np.abs(v) > 2e-3
    slips = t[1:][fast[1:] & ~fast[:-1]]
    wait = float(np.mean(np.diff(slips[slips > STOP - 10.0])))
    checks.append(near("target at 1 mm: largest error of the last 10 s", 1e6 * swing, 1e6 * SWING, 5e-3, "µm"))
    checks.append(near("target at 1 mm: period", wait, WAIT, 5e-3, "s"))
    if full:
        for hertz, expected in SWINGS.items():
            t, e, _ = under_pid(FAR, 2.0 * pi * hertz)
            left = 1e6 * float(np.abs(e[t > 0.75 * STOP]).max())
            high = small("", left, 0.01, "µm") if expected == 0.0 else near("", left, 1e6 * expected, 5e-3, "µm")
            checks.append(
                replace(high, name=f"poles at {hertz:g} Hz, target at 1 mm: largest error of the last quarter")
            )

    near_by.set(ylabel="error [µm]", ylim=(-3.0, 32.0))
    near_by.legend(loc="upper right", fontsize=9)
    far.set(xlabel="time [s]", ylabel="error [µm]", ylim=(-400.0, 400.0))
    far.legend(loc="upper right", fontsize=9)
    save(figure, __file__, folder)
    return Effect(
        "The axis reaches targets at 3, 10 and 30 µm without overshoot. Around a target at 1 mm it hunts by "
        f"{1e6 * swing:.0f} µm and slips every {wait:.2f} s.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
