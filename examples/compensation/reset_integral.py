"""An integral that jumps where the error changes sign ends the hunting

Hunting comes from an integral that has wound up to break-away and must unwind after the axis has passed its goal. Here
it jumps at that moment, from I to about -rho I, and pushes back at once.

On a mass without friction the jumps do no harm: the function V of the block's documentation, an energy of error,
velocity and integral, falls between jumps and never rises in one. The lower figure shows V after a step of 1 m under
the gains of the 1995 paper, Kp = 3, Ki = 4, Kd = 6: sampled at 2 kHz it rises by less than a thousandth in all.

Nothing is proven with dry friction. The upper figure shows the same step on LuGre friction: PID hunts for ever. With
rho = 0.8 each pass is smaller than the one before, and the axis comes to rest within the presliding range, Fs/sigma0 =
15 µm. With rho = 0.5 and 0 it stays 80 µm and 2 mm away and waits for the integral, for longer than the 2 minutes of a
run. With rho = 1 the integral keeps its size and the axis trembles by some µm, for ever, with and without friction: V
does not fall any more where the error is small.

On a sine of 5 mm, with three poles at 15 Hz, the jumps bring the integral round as friction turns: the error is 0.37 of
that with PID.

Times of the jumps and errors at rest were computed independently, with a Runge-Kutta method at steps of 10 µs for the
axis and the law written anew.

Source: this library; the idea from Beerens, Bisoffi, Zaccarian, Heemels, Nijmeijer, van de Wouw, Automatica 107, 2019.
"""

from math import pi
from pathlib import Path

import numpy as np

from _effect import Check, Effect, command_line, near
from _loop import BLACK, BLUE, FC, FS, GAINS, GREEN, GREY, RED, Array, panels, save
from _servo import NOTHING, error, follow, sines
from harness import Result

KP, KI, KD = 3.0, 4.0, 6.0  # [N/m], [N/(m s)], [N s/m]
GOAL = {"offset": 1.0, "amplitude[1]": 0.0}  # [m]
STOP, LATE = 60.0, 40.0  # [s]
SIGMA0 = 1e5  # of LuGre [N/m]
COLOURS = {None: RED, 0.0: GREY, 0.5: BLUE, 0.8: GREEN, 1.0: BLACK}  # by rho, None: PID
JUMPS = (1.935, 2.184, 2.333, 2.432)  # the first with rho = 0.8, LuGre [s]
RESTS = {0.0: 1.9533e-3, 0.5: 79.65e-6}  # error at rest by rho [m]
COULOMB = {0.0: 297.3e-6, 0.5: 78.77e-6}  # that with Fs = Fc [m]
TREMBLING = 0.2592e-3  # largest error after 20 s with rho = 1 without friction [m]
SINE = 0.3703  # RMS error on the sine with rho = 0.8, over that with PID


def run(rho: float | None, friction: str | None, stop: float = STOP, start: dict[str, float] | None = None) -> Result:
    """A step under ResetPID, or under PID for rho = None."""
    gains = {"Kp": KP, "Ki": KI, "Kd": KD, "m": 0.0} | ({} if rho is None else {"rho": rho, "mass": 1.0})
    block = "PID" if rho is None else "ResetPID"
    record = ("*", "servo.integral")
    return follow(block, gains, GOAL, stop, friction=friction, start=start or NOTHING, record=record)


def deviation(result: Result) -> Array:
    """The error [m]."""
    return np.asarray((result["reference.r"] - result["mass.x"]).to_numpy())


def energy(result: Result) -> Array:
    """V of the loop without friction, over that of the first sample."""
    a, b, c = KD, KP, KI
    e = deviation(result)
    integral = result["servo.integral"].to_numpy()
    V = (a * e - result["mass.v"].to_numpy()) ** 2 + (b - c / a) * e**2 + a * c * (integral + e / a) ** 2
    return np.asarray(V / V[0])


def rises(V: Array) -> float:
    """By how much V rises in all."""
    growth = np.diff(V)
    return float(growth[growth > 0.0].sum())


