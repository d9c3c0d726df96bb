"""Adaptation compensates a change of the load

Friction is proportional to the normal force, which rises by half at 4 s here. AdaptiveLuGre learns the factor theta
from the tracking error: one second after the step the error is nearly as small as before. Without adaptation it stays
many times larger. The axis follows a sine of 5 mm at 1 Hz.

The law has the exact parameters of the friction before the step, and Gamma = 4000 1/(N m). Theta goes to 1.5 as two
poles say, s^2 + Ks/m s + Gamma Fn^2/m = 0 at a bristle force of Fn = 1 N: 90 % of the way takes 0.1 s. The error after
the step is 1.5 times the error before, as friction is: what remains is the error of sampling.

The adaptation learns from motion. In presliding the bristle force is a part of Fc, and the time constant Ks/(Gamma
Fn^2) grows with its square: on a sine of 5 µm theta has covered only two thirds of the way after three seconds, and
the error is still 30 times the error before. The law ANDFC measures the position only and has three factors, for
stiffness, damping and viscous friction; the load changes the first two. It learns more slowly: one second after the
step its error is 13 times the error before at 5 mm, and 3 times at 50 µm; without adaptation it would be 205 and 1110
times.

The errors were computed independently, with a Runge-Kutta method at steps of 2 µs for the axis and independent code
for the laws.

Source: Canudas de Wit, Lischinsky, Int. J. Adaptive Control and Signal Processing 11, 1997; Tan, Kanellakopoulos,
American Control Conference, 1999 (ANDFC).
"""

from math import pi
from pathlib import Path

import numpy as np

from _effect import Check, Effect, command_line, near
from _loop import BLACK, BLUE, OMEGA, RED, Array, panels, save
from _servo import error, follow, sines
from harness import Result, SeriesPart

LAM, KS, GAMMA = OMEGA, 2.0 * OMEGA, 4000.0  # [1/s], [N s/m], [1/(N m)]
FREQUENCY, STEP_AT, STOP = 1.0, 4.0, 7.0  # of the reference [Hz], of the load [s], of the run [s]
INNER = 5  # steps of the axis in a sample
LAWS = {
    "adaptive": ("AdaptiveLuGre", {"Gamma": GAMMA}),
    "fixed": ("AdaptiveLuGre", {"Gamma": 0.0}),
    "ANDFC": ("ANDFC", {"wo": 1000.0, "k0": 0.02, "k1": 0.5, "Gamma0": 2000.0, "Gamma1": 20.0, "Gamma2": 20.0}),
    "ANDFC, fixed": ("ANDFC", {"wo": 1000.0, "k0": 0.0, "k1": 0.0, "Gamma0": 0.0, "Gamma1": 0.0, "Gamma2": 0.0}),
}
ERRORS = {  # RMS error before the step [m], and that from 1 s after it on over it
    ("adaptive", 5e-3): (0.3113e-6, 1.5387),
    ("fixed", 5e-3): (0.3256e-6, 83.96),
    ("adaptive", 5e-4): (0.3809e-6, 1.5626),
    ("fixed", 5e-4): (0.3848e-6, 73.23),
    ("adaptive", 5e-5): (0.3017e-6, 1.6796),
    ("fixed", 5e-5): (0.3248e-6, 74.71),
    ("adaptive", 5e-6): (0.0712e-6, 31.09),
    ("fixed", 5e-6): (0.0794e-6, 33.46),
    ("ANDFC", 5e-3): (0.2104e-6, 13.108),
    ("ANDFC, fixed", 5e-3): (0.1998e-6, 205.4),
    ("ANDFC", 5e-4): (0.1116e-6, 5.690),
    ("ANDFC, fixed", 5e-4): (0.1347e-6, 378.2),
    ("ANDFC", 5e-5): (0.0219e-6, 3.242),
    ("ANDFC, fixed", 5e-5): (0.0220e-6, 1113.5),
}
SHOWN = {("adaptive", 5e-3): BLUE, ("fixed", 5e-3): RED}  # in the figure


def run(law: str, A: float) -> Result:
    """The axis on a sine of the amplitude A [m], with the step of the load."""
    block, settings = LAWS[law]
    times = np.array([0.0, STEP_AT, STOP + 1.0])
    load = SeriesPart("load", times, {"Fn": np.array([1.0, 1.5, 1.5])}, {"Fn": "N"}, interpolation="previous")
    return follow(
        block,
        {"m": 1.0, "lam": LAM, "Ks": KS, **settings},
        sines((A, FREQUENCY, 0.0)),
        STOP,
        start={"mass.v0": 2.0 * pi * FREQUENCY * A},
        others=[load],
        wires=["load.Fn -> friction.Fn"],
        inner=INNER,
    )


def learned(since: Array) -> Array:
    """Theta, a time after the step, in motion in one direction."""
    fast, slow = np.roots([1.0, KS, GAMMA])
    return np.asarray(1.5 - 0.5 * (fast * np.exp(slow * since) - slow * np.exp(fast * since)) / (fast - slow))


def main(folder: Path, full: bool = False) -> Effect:
    """Draw error and theta around the step, check the errors and the rate of learning."""
    figure, (above, below) = panels("Adaptation compensates a change of the load", 2, 1, (8.0, 5.5))
    checks: list[Check] = []
    kept: dict[str, float] = {}
    for law, A in ERRORS if full else SHOWN:
        result = run(law, A)
        before, after = error(result, 2.0, STEP_AT), error(result, STEP_AT + 1.0)
        expected, ratio = ERRORS[law, A]
        size = f"{1e6 * A:g} µm" if A < 1e-4 else f"{1e3 * A:g} mm"
        checks += [
            near(f"{size}, {law}: RMS error before the step", 1e6 * before, 1e6 * expected, 0.02, "µm"),
            near(f"{size}, {law}: error one second after the step over before", after / before, ratio, 0.02),
        ]
        if (law, A) in SHOWN:
            kept[law] = after / before
            t, theta = (result[name].to_numpy() for name in ("time", "servo.theta"))
            shown = (t > STEP_AT - 0.5) & (t < STEP_AT + 1.5)
            deviation = 1e6 * (result["reference.r"] - result["mass.x"]).to_numpy()
            above.plot(t[shown], deviation[shown], color=SHOWN[law, A], lw=1.4, label=law)
            below.plot(t[shown], theta[shown], color=SHOWN[law, A], lw=1.6, label=law)
            if law == "adaptive":
                at = int(np.searchsorted(t, STEP_AT + 0.05))
                way = float(learned(t[at] - STEP_AT))
                checks.append(near(f"{size}: theta 50 ms after the step", float(theta[at]), way, 0.005))
                checks.append(near(f"{size}: theta at the end", float(theta[-1]), 1.5, 0.005))
    checks.append(Check("5 mm: error back within 2 of before", kept["adaptive"], "", 0.0, 2.0))
    checks.append(Check("5 mm: without adaptation more than 30", kept["fixed"], "", 30.0))
    turn = t[(t >= STEP_AT) & (t < STEP_AT + 0.25 / FREQUENCY)]
    below.plot(turn, learned(turn - STEP_AT), color=BLACK, ls=":", lw=1.6, label="of the two poles")
    above.set(ylabel="error [µm]")
    below.set(ylabel="theta", xlabel="time [s]")
    above.legend(fontsize=9, loc="upper left")
    below.legend(fontsize=9, loc="center right")
    save(figure, __file__, folder)

    return Effect(
        f"One second after the step the error is {kept['adaptive']:.2f} times the error before it, and without "
        f"adaptation {kept['fixed']:.0f} times.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
