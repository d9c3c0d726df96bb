"""LuGre drifts under a constant force with vibration; ElastoPlastic does not

A mass of 1 kg is pushed by 0.6 N and vibrated by 0.3 N at 1 Hz. The force stays below the Coulomb level of 1 N, yet
with LuGre the mass creeps on with every cycle. ElastoPlastic is purely elastic up to its break-away deflection and
holds the mass.

The break-away deflection z_ba is 9.5 µm, and 0.9 N deflects the contact by 9 µm. The drift of LuGre per cycle was
computed independently, with an ODE solver at tight tolerances.

Source: Dupont, Hayward, Armstrong, Altpeter, IEEE TAC 47(5), 2002.
"""

from math import pi, sin
from pathlib import Path

from _common import BLACK, BLUE, RED, command_line, panels, save, with_mass

STOP, STEP = 21.0, 1e-3  # [s]
DRIFT = 6.088742e-6  # of LuGre [m] per cycle


def push(t: float) -> float:
    """The force [N]: a ramp to the bias, then bias and vibration."""
    return 0.6 * t if t < 1.0 else 0.6 + 0.3 * sin(2.0 * pi * (t - 1.0))


def main(folder: Path) -> str:
    """Draw force and positions, check the drift over ten cycles."""
    figure, (force, position) = panels("LuGre drifts under vibration; ElastoPlastic does not", 2, 1, (8, 5))
    drift = {}
    for model, colour, parameters in (("LuGre", RED, {}), ("ElastoPlastic", BLUE, {"z_ba": 9.5e-6})):
        result = with_mass(model, STOP, STEP, parameters, push=push)
        t, x = result["time"].to_numpy(), result["mass.x"].to_numpy()
        drift[model] = (x[round(21.0 / STEP)] - x[round(11.0 / STEP)]) / 10.0
        position.plot(t, 1e6 * x, color=colour, lw=1.4, label=model)
    force.plot(t, [push(each) for each in t], color=BLACK, lw=1.2, label="applied force")
    force.axhline(1.0, color=RED, ls="--", lw=1.2, label="Coulomb friction")
    force.set(ylabel="force [N]", ylim=(0.0, 1.25))
    position.set(ylabel="position [µm]", xlabel="time [s]")
    for axis in (force, position):
        axis.legend(loc="best", fontsize=9)
    save(figure, __file__, folder)

    assert abs(drift["LuGre"] / DRIFT - 1.0) < 1e-3  # the coupling is of first order in STEP
    assert abs(drift["ElastoPlastic"]) < 1e-18  # m per cycle, rounding
    return f"LuGre drifts by {1e6 * drift['LuGre']:.2f} µm per cycle, ElastoPlastic by less than 1e-18 m."


if __name__ == "__main__":
    command_line(main)
