"""LuGre forgets reversal points; MaxwellSlip and GMS remember them

On a path to 20 µm with an inner loop back to 0, MaxwellSlip and GMS close the inner loop at the reversal point and
continue as if there had been no inner loop. LuGre misses the point, and so does Dahl's model: rate independence is not
memory.

The path is followed at 1 µm/s. At constant speed LuGre is linear in the path, so the miss is known: (1 - q) ((1 + q) F
- (1 - q) g), with q = exp(-a sigma0 / g), for an inner loop of the length a that begins at the force F. Dahl's model is
LuGre with a constant g = Fc and misses by the same formula.

Source: Lampaert, Swevers, Al-Bender, IEEE TAC 47(4), 2002; Al-Bender, Lampaert, Swevers, IEEE TAC 50(11), 2005.
"""

from math import exp
from pathlib import Path

import numpy as np

from _common import BLACK, BLUE, GREY, RED, along, command_line, panels, polyline, save

SPEED, STEP = 1e-6, 0.01  # [m/s], [s]: 10 nm a step; so slow that g(v) is Fs and sigma1 v 0.3 mN
TURN, BACK, END = 20e-6, 0.0, 30e-6  # [m]
TO_TURN, DETOUR = 2000, 4000  # [steps]
G = {"Dahl": 1.0, "LuGre": 1.5}  # of the models that forget [N]


def known_miss(g: float) -> float:
    """Return by how much the force [N] misses that of the reversal point, from rest."""
    q, reached = exp(-(TURN - BACK) * 1e5 / g), g * (1.0 - exp(-TURN * 1e5 / g))
    return (1.0 - q) * ((1.0 + q) * reached - (1.0 - q) * g)


def main(folder: Path) -> str:
    """Draw the inner loops and check where they end."""
    figure, axes = panels("LuGre forgets reversal points; MaxwellSlip and GMS remember them", 2, 2, (8.0, 6.4))
    x = polyline([0.0, TURN, BACK, TURN, END], SPEED, STEP)
    x_straight = polyline([0.0, END], SPEED, STEP)
    miss, beyond = {}, {}
    for axis, model in zip(axes, ("LuGre", "Dahl", "MaxwellSlip", "GMS"), strict=True):
        F = along(model, x, STEP)["friction.F"].to_numpy()
        straight = along(model, x_straight, STEP)["friction.F"].to_numpy()
        miss[model] = F[TO_TURN] - F[TO_TURN + DETOUR]
        beyond[model] = np.abs(F[TO_TURN + DETOUR :] - straight[TO_TURN:]).max()
        axis.plot(1e6 * x_straight, straight, color=GREY, lw=4.0, alpha=0.6, label="without inner loop")
        axis.plot(1e6 * x, F, color=RED if model in G else BLUE, lw=1.4, label="with inner loop")
        axis.plot(1e6 * TURN, F[TO_TURN], "o", color=BLACK, ms=6, label="reversal point")
        axis.set(title=model, xlabel="position [µm]", ylabel="friction force [N]", ylim=(-0.9, 1.5))
        axis.legend(loc="lower right", fontsize=9)
    save(figure, __file__, folder)

    for model, g in G.items():
        assert abs(miss[model] - known_miss(g)) < 1e-3  # N, sigma1 v and more
    for model in ("MaxwellSlip", "GMS"):
        assert abs(miss[model]) < 1e-12 and beyond[model] < 1e-12  # N, rounding
    return (
        f"After the inner loop LuGre is {miss['LuGre']:.3f} N and Dahl {miss['Dahl']:.3f} N below the reversal point; "
        "MaxwellSlip and GMS pass it, and then follow the curve without inner loop, to 1e-12 N."
    )


if __name__ == "__main__":
    command_line(main)
