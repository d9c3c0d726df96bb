"""Resetting the integral at a reversal shortens hunting but does not end it

When the axis reverses, the integral that pushed it there pushes in the wrong direction. With a reset it winds up from
zero and the axis waits for less time. But it starts from the same value after each slip, so the axis slips again, and
as far. The figure shows 1 kg on its way to a goal at 1 m, with the reset and without.

The loop is LuGre friction under the PID controller of the 1995 paper, Kp = 3, Ki = 4 and Kd = 6. The amplitude is 64
mm with and without the reset, the period 15.4 s instead of 24.4 s. Here the contact springs back at the end of a slip,
at some 0.1 mm/s, and this counts as a reversal. With a threshold v_zc of 10 mm/s the PID controller does not see it
and resets the integral only when the axis has broken away in the new direction. That removes the force, the axis stops
again and waits a second time, and the period is longer than without a reset, 34.7 s.

Periods and amplitudes were computed independently, with a Runge-Kutta method at 12.5 µs from sample to sample.

Source: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from _effect import Check, Effect, command_line, near
from _loop import BLUE, GREEN, RED, panels, run, save
from hunting import KD, KI, KP

STOP, LATE = 150.0, 60.0  # [s], what counts is after that


class Case(NamedTuple):
    """Parameters of the PID, and what the independent computation found."""

    reversal: float
    v_zc: float  # [m/s]
    period: float  # of the cycle [s]
    swing: float  # largest error [m]


CASES: Mapping[str, Case] = {
    "no reset": Case(1.0, 0.0, 24.4315, 63.9207e-3),
    "reset": Case(0.0, 1e-5, 15.4360, 63.9207e-3),
    "reset, v_zc = 10 mm/s": Case(0.0, 1e-2, 34.6618, 63.9826e-3),
}
COLOURS = (RED, BLUE, GREEN)


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the error and the integral, check the periods and amplitudes."""
    figure, (above, middle, below) = panels(
        "A reset of the integral shortens hunting and does not end it", 3, 1, (8.0, 6.5)
    )
    periods: dict[str, float] = {}
    swings: dict[str, float] = {}
    checks: list[Check] = []
    for (name, case), colour in zip(CASES.items(), COLOURS, strict=True):
        gains = {"Kp": KP, "Ki": KI, "Kd": KD, "m": 0.0, "reversal": case.reversal, "v_zc": case.v_zc}
        goal = {"reference.offset": 1.0, "reference.amplitude[1]": 0.0}
        result = run("Sine", {"x": ("r", "rd", "rdd")}, STOP, goal, gains=gains)
        t, u = result["time"].to_numpy(), result["pid_x.u"].to_numpy()
        e = (result["reference.r"] - result["mass_x.x"]).to_numpy()
        turns = t[1:][np.sign(e[1:]) != np.sign(e[:-1])]  # where the error passes zero
        periods[name] = 2.0 * float(np.mean(np.diff(turns[turns > LATE])))
        swings[name] = float(np.abs(e[t > LATE]).max())
        checks.append(near(f"{name}: period", periods[name], case.period, 5e-3, "s"))
        checks.append(near(f"{name}: largest error at the end", 1e3 * swings[name], 1e3 * case.swing, 1e-3, "mm"))
        shown = t > LATE
        axis = below if name.endswith("mm/s") else above
        axis.plot(t[shown][::20], 1e3 * e[shown][::20], color=colour, lw=1.4, label=name)
        if axis is above:
            middle.plot(t[shown][::20], u[shown][::20], color=colour, lw=1.4, label=name)
    checks.append(Check("period with reset over that without", periods["reset"] / periods["no reset"], "", 0.0, 0.8))
    checks.append(near("swing with reset over that without", swings["reset"] / swings["no reset"], 1.0, 0.01))
    for axis in (above, below):
        axis.set(ylabel="error [mm]", ylim=(-80.0, 120.0))
        axis.legend(loc="upper right", ncols=2, fontsize=9)
    middle.set(ylabel="u [N]")
    below.set(xlabel="time [s]")
    save(figure, __file__, folder)
    return Effect(
        f"The period is {periods['no reset']:.1f} s without a reset and {periods['reset']:.1f} s with it, the "
        f"amplitude {1e3 * swings['no reset']:.1f} mm and {1e3 * swings['reset']:.1f} mm.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
