"""Friction causes a glitch at each quadrant of a circle

Where one axis of two reverses, its friction changes sign and the contour leaves the circle. The faster the feed, the
higher the glitch. Feedforward of the static friction curve removes the glitches at 100 mm/s and makes them worse at 2
mm/s: it changes sign at the reversal, but real friction needs some 10 µm to do so.

The figure shows the radial deviation of two axes with LuGre friction on a circle of 10 mm, over the angle; without
friction it would be a line at zero. The faster the feed, the more the change of friction is a step for the loop, and
the glitch grows up to that of a step of 2 Fc. The feedforward has the exact parameters. At 10 mm/s it turns the
glitches to the inside.

The peaks of the error of one axis were computed independently, with an ODE solver at tight tolerances from sample to
sample.

Source: Jamaludin, Van Brussel, Swevers, IEEE Transactions on Industrial Electronics 56(10), 2009 (quadrant glitches).
"""

from math import cos, e, pi, sin
from pathlib import Path

import numpy as np

from _effect import Check, Effect, command_line
from _loop import BLUE, FC, GREY, OMEGA, RED, panels, run, save

R, BEGIN = 0.01, pi / 4.0  # radius [m], angle at which the motion begins [rad]
TURNS, SETTLED = 1.35, 0.3  # whole run, and where the pulse of its start is gone
PEAKS = {  # largest error of the x axis without and with feedforward [m], by feed [m/s]
    0.002: (11.997e-6, 22.626e-6),
    0.01: (38.087e-6, 23.107e-6),
    0.1: (62.156e-6, 2.605e-6),
}
AXES = {"x": ("x", "xd", "xdd"), "y": ("y", "yd", "ydd")}


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the deviation over a turn for three feeds, check the peaks and where they are."""
    figure, axes = panels("Friction causes a glitch at each quadrant of a circle", 3, 1, (8.0, 7.0))
    heights: dict[float, list[float]] = {}
    checks: list[Check] = []
    for axis, feed in zip(axes, PEAKS, strict=True):
        turn = 2.0 * pi * R / feed  # [s]
        circle = {"reference.radius": R, "reference.feed": feed, "reference.start_angle": BEGIN}
        circle |= {"reference.t_ramp": 0.1 * turn, "mass_x.x0": R * cos(BEGIN), "mass_y.x0": R * sin(BEGIN)}
        heights[feed] = []
        for added, colour, label in ((None, RED, "PID"), ("StaticFeedforward", BLUE, "and static feedforward")):
            result = run("Circle", AXES, TURNS * turn, circle, compensator=added, tuned={"m": 0.0} if added else {})
            t, angle, x, y = (result[name].to_numpy() for name in ("time", "reference.angle", "mass_x.x", "mass_y.x"))
            settled = t > SETTLED * turn
            error = np.abs((result["reference.x"] - result["mass_x.x"]).to_numpy()[settled]).max()
            peak = 1e6 * PEAKS[feed][added is not None]
            checks.append(
                Check(f"{1e3 * feed:g} mm/s, {label}: peak of the error", 1e6 * error, "µm", peak - 0.05, peak + 0.05)
            )

            outside = np.hypot(x, y) - R
            heights[feed].append(float(np.abs(outside[settled]).max()))
            quadrants = angle[settled] / (0.5 * pi)
            axis.plot(quadrants, 1e6 * outside[settled], color=colour, lw=1.3, label=label)
            if not added:
                # one glitch to the outside after each end of a quadrant, and none elsewhere
                high = quadrants[outside[settled] > 0.5 * heights[feed][0]]
                assert set(np.floor(high)) == {2.0, 3.0, 4.0, 5.0}
        axis.axhline(0.0, color=GREY, lw=0.8)
        axis.set(ylabel="deviation [µm]", xlim=(1.7, 5.8), ylim=(-30.0, 70.0), xticks=[2, 3, 4, 5])
        axis.set_title(f"{1e3 * feed:g} mm/s", fontsize=10)
    axes[0].legend(loc="upper right", fontsize=9)
    axes[2].set(xlabel="angle [quadrants]")
    save(figure, __file__, folder)

    slow, middle, fast = heights.values()
    step = 4.0 * FC / (OMEGA**2 * e**2)
    assert slow[0] < middle[0] < fast[0]
    checks += [
        Check("100 mm/s, PID: deviation relative to that of a step of 2 Fc", fast[0] / step, "", 0.9, 1.03),
        Check("2 mm/s: deviation with feedforward / without", slow[1] / slow[0], "", 1.0),
        Check("10 mm/s: deviation with feedforward / without", middle[1] / middle[0], "", 0.4, 1.0),
        Check("100 mm/s: deviation with feedforward / without", fast[1] / fast[0], "", 0.0, 0.1),
    ]
    numbers = "; ".join(
        f"{1e6 * without:.0f} µm at {1e3 * feed:g} mm/s, with feedforward {1e6 * with_it:.0f} µm"
        for feed, (without, with_it) in heights.items()
    )
    return Effect(f"Largest radial deviation: {numbers}.", tuple(checks))


if __name__ == "__main__":
    command_line(main)
