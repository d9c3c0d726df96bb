"""An implicit sliding mode does not chatter

A sliding mode needs no friction model, only a bound K of its force. Computed with the sign of this sample, its force
switches between -K and K forever. Computed with the sign that s will have in the next sample, it stops at the force
that friction needs, with the same error.

The law is u = m (rdd + lam (rd - v)) + K sgn(s), with s = (rd - v) + lam (r - x); the implicit one is a saturation,
clip(m s/Ts, -K, K). The axis has LuGre friction on a sine of 5 mm at 1 Hz, sampled at 2 kHz, K = 2 N. Both errors are
near Fc Ts/(m lam), that of the s = F Ts/m at which the implicit law rests, but the input of the explicit law varies
some 800 times as much. A K ten times as large makes its velocity oscillate ten times as much and changes nothing with
the implicit law. In presliding the errors differ: at 5 µm that of the implicit law is a third of the other one, at 50
µm it is 1.6 times as large, because the explicit law shakes the contact loose.

The error of the implicit law is proportional to Ts, that of the super-twisting law, in the split implicit form of this
library, to Ts^2. Solved implicitly in both of its equations at once, as published, super-twisting rests at s = F Ts/m,
too, and is no better than the first order.

Errors and variation of the input were computed independently, with a Runge-Kutta method at steps of 2 µs for the axis
and independent code for the laws.

Source: Acary, Brogliato, Systems and Control Letters 59(5), 2010; Levant, Automatica 34(3), 1998; Brogliato, Polyakov,
Efimov, IEEE TAC 65(8), 2020 (the implicit super-twisting).
"""

from math import pi
from pathlib import Path

import numpy as np

from _effect import Check, Effect, command_line, near
from _loop import BLUE, FC, GREEN, GREY, OMEGA, RED, TS, panels, rms, save
from _servo import error, follow, sines
from harness import CallablePart, Result

LAM, K, RATE = OMEGA, 2.0, 500.0  # [1/s], bound of friction [N], bound of its rate, the L of super-twisting [N/s]
FREQUENCY, SETTLED, STOP = 1.0, 1.0, 3.0  # of the reference [Hz], start and end of the measurement [s]
TIMES = (2.0 * TS, TS, 0.5 * TS)
FIGURES = {  # RMS error [m] and variation of the input per second [N/s], by law, amplitude [m] and sample time [s]
    ("explicit", 5e-3, 5e-4): (5.4495e-6, 4169.3),
    ("implicit", 5e-3, 5e-4): (5.2261e-6, 5.3808),
    ("super-twisting", 5e-3, 5e-4): (4.1038e-8, 5.2538),
    ("explicit", 5e-3, 1e-3): (11.284e-6, 2173.0),
    ("implicit", 5e-3, 1e-3): (10.443e-6, 5.500),
    ("super-twisting", 5e-3, 1e-3): (1.6429e-7, 5.2796),
    ("explicit", 5e-3, 2.5e-4): (2.6694e-6, 8173.4),
    ("implicit", 5e-3, 2.5e-4): (2.6141e-6, 5.3155),
    ("super-twisting", 5e-3, 2.5e-4): (1.0252e-8, 5.2480),
    ("explicit", 5e-4, 5e-4): (5.2804e-6, 4300.4),
    ("implicit", 5e-4, 5e-4): (5.3611e-6, 5.6682),
    ("super-twisting", 5e-4, 5e-4): (3.3931e-8, 5.6838),
    ("explicit", 5e-5, 5e-4): (3.9741e-6, 5795.5),
    ("implicit", 5e-5, 5e-4): (6.3399e-6, 5.8781),
    ("super-twisting", 5e-5, 5e-4): (2.2074e-8, 5.8988),
    ("explicit", 5e-6, 5e-4): (3.4788e-6, 8193.0),
    ("implicit", 5e-6, 5e-4): (1.2081e-6, 1.2941),
    ("super-twisting", 5e-6, 5e-4): (5.2487e-9, 1.9289),
}


def explicit(K: float) -> CallablePart:
    """The sliding mode with the sign of this sample."""

    def law(t: float, u: np.ndarray, x: np.ndarray) -> float:
        r, rd, rdd, position, v = u
        ed = rd - v
        return float(rdd + LAM * ed + K * np.sign(ed + LAM * (r - position)))

    return CallablePart("servo", law, ["r", "rd", "rdd", "x", "v"], ["u"], sampled=True)


def published(Ts: float) -> CallablePart:
    """Super-twisting with implicit steps of both of its equations at once, for 1 kg; its state is w.

    Brogliato, Polyakov, Efimov, IEEE TAC 65(8), 2020.
    """

    def step(u: np.ndarray, w: float) -> tuple[float, float]:
        r, rd, rdd, position, v = u
        ed = rd - v
        s = ed + LAM * (r - position)
        c1, c2, b = 1.5 * np.sqrt(RATE), 1.1 * RATE, s - Ts * w
        if abs(b) <= Ts**2 * c2:  # s of the next sample is 0
            y, after = 0.0, s / Ts
        else:
            y = (np.sqrt((Ts * c1) ** 2 + 4.0 * (abs(b) - Ts**2 * c2)) - Ts * c1) / 2.0
            after = w + Ts * c2 * np.sign(b)
        return float(rdd + LAM * ed + c1 * y * np.sign(b) + after), float(after)

    return CallablePart(
        "servo",
        lambda t, u, x: step(u, x[0])[0],
        ["r", "rd", "rdd", "x", "v"],
        ["u"],
        advance=lambda t, h, u, x: [step(u, x[0])[1]],
        state=[0.0],
        sampled=True,
    )


