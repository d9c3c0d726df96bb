"""Dither smooths the jump of friction at zero velocity

A contact that is vibrated fast while it moves slowly reverses many times. Its mean friction is then a slope over the
slow velocity instead of a jump from -Fc to Fc. Left: Coulomb friction with three waveforms and the slopes that
integration gives. Right: a mass under a constant force that friction would hold; shaken, it creeps at the predicted
velocity.

At the velocity v0 + A w, with a waveform w of the amplitude 1 and |v0| < A, the mean of Coulomb friction is

    sine:      (2 Fc/pi) asin(v0/A)
    triangle:  Fc v0/A
    square:    0

On the right a mass of 1 kg with Coulomb friction (KarnoppMass, Fs = Fc = 1 N) is vibrated by a sine of 50 N at 200 Hz,
which makes A = 40 mm/s. Under the constant force F it creeps at the velocity at which the mean friction is F, v0 = A
sin(pi F/(2 Fc)).

Source: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994; the means follow by integration.
"""

from collections.abc import Callable, Mapping
from math import asin, pi
from pathlib import Path

import numpy as np

from _effect import Check, Effect, command_line
from _loop import BLACK, BLUE, FC, GREEN, GREY, RED, panels, save, simulate
from _shaker import SINE, SQUARE, TRIANGLE, mean_forces

A, STROKE = 0.04, 32e-6  # amplitude of the velocity [m/s], A/(2 pi f) [m]; Coulomb friction does not depend on them
RATIOS = (-0.9, -0.5, -0.2, 0.0, 0.1, 0.3, 0.5, 0.7, 0.95)
SAMPLES = 10_000  # of a period: a reversal is found to 1e-4 of it
MEANS: Mapping[str, tuple[float, Callable[[float], float], str]] = {
    "sine": (SINE, lambda ratio: 2.0 * FC / pi * asin(ratio), RED),
    "triangle": (TRIANGLE, lambda ratio: FC * ratio, BLUE),
    "square": (SQUARE, lambda ratio: 0.0, GREEN),
}
AD, FREQUENCY, TS = 50.0, 200.0, 1e-5  # of the force on the mass [N], [Hz], sample time [s]
PUSHES = (0.2, 0.5, 0.8)  # constant force over Fc


def creep(push: float, shaken: bool, frequency: float = FREQUENCY) -> float:
    """Mean velocity of the mass under a constant force [m/s]."""
    period = 1.0 / frequency
    settling, counted = 100, 20  # periods
    start = {"dither.f": push * FC, "dither.Ad": AD if shaken else 0.0, "dither.frequency": frequency, "dither.Ts": TS}
    # the velocity that the sine alone has at its start
    start |= {"mass.v0": -AD / (2.0 * pi * frequency) if shaken else 0.0, "mass.Fs": FC, "mass.Fc": FC}
    start |= {"mass.Fv": 0.0, "mass.DV": 1e-6}
    models = {"dither": "Dither", "mass": "KarnoppMass"}
    result = simulate(models, ["dither.u -> mass.F_ext"], start, (settling + counted) * period, step=TS)
    x = result["mass.x"].to_numpy()
    way = x[-1] - x[-1 - round(counted * period / TS)]
    return float(way) / (counted * period)


def main(folder: Path, full: bool = False) -> Effect:
    """Draw mean friction over velocity and velocity over force, check them against the laws."""
    figure, (means, speeds) = panels("Dither smooths the jump of friction at zero velocity", 1, 2, (9.0, 4.2))
    checks: list[Check] = []
    line = np.linspace(-1.0, 1.0, 201)
    means.step([-1.3, 0.0, 1.3], [-FC, -FC, FC], color=GREY, lw=1.0, ls="--", label="without")
    for name, (shape, law, colour) in MEANS.items():
        found = mean_forces("Coulomb", RATIOS, [STROKE], A, {"Fc": FC, "F_ext": 0.0}, shape=shape, samples=SAMPLES)
        off = max(abs(force - law(ratio)) for (ratio, _), force in found.items()) / FC
        checks.append(Check(f"{name}: largest deviation of the mean force from the law over Fc", off, "", 0.0, 5e-4))
        means.plot(line, [law(each) for each in line], color=colour, lw=1.0)
        means.plot(RATIOS, list(found.values()), color=colour, ls="", marker="o", ms=5, label=name)

    deviations = []
    for frequency in (FREQUENCY, 50.0, 500.0) if full else (FREQUENCY,):
        amplitude = AD / (2.0 * pi * frequency)
        found_speeds = {push: creep(push, True, frequency) / amplitude for push in PUSHES}
        off = max(abs(speed - np.sin(0.5 * pi * push)) for push, speed in found_speeds.items())
        deviations.append(off)
        checks.append(
            Check(f"mass, {frequency:g} Hz: largest deviation of its velocity from the law over A", off, "", 0.0, 1e-3)
        )
        if frequency == FREQUENCY:
            speeds.plot(PUSHES, list(found_speeds.values()), color=RED, ls="", marker="o", ms=6, label="shaken")
    still = [abs(creep(push, False)) for push in PUSHES]
    checks.append(Check("mass without dither: velocity", max(still), "m/s", 0.0, 0.0))
    line = np.linspace(0.0, 1.0, 101)
    speeds.plot(line, np.sin(0.5 * pi * line), color=RED, lw=1.0, label="law")
    speeds.plot(PUSHES, still, color=BLACK, ls="", marker="x", ms=6, label="without dither")
    means.set(xlabel="v0 / A", ylabel="mean friction [N]", xlim=(-1.3, 1.3))
    speeds.set(xlabel="constant force / Fc", ylabel="mean velocity / A")
    means.legend(fontsize=9, title="dots: Coulomb, lines: laws", title_fontsize=9)
    speeds.legend(fontsize=9)
    save(figure, __file__, folder)
    return Effect(
        f"The means agree with their closed forms to {max(c.value for c in checks[:3]):.4f} Fc, the velocity of the "
        f"shaken mass to {deviations[0]:.4f} A. Without dither the mass does not move.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
