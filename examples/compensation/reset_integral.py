"""An integral that changes sign with the error ends hunting

Hunting comes from an integral that must unwind after the axis has passed its target. ResetPID sets it from I to about
-rho I at that moment, so it pushes back at once. Top: on LuGre friction the PID controller hunts, while with rho = 0.8
the axis comes to rest in the presliding range. Bottom: without friction, the energy V never rises in a jump.

V, in the block's documentation, is an energy of error, velocity and integral. It falls between jumps on a mass without
friction; sampled at 2 kHz it rises by less than a thousandth in all. The step is 1 m under the gains of the 1995
paper, Kp = 3, Ki = 4, Kd = 6. Nothing is proven with dry friction. With rho = 0.5 and 0 the axis stays 80 µm and 2 mm
away and waits for the integral, for longer than the 2 minutes of a run. With rho = 1 the integral keeps its size and
the axis oscillates by some µm forever, with and without friction: V no longer falls where the error is small. On a
sine of 5 mm, with three poles at 15 Hz, the jumps reverse the integral when friction reverses: the error is 0.37 of
that with the PID controller.

Times of the jumps and errors at rest were computed independently, with a Runge-Kutta method at steps of 10 µs for the
axis and independent code for the law.

Source: this library; the idea from Beerens, Bisoffi, Zaccarian, Heemels, Nijmeijer, van de Wouw, Automatica 107, 2019.
"""

from math import pi
from pathlib import Path

import numpy as np

from _effect import Check, Effect, command_line, near, small
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
SINE = 0.3703  # RMS error on the sine with rho = 0.8, relative to that with PID


def run(rho: float | None, friction: str | None, stop: float = STOP, start: dict[str, float] | None = None) -> Result:
    """A step under ResetPID, or under PID for rho = None."""
    gains = {"Kp": KP, "Ki": KI, "Kd": KD, "m": 0.0} | ({} if rho is None else {"rho": rho, "mass": 1.0})
    block = "PID" if rho is None else "ResetPID"
    record = ("*", "servo.integral")
    inner = 5 if friction else 1  # a jump falls close to a sample: an error of 1e-7 would move it by one
    return follow(block, gains, GOAL, stop, friction=friction, start=start or NOTHING, inner=inner, record=record)


def deviation(result: Result) -> Array:
    """The error [m]."""
    return np.asarray((result["reference.r"] - result["mass.x"]).to_numpy())


def energy(result: Result) -> Array:
    """Return V of the loop without friction over its first value."""
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
    title = "An integral that changes sign with the error ends hunting"
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
            checks.append(small(f"no friction, {name}: error after 25 s", np.abs(e[t > 25.0]).max(), 1e-9, "m"))
    above.set(ylabel="|error| on LuGre [m]", ylim=(1e-8, 3.0))
    below.set(ylabel="V without friction, over its start", xlabel="time [s]", ylim=(1e-12, 3.0), xlim=above.get_xlim())
    above.legend(loc="upper right", ncols=5, fontsize=9)
    save(figure, __file__, folder)

    checks += [
        Check("LuGre, PID: error after 40 s", 1e3 * late[None], "mm", 50.0),
        small("LuGre, rho = 0.8: error after 40 s", 1e6 * late[0.8], 1e6 * FS / SIGMA0, "µm"),
        small("LuGre, rho = 1: error after 40 s", 1e6 * late[1.0], 1e6 * FS / SIGMA0, "µm"),
    ]
    if full:
        for rho in (0.0, 0.5, 0.8):
            result = run(rho, "LuGre", 120.0)
            e = np.abs(deviation(result))[result["time"].to_numpy() > 100.0].max()
            name = f"LuGre, rho = {rho:g}: error after 100 s relative to that after 40 s"
            checks.append(Check(name, e / late[rho], "", 0.99, 1.0))
            result = run(rho, "LuGre", start={"friction.Fs": 1.0})
            e = np.abs(deviation(result))[result["time"].to_numpy() > LATE].max()
            name, rest = f"LuGre with Fs = Fc, rho = {rho:g}: error after 40 s", 1e6 * COULOMB.get(rho, 0.0)
            within = near(name, 1e6 * e, rest, 0.02, "µm") if rest else small(name, 1e6 * e, 1e6 * FC / SIGMA0, "µm")
            checks.append(within)
        sine, start = sines((5e-3, 1.0, 0.0)), {"mass.v0": 2.0 * pi * 5e-3}
        alone = error(follow("PID", GAINS, sine, 3.0, start=start), 1.0)
        jumping = error(follow("ResetPID", {**GAINS, "rho": 0.8, "mass": 1.0}, sine, 3.0, start=start), 1.0)
        checks.append(near("sine of 5 mm, rho = 0.8: RMS error relative to that with PID", jumping / alone, SINE, 0.01))
    return Effect(
        f"After 40 s the error is {1e3 * late[None]:.0f} mm with the PID controller, less than {1e6 * FS / SIGMA0:g} "
        f"µm with rho = 0.8, {1e6 * late[0.5]:.0f} µm with 0.5 and {1e3 * late[0.0]:.1f} mm with 0.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
