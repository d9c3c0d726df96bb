"""Correcting a friction observer by the position error needs enough damping

A LuGre observer can be corrected by the position error with a gain k. The loop is stable for every k if sigma1 Kd >=
sigma0 m, here Kd >= 316 N s/m. Three poles at 20 Hz satisfy this, and a larger k reduces the error. At 15 and 10 Hz
the damping is too small, and the error grows by orders of magnitude beyond the limit at rest (dashed).

The condition makes the path through the correction positive real. Poles at 20 Hz have Kd = 377 N s/m, at 15 Hz 283, at
10 Hz 188. At rest no bristle slips, and the error of the bristle is the integral of k e. The loop then has the poles
of m s^3 + Kd s^2 + (Kp + k sigma1) s + Ki + k sigma0: stable, by Routh, below k = (Kd Kp - m Ki)/(m sigma0 - Kd
sigma1), which is 49 / s for 10 Hz and 632 / s for 15 Hz. In motion bristles slip, and the error of their estimate
decays by itself: with a sine of 0.5 mm the loop of 10 Hz becomes worse only between 300 and 1000 / s and that of 15 Hz
does not up to there; with 5 mm neither does.

The figure shows the tracking error of an axis with LuGre friction and an observer with its exact parameters, over k,
for a sine of 1 Hz and 50 µm, under a PID controller with feedforward of the inertia.
The condition gives the same verdict on the three loops.

The errors were computed independently, with a Runge-Kutta method of steps of 1.7 µs from sample to sample.

Source: Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995 (the observer and positive realness); the
condition in these parameters and the largest k at rest are derived here.
"""

from itertools import pairwise
from math import pi
from pathlib import Path

from _axis import cosine, error, follow
from _effect import Check, Effect, command_line, near
from _loop import BLUE, GREEN, RED, panels, rms, save

F, M, INNER = 1.0, 1.0, 5  # frequency [Hz], mass [kg], communication steps in a sample
SIGMA0, SIGMA1 = 1e5, 316.22776601683796  # of plant and observer [N/m, N s/m]
K = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)  # [1/s]
RMS = {  # of the error at each k [nm], by amplitude [m] and frequency of the three poles [Hz]
    (5e-5, 10.0): (271.1, 218.6, 155.4, 74.94, 30.09, 1603.0, 2522.0, 2685.0),
    (5e-5, 15.0): (86.96, 80.14, 69.15, 46.29, 23.47, 8.623, 3.186, 1365.0),
    (5e-5, 20.0): (37.77, 36.36, 33.83, 27.16, 17.24, 7.505, 2.878, 0.921),
    (5e-6, 10.0): (36.55, 26.67, 17.3, 7.75, 3.014, 1258.0, 2499.0, 2671.0),
    (5e-6, 15.0): (10.86, 9.771, 8.137, 5.134, 2.502, 0.8965, 0.3184, 1350.0),
    (5e-6, 20.0): (4.582, 4.375, 4.012, 3.11, 1.895, 0.8017, 0.3029, 0.09551),
    (5e-4, 10.0): (607.3, 567.6, 498.5, 337.4, 163.7, 55.32, 29.75, 145.8),
    (5e-4, 15.0): (258.4, 249.3, 232.6, 186.4, 114.2, 44.69, 15.96, 7.485),
    (5e-4, 20.0): (132.0, 129.2, 124.0, 108.2, 77.95, 37.34, 14.37, 4.537),
    (5e-3, 10.0): (530.1, 523.7, 511.2, 471.4, 383.8, 231.0, 107.3, 29.29),
    (5e-3, 15.0): (278.5, 276.7, 273.0, 260.8, 230.5, 161.8, 83.86, 25.31),
    (5e-3, 20.0): (173.0, 172.2, 170.7, 165.5, 152.2, 117.3, 67.73, 22.8),
}
SHOWN = 5e-5  # [m]
SLOW = 5e-5  # largest amplitude that is as good as rest [m]
COLOURS = {10.0: RED, 15.0: BLUE, 20.0: GREEN}


def gains(hertz: float) -> dict[str, float]:
    """The PID with three poles there, and feedforward of the inertia."""
    w = 2.0 * pi * hertz
    return {"Kp": 3.0 * M * w**2, "Kd": 3.0 * M * w, "Ki": M * w**3, "m": M}


def largest(Kp: float, Kd: float, Ki: float) -> float:
    """The k up to which the loop at rest is stable, where there is one [1/s]."""
    return (Kd * Kp - M * Ki) / (M * SIGMA0 - Kd * SIGMA1)


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the error over k, check its values, where it turns, and the condition."""
    figure, (axis,) = panels("The correction helps at any gain k only with Kd above 316 N s/m", 1, 1, (7.0, 4.2))
    checks = []
    found = {}
    for (A, hertz), expected in RMS.items():
        if not full and A != SHOWN:
            continue
        loop, of = gains(hertz), f"{1e6 * A:g} µm, {hertz:g} Hz"
        errors = []
        for k, value in zip(K, expected, strict=True):
            observer = {"observer": ("LuGreObserver", {"k": k})}
            result = follow(cosine(A, F), ("PID", loop), 2.0 / F, added=observer, mass={"x0": A}, inner=INNER)
            errors.append(1e9 * rms(error(result, 1.0 / F)))
            checks.append(near(f"{of}, k = {k:g} / s: error", errors[-1], value, 0.02, "nm"))
        found[A, hertz] = errors
        best = errors.index(min(errors))
        holds = SIGMA1 * loop["Kd"] >= SIGMA0 * M and SIGMA0 * loop["Kp"] >= SIGMA1 * loop["Ki"]
        worst = max(after / before for before, after in pairwise(errors))
        text = f"{of}: largest ratio of an error to that of the k below"
        if holds:
            checks.append(Check(f"{text} (condition holds)", worst, "", 0.0, 1.0))
        elif A <= SLOW:
            checks.append(Check(f"{text} (condition violated)", worst, "", 10.0))
            highest = largest(loop["Kp"], loop["Kd"], loop["Ki"])
            checks.append(Check(f"{of}: largest k at rest, as the error turns", highest, "1/s", *K[best : best + 2]))
        else:
            checks.append(Check(f"{text} (condition violated, in motion)", worst))
        if A == SHOWN:
            axis.loglog([k or 0.3 for k in K], errors, "o-", color=COLOURS[hertz], lw=1.5, ms=5)
            label = f"{hertz:g} Hz, Kd = {loop['Kd']:.0f} N s/m"
            axis.plot([], [], "o-", color=COLOURS[hertz], label=label)
            if not holds:
                axis.axvline(largest(loop["Kp"], loop["Kd"], loop["Ki"]), color=COLOURS[hertz], ls="--", lw=1.2)
    axis.set(xlabel="gain of the injection k [1/s]", ylabel="error, rms [nm]", ylim=(0.5, 2e4))
    axis.set_xticks([0.3, 1.0, 10.0, 100.0, 1000.0], ["0", "1", "10", "100", "1000"])
    axis.legend(loc="upper left", fontsize=9)
    save(figure, __file__, folder)
    ten, fifteen, twenty = (found[SHOWN, hertz] for hertz in COLOURS)
    return Effect(
        f"As k rises from 0 to 1000 / s, the error falls from {twenty[0]:.0f} to {twenty[-1]:.1f} nm with poles at 20 "
        f"Hz. At 15 Hz it falls from {fifteen[0]:.0f} to {min(fifteen):.1f} nm and then rises to {fifteen[-1]:.0f} "
        f"nm, at 10 Hz from {ten[0]:.0f} to {min(ten):.0f} nm and then to {ten[-1]:.0f} nm.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