def run(law: str, A: float, Ts: float = TS, K: float = K) -> Result:
    """The axis under a law on a sine of the amplitude A [m]."""
    blocks = {
        "implicit": ("ImplicitSlidingMode", {"m": 1.0, "lam": LAM, "K": K}),
        "super-twisting": ("ImplicitSuperTwisting", {"m": 1.0, "lam": LAM, "L": RATE, "c1": 1.5, "c2": 1.1}),
    }
    own = published(Ts) if law == "super-twisting as published" else explicit(K)
    controller, settings = blocks.get(law, (own, {}))
    start = {"mass.v0": 2.0 * pi * FREQUENCY * A}
    return follow(controller, settings, sines((A, FREQUENCY, 0.0)), STOP, start=start, Ts=Ts)


def variation(result: Result) -> float:
    """How much the input changes in all, per second [N/s]."""
    u = result["servo.u"].to_numpy()[result["time"].to_numpy() > SETTLED - 1e-9]
    return float(np.abs(np.diff(u)).sum() / (STOP - SETTLED))


def swings(result: Result) -> float:
    """RMS error of the velocity [m/s]."""
    late = result["time"].to_numpy() > SETTLED - 1e-9
    return rms((result["reference.rd"] - result["mass.v"]).to_numpy()[late])


def main(folder: Path, full: bool = False) -> Effect:
    """Draw input and error, check accuracy, variation of the input and the order in Ts."""
    figure, (above, below) = panels("An implicit sliding mode does not chatter", 2, 1, (8.0, 6.0))
    colours = {"explicit": RED, "implicit": BLUE, "super-twisting": GREEN}
    checks: list[Check] = []
    found: dict[tuple[str, float, float], tuple[float, float]] = {}
    for case, (expected, change) in FIGURES.items():
        law, A, Ts = case
        if A != 5e-3 and not full:
            continue
        result = run(law, A, Ts)
        found[case] = error(result, SETTLED), variation(result)
        size = f"{1e6 * A:g} µm" if A < 1e-4 else f"{1e3 * A:g} mm"
        name = f"{size}, Ts = {1e3 * Ts:g} ms, {law}"
        # a switching between two values is not repeatable to more than this
        tolerance = 0.04 if law == "explicit" else 0.005
        checks.append(near(f"{name}: RMS error", 1e9 * found[case][0], 1e9 * expected, tolerance, "nm"))
        checks.append(near(f"{name}: variation of the input", found[case][1], change, tolerance, "N/s"))
        if A == 5e-3 and Ts == TS and law != "super-twisting":
            t, u = (result[column].to_numpy() for column in ("time", "servo.u"))
            shown = (t > 1.22) & (t < 1.29)
            above.plot(1e3 * t[shown], u[shown], color=colours[law], lw=1.6 if law == "implicit" else 0.6, label=law)
            above.lines[-1].set_zorder(3.0 if law == "implicit" else 2.0)
    ms = [1e3 * Ts for Ts in TIMES]
    for law, colour in colours.items():
        errors = [1e9 * found[law, 5e-3, Ts][0] for Ts in TIMES]
        below.loglog(ms, errors, color=colour, marker="o", label=law)
    same = [error(run("super-twisting as published", 5e-3, Ts), SETTLED) for Ts in TIMES]
    below.loglog(ms, [1e9 * each for each in same], color=GREEN, ls="--", marker="x", label="as published")
    rest = [1e9 * FC * Ts / LAM for Ts in TIMES]
    below.loglog(ms, rest, color=GREY, ls=":", label="Fc Ts/(m lam)")
    below.set_xticks(ms, [f"{each:g}" for each in ms])
    below.minorticks_off()
    above.set(ylabel="force [N]", xlabel="time [ms]")
    below.set(ylabel="RMS error [nm]", xlabel="sample time [ms]", ylim=(5.0, 3e5))
    above.legend(fontsize=9, loc="upper right")
    below.legend(fontsize=9, loc="upper left", ncols=5)
    save(figure, __file__, folder)

    (loud, shaken), (calm, quiet), (fine, _) = (found[law, 5e-3, TS] for law in colours)
    half = {law: found[law, 5e-3, 0.5 * TS][0] for law in colours}
    swing = [swings(run("explicit", 5e-3, K=each)) for each in (K, 10.0 * K)]
    tame = error(run("implicit", 5e-3, K=10.0 * K), SETTLED)
    checks += [
        near("5 mm, implicit: error over Fc Ts/(m lam)", calm / (FC * TS / LAM), 1.0, 0.03),
        near("5 mm, super-twisting as published: error over Fc Ts/(m lam)", same[1] / (FC * TS / LAM), 1.0, 0.03),
        Check("5 mm: error of the implicit over the explicit law", calm / loud, "", 0.0, 1.1),
        Check("5 mm: variation of the explicit over the implicit law", shaken / quiet, "", 100.0),
        near("5 mm, implicit: error relative to that at half the sample time", calm / half["implicit"], 2.0, 0.02),
        near(
            "5 mm, super-twisting: error relative to that at half the sample time",
            fine / half["super-twisting"],
            4.0,
            0.02,
        ),
        near(
            "5 mm, explicit: error of the velocity with ten times K relative to that with K",
            swing[1] / swing[0],
            10.0,
            0.05,
        ),
        near("5 mm, implicit: error with ten times K relative to that with K", tame / calm, 1.0, 1e-6),
    ]
    return Effect(
        f"The rms error is {1e6 * loud:.1f} µm with the explicit and {1e6 * calm:.1f} µm with the implicit law, whose "
        f"force varies {shaken / quiet:.0f} times less. Super-twisting leaves {1e9 * fine:.0f} nm, and "
        f"{1e9 * half['super-twisting']:.0f} nm at half the sample time.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
