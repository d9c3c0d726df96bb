"""A LuGre observer in feedback leaves a larger error than feedforward

With the exact model both remove nearly all of the error. The rest is due to sampling: the force is held for a sample
while friction changes. The observer also uses the velocity of the sample before, so its error is several times larger.
The references are sines of 1 Hz.

Feedforward is led by the reference; where the motion is not known in advance, there is no feedforward. The observer
steps its bristle with the velocity of the sample before and feeds the error back. Both errors are proportional to the
sample time; at 50 µm that of the observer falls a little faster. The axis has LuGre friction under a PID controller
with feedforward of the inertia.

The errors were computed independently, with a Runge-Kutta method of steps below a microsecond from sample to sample.

Source: Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995 (the observer); Lampaert, Swevers, Al-Bender,
American Control Conference, 2004 (feedforward).
"""

from pathlib import Path

import numpy as np

from _axis import Block, cosine, error, follow
from _effect import Check, Effect, command_line, near
from _loop import BLUE, GAINS, GREY, RED, panels, rms, save

F, INNER = 1.0, 20  # frequency [Hz], communication steps in a sample
COMPENSATORS: dict[str, dict[str, Block]] = {
    "none": {},
    "feedforward": {"friction_of": ("LuGreFeedforward", {"m": 0.0})},
    "observer": {"friction_of": ("LuGreObserver", {})},
}
RMS = {  # of the error without, with feedforward and with the observer [m], by amplitude [m] and sample time [s]
    (5e-6, 1e-3): (2.000e-6, 6.301e-9, 29.81e-9),
    (5e-6, 5e-4): (1.997e-6, 3.223e-9, 10.86e-9),
    (5e-6, 2.5e-4): (1.996e-6, 1.629e-9, 4.635e-9),
    (5e-5, 1e-3): (10.02e-6, 29.53e-9, 218.7e-9),
    (5e-5, 5e-4): (10.00e-6, 15.08e-9, 86.96e-9),
    (5e-5, 2.5e-4): (9.997e-6, 7.621e-9, 38.09e-9),
    (5e-4, 1e-3): (13.08e-6, 96.19e-9, 560.9e-9),
    (5e-4, 5e-4): (13.03e-6, 48.94e-9, 258.4e-9),
    (5e-4, 2.5e-4): (13.01e-6, 24.68e-9, 123.4e-9),
    (5e-3, 1e-3): (13.66e-6, 119.5e-9, 584.9e-9),
    (5e-3, 5e-4): (13.60e-6, 60.93e-9, 278.5e-9),
    (5e-3, 2.5e-4): (13.56e-6, 30.74e-9, 135.7e-9),
}
SHOWN = (5e-5, 5e-3)  # [m]
COLOURS = {"none": GREY, "feedforward": BLUE, "observer": RED}


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the error over the sample time, check its values and that it is proportional."""
    figure, axes = panels("An observer in feedback leaves several times the error of feedforward", 1, 2, (9.0, 3.8))
    found: dict[tuple[float, float, str], float] = {}
    checks = []
    for (A, Ts), expected in RMS.items():
        if not full and A not in SHOWN:
            continue
        for (name, added), value in zip(COMPENSATORS.items(), expected, strict=True):
            result = follow(
                cosine(A, F),
                ("PID", GAINS),
                2.0 / F,
                added=added,
                mass={"x0": A},
                Ts=Ts,
                inner=round(INNER * Ts / 5e-4),
            )
            found[A, Ts, name] = rms(error(result, 1.0 / F))
            text = f"{1e6 * A:g} µm, {1e3 * Ts:g} ms, {name}: error"
            checks.append(near(text, 1e9 * found[A, Ts, name], 1e9 * value, 0.01, "nm"))
    times = sorted({Ts for _, Ts in RMS})
    for A in sorted({A for A, _, _ in found}):
        size = f"{1e6 * A:g} µm"
        worse = found[A, 5e-4, "observer"] / found[A, 5e-4, "feedforward"]
        checks.append(
            Check(f"{size}, 0.5 ms: error with the observer relative to that with feedforward", worse, "", 3.0)
        )
        with_it = found[A, 5e-4, "feedforward"] / found[A, 5e-4, "none"]
        checks.append(Check(f"{size}, 0.5 ms: error with feedforward / without", with_it, "", 0.0, 0.01))
        for name in ("feedforward", "observer"):
            halved = found[A, 2.5e-4, name] / found[A, 5e-4, name]
            checks.append(Check(f"{size}, {name}: error at 0.25 ms relative to that at 0.5 ms", halved, "", 0.4, 0.52))
    for axis, A in zip(axes, SHOWN, strict=True):
        for name, colour in COLOURS.items():
            values = [1e6 * found[A, Ts, name] for Ts in times]
            axis.loglog([1e3 * Ts for Ts in times], values, "o-", color=colour, lw=1.5, ms=5, label=name)
        line = np.array([found[A, times[-1], "observer"] * Ts / times[-1] for Ts in times])
        axis.loglog(1e3 * np.array(times), 1e6 * line, color=RED, ls=":", lw=1.2, label="proportional")
        axis.set(xlabel="sample time [ms]", ylim=(5e-3, 50.0), xticks=[0.25, 0.5, 1.0])
        axis.set_xticks([], minor=True)
        axis.set_xticklabels(["0.25", "0.5", "1"])
        axis.set_title(f"sine of {1e3 * A:g} mm", fontsize=10)
    axes[0].set(ylabel="error, rms [µm]")
    axes[1].legend(loc=(0.03, 0.52), fontsize=9)
    save(figure, __file__, folder)
    ratios = ", ".join(
        f"{found[A, 5e-4, 'observer'] / found[A, 5e-4, 'feedforward']:.1f} times at {1e3 * A:g} mm" for A in SHOWN
    )
    return Effect(
        f"At a sample time of 0.5 ms the error with the observer is {ratios} that with feedforward. Without "
        f"compensation it is {found[5e-3, 5e-4, 'none'] / found[5e-3, 5e-4, 'observer']:.0f} times that with the "
        "observer at 5 mm.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
