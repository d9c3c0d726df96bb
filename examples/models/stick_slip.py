"""LuGre shows stick-slip; Dahl cannot

A spring of 2 N/m whose end moves at 0.1 m/s pulls a mass of 1 kg. Stick-slip needs friction that falls with speed. On
LuGre the mass sticks until the spring pulls with 1.5 N, then slips, again and again.

Dahl's model gets the viscous damping of LuGre, 0.4 N s/m, so its oscillation about steady sliding dies out as that of
a linear oscillator. Period and speed of LuGre were computed independently, with an ODE solver at tight tolerances.

Source: Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995, figure 6.
"""

from math import exp, sqrt
from pathlib import Path

import numpy as np

from _common import BLUE, GREY, RED, command_line, panels, save, with_mass

V, k, d = 0.1, 2.0, 0.4  # speed of the support [m/s], spring [N/m], damping [N s/m]
STOP, STEP = 40.0, 1e-3  # [s]
PERIOD, FASTEST = 6.36271982, 0.369816  # of LuGre [s], [m/s]


def main(folder: Path) -> str:
    """Draw both motions, check the period of the one and the end of the other."""
    figure, (speed, spring) = panels("LuGre shows stick-slip; Dahl cannot", 2, 1, (8.0, 5.0))
    v = {}
    for model, colour, damping in (("LuGre", RED, 0.0), ("Dahl", BLUE, d)):
        result = with_mass(model, STOP, STEP, mass={"k": k, "d": damping, "v_support": V})
        t, v[model] = result["time"].to_numpy(), result["mass.v"].to_numpy()
        pull = k * (result["mass.x_support"] - result["mass.x"])
        speed.plot(t, v[model], color=colour, lw=1.4, label=model)
        spring.plot(t, pull, color=colour, lw=1.4, label=model)
    speed.axhline(V, color=GREY, ls="--", lw=1.2, label="support")
    speed.set(ylabel="speed of the mass [m/s]")
    spring.set(ylabel="force of the spring [N]", xlabel="time [s]")
    speed.legend(loc="upper left", fontsize=9)
    save(figure, __file__, folder)

    slips = t[1:][(v["LuGre"][1:] >= 0.5 * V) & (v["LuGre"][:-1] < 0.5 * V)]
    period = float(np.mean(np.diff(slips)))
    assert slips.size == 6 and abs(period - PERIOD) < 2.0 * STEP  # the slips are found to one step
    assert abs(v["LuGre"].max() / FASTEST - 1.0) < 1e-3
    stuck = float(np.mean(np.abs(v["LuGre"][t > 10.0]) < 0.01 * V))
    assert stuck > 0.5  # it takes (1.508 - 0.741) N / (k V) = 3.8 s to wind the spring up again
    # from v = 0 at 1 N, after 5 s, Dahl is the linear oscillator, v - V within this envelope
    rest = np.abs(v["Dahl"][-1000:] - V).max()
    assert rest < V * exp(-0.5 * d * (STOP - 1.0 - 5.0)) / sqrt(1.0 - d**2 / (4.0 * k))
    return (
        f"LuGre sticks for {100 * stuck:.0f} % of the time, with a period of {period:.2f} s. After {STOP:g} s Dahl "
        f"slides steadily at {V:g} m/s, to {100 * rest / V:.2f} %."
    )


if __name__ == "__main__":
    command_line(main)
