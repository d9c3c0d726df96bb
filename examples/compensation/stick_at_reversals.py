"""An axis sticks where its reference reverses

At a reversal, friction changes its sign, and the integral of the controller has to find 2 Fc more. Until then the axis
hardly moves, and then it has to catch up. Slow sines (0.16 Hz) keep the axis in its presliding range for long; at 1.6
Hz the change of friction acts as a step, whose response is known.

The axis has LuGre friction under a PID controller with feedforward of the inertia, on a sine of 10 mm. Between
reversals friction is constant and causes no error. At 0.16 Hz the axis stays below a tenth of the Stribeck velocity
for more than twice as long as its reference. At 1.6 Hz friction is a step of 2 Fc for the loop: with all poles at w =
2 pi 15 Hz the error is 2 Fc / m t^2 / 2 exp(-w t), and its peak, 2 / w after the reversal, is 4 Fc / (m w^2 e^2).

The peaks were computed independently, with an ODE solver at tight tolerances from sample to sample.

Source: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994.
"""

from math import e, pi
from pathlib import Path

import numpy as np

from _effect import Check, Effect, command_line, near
from _loop import BLACK, BLUE, FC, GREY, OMEGA, RED, VS, panels, run, save

A = 0.01  # amplitude of the reference [m]
PEAKS = {0.16: 38.190e-6, 1.6: 62.179e-6}  # largest error, by frequency [Hz], [m]
STEP = 4.0 * FC / (OMEGA**2 * e**2)  # the peak of the closed form [m]


def main(folder: Path, full: bool = False) -> Effect:
    """Draw velocity and error around a reversal, check the peaks and how long the axis sticks."""
    figure, axes = panels("An axis sticks where its reference reverses", 2, 2, (9.0, 5.5))
    peaks: dict[float, float] = {}
    stuck: dict[float, float] = {}
    checks: list[Check] = []
    for column, f in enumerate(PEAKS):
        sine = {"reference.amplitude[1]": A, "reference.frequency[1]": f, "reference.phase[1]": pi / 2.0}
        sine["mass_x.x0"] = A
        result = run("Sine", {"x": ("r", "rd", "rdd")}, 2.5 / f, sine)
        free = run("Sine", {"x": ("r", "rd", "rdd")}, 2.5 / f, sine, friction=None)
        t, rd, v = (result[name].to_numpy() for name in ("time", "reference.rd", "mass_x.v"))
        error, ideal = ((each["reference.r"] - each["mass_x.x"]).to_numpy() for each in (result, free))

        settled = t > 0.75 / f
        peaks[f] = float(np.abs(error[settled]).max())
        checks.append(near(f"{f:g} Hz: peak of the error", 1e6 * peaks[f], 1e6 * PEAKS[f], 1e-3, "µm"))
        share = np.abs(ideal[settled]).max() / peaks[f]  # it is the friction
        checks.append(Check(f"{f:g} Hz: error without friction relative to that peak", share, "", 0.0, 0.01))
        between = settled & (np.abs(np.mod(2.0 * f * t + 0.5, 1.0) - 0.5) > 0.3)  # in shares of half a period
        share = np.abs(error[between]).max() / peaks[f]
        checks.append(Check(f"{f:g} Hz: error between reversals relative to that peak", share, "", 0.0, 0.03))

        since = t - 1.0 / f  # of a reversal
        around = np.abs(since) < 0.2 / f
        stuck[f] = float(np.sum(np.abs(v[around]) < 0.1 * VS) / np.sum(np.abs(rd[around]) < 0.1 * VS))

        window = (since > -0.1) & (since < 0.25)
        speed, deviation = axes[column], axes[2 + column]
        speed.plot(1e3 * since[window], 1e3 * rd[window], color=GREY, ls="--", lw=1.2, label="reference")
        speed.plot(1e3 * since[window], 1e3 * v[window], color=RED, lw=1.4, label="axis")
        speed.set_title(f"{f:g} Hz, {1e3 * 2.0 * pi * f * A:.0f} mm/s at most", fontsize=10)
        after = since[window & (since >= 0.0)]
        closed = -FC * after**2 * np.exp(-OMEGA * after)
        deviation.plot(1e3 * since[window], 1e6 * error[window], color=BLUE, lw=1.4, label="error")
        deviation.plot(1e3 * after, 1e6 * closed, color=BLACK, ls=":", lw=1.2, label="of a step of 2 Fc")
        deviation.set(xlabel="time after the reversal [ms]", ylim=(-70.0, 20.0))
    axes[0].set(ylabel="velocity [mm/s]")
    axes[2].set(ylabel="error [µm]")
    axes[0].legend(fontsize=9)
    axes[2].legend(loc="lower right", fontsize=9)
    save(figure, __file__, folder)

    slow, fast = PEAKS
    checks += [
        Check(f"{slow:g} Hz: time of the axis at rest relative to that of the reference", stuck[slow], "", 2.0),
        near(f"{fast:g} Hz: peak relative to that of a step of 2 Fc", peaks[fast] / STEP, 1.0, 0.03),
        Check(f"{slow:g} Hz: peak relative to that of a step of 2 Fc", peaks[slow] / STEP, "", 0.0, 0.7),
    ]
    return Effect(
        f"The error peaks at {1e6 * peaks[slow]:.0f} µm at {slow:g} Hz and {1e6 * peaks[fast]:.0f} µm at {fast:g} Hz, "
        f"where the closed form of a step gives {1e6 * STEP:.0f} µm. At {slow:g} Hz the axis rests {stuck[slow]:.1f} "
        "times as long as its reference.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
