"""Over-compensation causes a limit cycle

Friction that is computed from the measured velocity and fed back removes damping. If it exceeds the real friction by
enough, it drives the axis. Released at 50 mm/s, the axis comes to rest for gains up to 1.1; from 1.2 on it oscillates,
with an amplitude that grows with the gain and agrees with the harmonic balance.

The axis is 1 kg on LuGre friction with Fs = Fc = 1 N and 0.4 N s/m under a PD controller of Kp = 400 N/m and Kd = 10 N
s/m; the fed-back friction is straight up to vt = 5 mm/s. The harmonic balance sets the excess of Coulomb friction
against the damping that is left: the velocity has the amplitude V = 4 (gain - 1) Fc/(pi (Kd + (1 - gain) Fv)) for V
far above vt. Where V is only a few vt, the straight part weakens the excess until there is no cycle: so a gain of 1.1
does no harm here. Fs = 1.5 Fc, which the law does not know, does not change the amplitude. At the gains of the other
effects, three poles at 15 Hz, Kd is enough for any gain up to 2.

A narrow vt is worse. At rest on its bristles the axis is damped by Kd + sigma1 + Fv and driven by gain (Fc/vt + Fv).
With vt = 1 mm/s the second is larger from a gain of 0.33 on, and the axis oscillates within the presliding range at
some mm/s, although less than all of the friction is compensated.

The amplitudes were computed independently, with a Runge-Kutta method at steps of 5 µs for the axis and independent
code for the laws.

Source: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994 (over-compensation); Gelb, Vander Velde:
Multiple-Input Describing Functions, McGraw-Hill 1968 (the balance).
"""

from math import asin, pi, sqrt
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from _effect import Check, Effect, command_line, near, small
from _loop import BLACK, BLUE, GAINS, GREEN, GREY, RED, panels, save
from _servo import follow
from harness import Result

KP, KD = 400.0, 10.0  # [N/m], [N s/m]
FC, FV, SIGMA1 = 1.0, 0.4, 316.22776601683796  # of the axis [N], [N s/m], [N s/m]
VT, NARROW = 5e-3, 1e-3  # up to which the sign is a straight line [m/s]
V0, SETTLED, STOP = 0.05, 4.0, 6.0  # first velocity [m/s], start and end of the measurement [s]
REST = 1e-7  # velocity below which the axis rests [m/s]
SWINGS = {0.5: 0.0, 0.9: 0.0, 1.0: 0.0, 1.1: 0.0, 1.2: 25.23e-3, 1.3: 38.78e-3, 1.5: 65.66e-3, 2.0: 134.5e-3}
"""Velocity amplitude [m/s] by gain."""
TREMBLING = {0.5: 1.494e-3, 0.9: 2.538e-3}  # that with the narrow vt [m/s]
STILL = {"amplitude[1]": 0.0}


def run(gain: float, vt: float = VT, Kp: float = KP, Kd: float = KD, Fs: float = FC) -> Result:
    """The axis, released at V0, with gain times its friction in feedback."""
    return follow(
        "PID",
        {"Kp": Kp, "Kd": Kd, "Ki": 0.0, "m": 0.0},
        STILL,
        STOP,
        addition=("StaticFeedback", {"Fc": gain * FC, "Fs": gain * FC, "Fv": gain * FV, "vt": vt}),
        start={"friction.Fs": Fs, "mass.v0": V0},
    )


def swing(result: Result) -> float:
    """Return the velocity amplitude at the end [m/s]."""
    return float(np.ptp(result["mass.v"].to_numpy()[result["time"].to_numpy() > SETTLED])) / 2.0


def balance(gain: float) -> float:
    """Amplitude of the velocity at which, in a period, the feedback gives what friction and damping take [m/s]."""

    def surplus(V: float) -> float:
        q = VT / V
        given = 2.0 / pi * gain * FC / VT * (asin(q) + q * sqrt(1.0 - q**2)) * V
        return float(given - 4.0 / pi * FC - (KD + (1.0 - gain) * FV) * V)

    return float(brentq(surplus, 3.0 * VT, 1.0))


