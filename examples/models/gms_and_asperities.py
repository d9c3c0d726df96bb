"""GMS agrees qualitatively with a population of asperities

GMS and the asperity model GenericAsperity share five properties, of which LuGre lacks the first two. Both stay in
place under a constant force with vibration and return to a reversal point; friction falls late after a step of the
speed; the break-away force falls with the rate at which it is applied; a mass on a spring sticks and slips.

The asperities return to the reversal point only nearly, because their contacts grow stronger with time. Their
parameters are the start values, but there are more of them and each is counted in part. For the lag, GMS has ten times
the attraction C of the start values and no viscous friction. Nothing is fitted: the agreement is qualitative.

Source: Al-Bender, Lampaert, Swevers, IEEE TAC 50(11), 2005, and Tribology Letters 16, 2004.
"""

from math import pi, sin
from pathlib import Path
from typing import Any

import numpy as np

from _common import BLUE, GREEN, GREY, Array, along, command_line, panels, polyline, save, with_mass

Values = dict[str, dict[str, float]]
# many asperities with the start values, each counted in part so that they are as strong as the 20 that it starts with
PARAMETERS: Values = {"GMS": {}, "GenericAsperity": {"N": 200, "Fn0": 10.0}, "LuGre": {}}
OF_LAG: Values = {"GMS": {"C": 1000.0, "sigma2": 0.0}, "GenericAsperity": {"N": 800, "Fn0": 40.0}}
STYLE: dict[str, dict[str, Any]] = {
    "GMS": {"color": BLUE},
    "GenericAsperity": {"color": GREEN},
    "LuGre": {"color": GREY, "ls": "--"},
}
BEFORE = 5000  # steps before the step of the speed
SPEEDS = np.array([1e-6, 1e-5, 1e-4, 1e-3, 1e-2])  # of loading [m/s]


def drift(model: str) -> tuple[Array, Array]:
    """Position [m] over time [s] under 0.6 N with a vibration of 0.3 N at 1 Hz."""
    result = with_mass(
        model, 11.0, 1e-3, PARAMETERS[model], push=lambda t: 0.6 * t if t < 1.0 else 0.6 + 0.3 * sin(2.0 * pi * t)
    )
    return result["time"].to_numpy(), result["mass.x"].to_numpy()


def memory(model: str) -> tuple[Array, Array]:
    """Position [m] and force [N] on a path to 20 µm with an inner loop from 15 µm back to 0, 20 nm a step."""
    x = polyline([0.0, 15e-6, 0.0, 15e-6, 20e-6], 1e-6, 0.02)
    return x, along(model, x, 0.02, PARAMETERS[model])["friction.F"].to_numpy()


def lag(model: str) -> tuple[Array, Array]:
    """Path [m] since a step of the speed from 1 to 100 mm/s, and force [N]."""
    step = 2e-5
    v = np.concatenate([np.full(BEFORE, 1e-3), np.full(150, 0.1)])
    x = np.cumsum([0.0, *v]) * step
    F = along(model, x, step, OF_LAG[model])["friction.F"].to_numpy()
    return x - x[BEFORE], F


def break_away(model: str) -> tuple[Array, Array]:
    """Speed of loading [m/s] and peak of the force [N] from rest."""
    x = np.linspace(0.0, 8e-5, 801)
    return SPEEDS, np.array([float(along(model, x, x[1] / v, PARAMETERS[model])["friction.F"].max()) for v in SPEEDS])


def stick_slip(model: str) -> tuple[Array, Array]:
    """Time [s] and force [N] of a spring of 200 N/m that pulls 1 kg at 10 mm/s."""
    result = with_mass(model, 3.0, 2e-4, PARAMETERS[model], mass={"k": 200.0, "v_support": 0.01})
    return result["time"].to_numpy(), 200.0 * (result["mass.x_support"] - result["mass.x"]).to_numpy()


def main(folder: Path) -> str:
    """Draw and check the five properties."""
    figure, axes = panels("GMS agrees qualitatively with a population of asperities", 2, 3, (10.0, 6.0))
    with_lugre, without = ("LuGre", "GenericAsperity", "GMS"), ("GenericAsperity", "GMS")
    rows = [
        (drift, with_lugre, "no drift", "time [s]", 1.0, "position [µm]", 1e6),
        (memory, with_lugre, "memory", "position [µm]", 1e6, "friction [N]", 1.0),
        (lag, without, "frictional lag", "path since a step of the speed [µm]", 1e6, "friction [N]", 1.0),
        (break_away, without, "break-away", "speed of loading [m/s]", 1.0, "peak of friction [N]", 1.0),
        (stick_slip, without, "stick-slip", "time [s]", 1.0, "spring force [N]", 1.0),
    ]
    found = {}
    for axis, (run, models, title, xlabel, x_scale, ylabel, y_scale) in zip(axes, rows, strict=False):
        for model in models:
            x, y = found[run, model] = run(model)
            marker = "o" if run is break_away else None
            axis.plot(x_scale * x, y_scale * y, lw=1.4, marker=marker, label=model, **STYLE[model])
        axis.set(title=title, xlabel=xlabel, ylabel=ylabel)
    axes[2].set(xlim=(-50.0, 250.0), ylim=(0.4, 1.3))
    axes[3].set_xscale("log")
    axes[5].axis("off")
    axes[5].legend(*axes[0].get_legend_handles_labels(), loc="center", fontsize=11)
    save(figure, __file__, folder)

    # after the drift of the first cycles, in which contacts find their place, over five cycles
    per_cycle = {m: abs(found[drift, m][1][11_000] - found[drift, m][1][6_000]) / 5.0 for m in with_lugre}
    assert max(per_cycle[m] for m in without) < 0.01 * per_cycle["LuGre"]
    # at 15 µm before and after the inner loop
    miss = {m: abs(1.0 - found[memory, m][1][2250] / found[memory, m][1][750]) for m in with_lugre}
    assert max(miss[m] for m in without) < 0.05 < 0.2 < miss["LuGre"]
    for m in without:
        F = found[lag, m][1]
        before, early, later = F[3000:BEFORE].mean(), F[BEFORE + 1 : BEFORE + 4].mean(), F[BEFORE + 75 :].mean()
        assert later < 0.95 * before and early > 0.5 * (before + later)  # early: after 2 to 6 µm
        peaks = found[break_away, m][1]
        assert np.all(np.diff(peaks) < 0.0) and peaks[-1] < 0.9 * peaks[0]
        late = found[stick_slip, m][1][6_000:]
        stuck = np.mean(np.diff(late) > 0.9 * 200.0 * 0.01 * 2e-4)  # where the force grows as if the mass stood
        assert np.ptp(late) > 0.5 and 0.4 < stuck < 0.9
    return (
        f"Drift per cycle: LuGre {1e6 * per_cycle['LuGre']:.1f} µm, GMS and the asperities below a hundredth of that. "
        f"Error at the reversal point: LuGre {100 * miss['LuGre']:.0f} %, GMS and the asperities below 5 %."
    )


if __name__ == "__main__":
    command_line(main)
