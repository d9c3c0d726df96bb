"""A dead-band ends hunting if it is wide enough, and otherwise worsens it

A dead-band stops the integral while the error is small. If a slip ends inside it, the axis comes to rest, with the
error that is left. If the slips only pass through it, the integral is stopped just where it should unwind, and the axis
overshoots more. Here 1 kg moves to a target at 1 m.

The loop is LuGre friction under the PID controller of the 1995 paper, Kp = 3, Ki = 4 and Kd = 6. It hunts by 64 mm
without a dead-band, by 76 mm with one of 40 mm, and rests with one of 100 mm. With hysteresis (db_ratio = 1.5: a
stopped integral stays stopped up to 1.5 db) the band does not chatter, but a band that is too narrow does more harm
than without hysteresis (db_ratio = 1).

The amplitudes were computed independently, with a Runge-Kutta method at 12.5 µs from sample to sample.

Source: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994.
"""

from pathlib import Path

import numpy as np

from _effect import Check, Effect, command_line, near, small
from _loop import BLACK, BLUE, GREEN, GREY, RED, Array, panels, run, save
from hunting import KD, KI, KP

STOP, LATE = 150.0, 110.0  # [s], what counts is after that
SWINGS = {  # largest error at the end [m], by width of the dead-band [m] and db_ratio
    (0.0, 1.5): 63.9207e-3,
    (0.04, 1.5): 76.2537e-3,
    (0.1, 1.5): 138.9817e-3,
    (0.02, 1.0): 64.1098e-3,
    (0.02, 1.5): 66.5275e-3,
    (0.04, 1.0): 65.6221e-3,
    (0.06, 1.0): 70.1496e-3,
    (0.06, 1.5): 94.6211e-3,
    (0.1, 1.0): 98.9568e-3,
}
COLOURS = {(0.0, 1.5): RED, (0.04, 1.5): BLUE, (0.1, 1.5): GREEN}  # of the short run
WIDE = 0.1  # the dead-band that ends the hunting [m]


def errors(width: float, ratio: float) -> tuple[Array, Array]:
    """Time and error of a run with that dead-band."""
    gains = {"Kp": KP, "Ki": KI, "Kd": KD, "m": 0.0, "db": width, "db_ratio": ratio}
    target = {"reference.offset": 1.0, "reference.amplitude[1]": 0.0}
    result = run("Sine", {"x": ("r", "rd", "rdd")}, STOP, target, gains=gains)
    return result["time"].to_numpy(), (result["reference.r"] - result["mass_x.x"]).to_numpy()


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the error with dead-bands, check the amplitudes and the rest."""
    figure, axes = panels("A dead-band ends hunting if it is wide enough, and otherwise worsens it", 3, 1, (8.0, 6.5))
    checks: list[Check] = []
    swings: dict[tuple[float, float], float] = {}
    for case in SWINGS if full else COLOURS:
        width, ratio = case
        t, e = errors(width, ratio)
        late = e[t > LATE]
        swings[case] = float(np.abs(late).max())
        name = f"dead-band of {1e3 * width:g} mm, db_ratio {ratio:g}" if width else "no dead-band"
        checks.append(near(f"{name}: largest error at the end", 1e3 * swings[case], 1e3 * SWINGS[case], 1e-3, "mm"))
        if width == WIDE:
            checks.append(small(f"{name}: motion at the end", 1e6 * float(np.ptp(late)), 0.1, "µm"))
            checks.append(
                Check(f"{name}: remaining error over db_ratio db", swings[case] / (width * ratio), "", 0.0, 1.0)
            )
        else:
            checks.append(Check(f"{name}: motion at the end", 1e3 * float(np.ptp(late)), "mm", 100.0))
        if width not in (0.0, WIDE):
            checks.append(
                Check(
                    f"{name}: amplitude relative to that without a dead-band", swings[case] / swings[0.0, 1.5], "", 1.0
                )
            )
        if case in COLOURS:
            axis = axes[list(COLOURS).index(case)]
            axis.axhspan(-1e3 * width, 1e3 * width, color=GREY, alpha=0.3, lw=0.0)
            axis.axhspan(-1.5e3 * width, 1.5e3 * width, color=GREY, alpha=0.2, lw=0.0)
            axis.axhline(0.0, color=BLACK, lw=0.6)
            axis.plot(t[::20], 1e3 * e[::20], color=COLOURS[case], lw=1.4)
            axis.set_title(
                f"dead-band of {1e3 * width:g} mm (dark), with hysteresis (light)" if width else name, fontsize=10
            )
            axis.set(ylabel="error [mm]", ylim=(-170.0, 170.0))
    axes[2].set(xlabel="time [s]")
    save(figure, __file__, folder)
    plain, narrow, wide = (1e3 * swings[case] for case in COLOURS)
    return Effect(
        f"The axis hunts by {plain:.0f} mm without a dead-band and by {narrow:.0f} mm with one of 40 mm. With one of "
        f"100 mm it rests, {wide:.0f} mm from its target.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