def main(folder: Path, full: bool = False) -> Effect:
    """Draw error and V, check that the axis comes to rest and that V falls."""
    title = "An integral that jumps where the error changes sign ends the hunting"
    figure, (above, below) = panels(title, 2, 1, (8.0, 6.5))
    checks: list[Check] = []
    late: dict[float | None, float] = {}
    for rho, colour in COLOURS.items():
        name = "PID" if rho is None else f"rho = {rho:g}"
        result = run(rho, "LuGre")
        t, e = result["time"].to_numpy(), deviation(result)
        late[rho] = float(np.abs(e[t > LATE]).max())
        above.semilogy(t[::10], np.maximum(np.abs(e[::10]), 1e-8), color=colour, lw=1.0, label=name)
        if rho in RESTS:
            checks.append(near(f"LuGre, {name}: error after 40 s", 1e6 * late[rho], 1e6 * RESTS[rho], 0.02, "µm"))
        if rho == 0.8:
            at = t[result["servo.jumped"].to_numpy() > 0.0]
            for i, expected in enumerate(JUMPS):
                checks.append(Check(f"LuGre, {name}: jump {i + 1}", at[i], "s", expected - 1e-3, expected + 1e-3))
            checks.append(Check(f"LuGre, {name}: last jump", at[-1], "s", 0.0, 3.0))
        result = run(rho, None, 30.0)
        t, V, e = result["time"].to_numpy(), energy(result), deviation(result)
        below.semilogy(t[::10], np.maximum(V[::10], 1e-12), color=colour, lw=1.0, label=name)
        if rho is not None:
            checks.append(Check(f"no friction, {name}: rise of V over its start, in all", rises(V), "", 0.0, 1e-3))
        if rho == 1.0:
            stays = 1e3 * np.abs(e[t > 20.0]).max()
            checks.append(near(f"no friction, {name}: error after 20 s", stays, 1e3 * TREMBLING, 0.05, "mm"))
        elif rho is not None:
            checks.append(Check(f"no friction, {name}: error after 25 s", np.abs(e[t > 25.0]).max(), "m", 0.0, 1e-9))
    above.set(ylabel="|error| on LuGre [m]", ylim=(1e-8, 3.0))
    below.set(ylabel="V without friction, over its start", xlabel="time [s]", ylim=(1e-12, 3.0), xlim=above.get_xlim())
    above.legend(loc="upper right", ncols=5, fontsize=9)
    save(figure, __file__, folder)

    checks += [
        Check("LuGre, PID: error after 40 s", 1e3 * late[None], "mm", 50.0),
        Check("LuGre, rho = 0.8: error after 40 s", 1e6 * late[0.8], "µm", 0.0, 1e6 * FS / SIGMA0),
        Check("LuGre, rho = 1: error after 40 s", 1e6 * late[1.0], "µm", 0.0, 1e6 * FS / SIGMA0),
    ]
    if full:
        for rho in (0.0, 0.5, 0.8):
            result = run(rho, "LuGre", 120.0)
            e = np.abs(deviation(result))[result["time"].to_numpy() > 100.0].max()
            name = f"LuGre, rho = {rho:g}: error after 100 s over that after 40 s"
            checks.append(Check(name, e / late[rho], "", 0.99, 1.0))
            result = run(rho, "LuGre", start={"friction.Fs": 1.0})
            e = np.abs(deviation(result))[result["time"].to_numpy() > LATE].max()
            name, rest = f"LuGre with Fs = Fc, rho = {rho:g}: error after 40 s", 1e6 * COULOMB.get(rho, 0.0)
            high = 1.02 * rest or 1e6 * FC / SIGMA0
            checks.append(Check(name, 1e6 * e, "µm", 0.98 * rest, high))
        sine, start = sines((5e-3, 1.0, 0.0)), {"mass.v0": 2.0 * pi * 5e-3}
        alone = error(follow("PID", GAINS, sine, 3.0, start=start), 1.0)
        jumping = error(follow("ResetPID", {**GAINS, "rho": 0.8, "mass": 1.0}, sine, 3.0, start=start), 1.0)
        checks.append(near("sine of 5 mm, rho = 0.8: RMS error over that with PID", jumping / alone, SINE, 0.01))
    return Effect(
        f"After 40 s PID still swings by {1e3 * late[None]:.0f} mm; with rho = 0.8 the axis is {1e6 * late[0.8]:.1f} "
        f"µm from its goal, with 0.5 {1e6 * late[0.5]:.0f} µm and with 0 {1e3 * late[0.0]:.1f} mm.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
