"""Repetitive control removes periodic errors, including quadrant glitches

On a circle that is run again and again, friction repeats with every revolution. A repetitive controller adds the force
that the error of the last period called for. It needs no friction model. Shown are the error and the sum of the
amplitudes of its harmonics below 100 Hz.

The correction goes through the inverse of the loop and a low-pass Q. Below the corner of Q each harmonic of the error
shrinks by 1 - rate in a period; harmonics near the corner, where Q is not 1, remain. The axis has GMS friction on a
circle of 10 mm radius at 105 mm/s, a revolution in 0.6 s, under a cascade of position and velocity loop with
feedforward of the inertia. It learns for 16 revolutions.

Source: Hara, Yamamoto, Omata, Nakano, IEEE Trans. Automatic Control 33(7), 1988; Jamaludin, Van Brussel, Swevers, IEEE
Trans. Industrial Electronics 56(10), 2009 (on quadrant glitches).
"""

from math import cos, pi
from pathlib import Path

import numpy as np

from _axis import error, follow
from _effect import Check, Effect, command_line
from _loop import BLACK, BLUE, GREY, OMEGA, RED, TS, Array, panels, rms, save

RADIUS, START, PERIOD = 10e-3, pi / 4.0, 0.6  # [m], [rad], [s]
M = 1.0  # mass [kg]
CASCADE = {"kp": OMEGA / 2.0, "kv": 3.0 * M * OMEGA, "ki": 1.5 * M * OMEGA**2, "m": M}
KP, KD, KI = 3.0 * M * OMEGA**2, 3.0 * M * OMEGA, 0.75 * M * OMEGA**3  # the same loop as a PID
FQ, HALF = 100.0, 64  # corner of Q [Hz], samples that it looks back and ahead
FIRST, LEARNT = 2, 18  # the first revolution at full speed, and 16 more
RATES = (0.0, 0.5, 1.0)
COLOURS = {0.0: GREY, 0.5: BLUE, 1.0: RED}


def errors(rate: float, inner: int = 1) -> Array:
    """Error in each revolution [m], shape (revolutions, samples)."""
    N = round(PERIOD / TS)
    circle = {"radius": RADIUS, "feed": 2.0 * pi * RADIUS / PERIOD, "start_angle": START, "t_ramp": 2.0 * PERIOD}
    learning = {"m": M, "Kp": KP, "Kd": KD, "Ki": KI, "N": N, "M": HALF, "fq": FQ, "rate": rate}
    result = follow(
        ("Circle", circle),
        ("CascadePPI", CASCADE),
        (LEARNT + 1) * PERIOD,
        added={"repetitive": ("RepetitiveController", learning)},
        friction=("GMS", {}),
        mass={"x0": RADIUS * cos(START)},
        outputs=("x", "xd", "xdd"),
        inner=inner,
    )
    return error(result, -1.0, "reference.x")[: (LEARNT + 1) * N].reshape(-1, N)


def harmonics(revolution: Array) -> float:
    """Sum of the amplitudes of the harmonics below the corner of Q [m]."""
    amplitudes = 2.0 * np.abs(np.fft.rfft(revolution)) / revolution.size
    return float(amplitudes[1 : int(FQ * PERIOD)].sum())


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the error before and after, and the harmonics over the revolutions; check how they shrink."""
    figure, axes = panels("Repetitive control removes the error that repeats", 1, 2, (9.0, 3.8))
    checks = []
    found = {}
    for rate in RATES:
        found[rate] = errors(rate)
        sums = [1e6 * harmonics(revolution) for revolution in found[rate]]
        axes[1].semilogy(
            range(FIRST, LEARNT + 1), sums[FIRST:], "o-", color=COLOURS[rate], lw=1.5, ms=4, label=f"rate {rate:g}"
        )
        of = f"rate {rate:g}: sum of harmonics"
        left = sums[LEARNT] / sums[FIRST]
        if not rate:
            checks.append(Check(f"{of}, after 16 revolutions over before", left, "", 0.99, 1.01))
            continue
        checks.append(Check(f"{of}, after 16 revolutions over before", left, "", 0.0, 0.1))
        checks.append(Check(f"{of} at the end", 1e3 * sums[LEARNT], "nm"))
    slow = [harmonics(revolution) for revolution in found[0.5][FIRST:]]
    checks += [
        Check(
            f"rate 0.5: sum of harmonics, revolution {i + 1} of learning relative to the one before",
            ratio,
            "",
            0.47,
            0.53,
        )
        for i, ratio in enumerate(slow[i + 1] / slow[i] for i in range(5))
    ]
    if full:
        finer = errors(0.5, inner=10)
        change = harmonics(finer[LEARNT]) / harmonics(found[0.5][LEARNT])
        text = "rate 0.5: harmonics at the end, with ten communication steps in a sample over with one"
        checks.append(Check(text, change, "", 0.97, 1.03))
    angle = 360.0 * np.arange(found[0.5].shape[1]) / found[0.5].shape[1]
    axes[0].plot(angle, 1e6 * found[0.5][FIRST], color=BLACK, lw=1.2, label="before")
    axes[0].plot(angle, 1e6 * found[0.5][LEARNT], color=BLUE, lw=1.6, label="16 revolutions later")
    axes[0].set(xlabel="angle from the start of the revolution [°]", ylabel="error [µm]", xticks=range(0, 361, 90))
    axes[0].legend(loc="upper right", fontsize=9)
    axes[1].set(xlabel="revolution", ylabel="harmonics below 100 Hz, sum [µm]", xticks=range(2, 19, 4))
    axes[1].legend(fontsize=9)
    save(figure, __file__, folder)
    return Effect(
        f"At a rate of 0.5, 16 revolutions reduce the harmonics below {FQ:.0f} Hz from {1e6 * slow[0]:.0f} to "
        f"{1e6 * slow[-1]:.2f} µm and the rms error from {1e6 * rms(found[0.5][FIRST]):.0f} µm to "
        f"{1e9 * rms(found[0.5][LEARNT]):.0f} nm.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