def main(folder: Path, full: bool = False) -> Effect:
    """Draw oscillations and their amplitude over the gain; check them against the harmonic balance."""
    figure, (course, sizes) = panels("Over-compensation causes a limit cycle", 1, 2, (9.5, 4.2))
    colours = {1.1: GREEN, 1.2: BLUE, 1.5: RED}
    checks: list[Check] = []
    found: dict[float, float] = {}
    for gain, expected in SWINGS.items():
        result = run(gain)
        found[gain] = swing(result)
        name = f"gain {gain:g}: velocity amplitude"
        if expected:
            checks.append(near(name, 1e3 * found[gain], 1e3 * expected, 0.01, "mm/s"))
            checks.append(near(f"{name} over the balance", found[gain] / balance(gain), 1.0, 0.03))
        else:
            checks.append(small(name, 1e3 * found[gain], 1e3 * REST, "mm/s"))
        if gain in colours:
            t, v = result["time"].to_numpy(), result["mass.v"].to_numpy()
            shown = t < 1.5
            course.plot(t[shown], 1e3 * v[shown], color=colours[gain], lw=1.3, label=f"gain {gain:g}")
    wide = [found[gain] for gain, expected in SWINGS.items() if expected]
    checks.append(
        Check("smallest growth of the amplitude from gain to gain", float(np.diff(wide).min()) * 1e3, "mm/s", 1.0)
    )
    for gain, expected in TREMBLING.items():
        value = swing(run(gain, NARROW))
        name = f"vt = {1e3 * NARROW:g} mm/s, gain {gain:g}: velocity amplitude"
        checks.append(near(name, 1e3 * value, 1e3 * expected, 0.05, "mm/s"))
        sizes.plot(gain, 1e3 * value, color=BLACK, marker="x", ls="", label="vt = 1 mm/s" if gain == 0.5 else None)
    gains = np.linspace(1.2, 2.0, 30)
    sizes.plot(gains, [1e3 * balance(gain) for gain in gains], color=GREY, lw=1.2, label="harmonic balance")
    sizes.plot(list(found), [1e3 * each for each in found.values()], color=RED, marker="o", ls="", label="vt = 5 mm/s")
    course.set(xlabel="time [s]", ylabel="velocity [mm/s]", ylim=(-90.0, 75.0))
    sizes.set(xlabel="gain", ylabel="velocity amplitude [mm/s]")
    course.legend(fontsize=9, loc="lower right", ncols=3)
    sizes.legend(fontsize=9, loc="upper left")
    save(figure, __file__, folder)

    if full:
        edge = (KD + SIGMA1 + FV) / (FC / NARROW + FV)
        quiet, loud = swing(run(0.9 * edge, NARROW)), swing(run(1.1 * edge, NARROW))
        checks += [
            small("vt = 1 mm/s, 0.9 of the limit at rest: velocity amplitude", 1e3 * quiet, 1e3 * REST, "mm/s"),
            Check("vt = 1 mm/s, 1.1 of the limit at rest: velocity amplitude", 1e3 * loud, "mm/s", 0.1),
        ]
        for gain in (1.1, 1.2, 1.5, 2.0):
            value = 1e3 * swing(run(gain, Fs=1.5 * FC))
            name = f"Fs = 1.5 Fc, gain {gain:g}: velocity amplitude"
            expected = 1e3 * SWINGS[gain]
            checks.append(
                near(name, value, expected, 0.01, "mm/s") if expected else small(name, value, 1e3 * REST, "mm/s")
            )
        value = 1e3 * swing(run(2.0, Kp=GAINS["Kp"], Kd=GAINS["Kd"]))
        checks.append(small("three poles at 15 Hz, gain 2: velocity amplitude", value, 1e3 * REST, "mm/s"))
    return Effect(
        f"The axis rests with gains up to 1.1. With 1.2, 1.5 and 2 its velocity oscillates by ±{1e3 * found[1.2]:.0f}, "
        f"±{1e3 * found[1.5]:.0f} and ±{1e3 * found[2.0]:.0f} mm/s.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
