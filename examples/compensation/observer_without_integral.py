"""A friction observer reaches the target without an integral and without hunting

Against friction a PD controller leaves an error, and an integral makes the loop hunt if Fs > Fc. If the friction is
observed and fed back, the axis moves as if it had no friction and the integral has nothing to do. Here 1 kg moves to a
target at 1 m.

The gains are those of the 1995 paper, Kp = 3 and Kd = 6. With Ki = 4 the axis hunts, with Ki = 0 it stays away from the
target. With Ki = 0 and the observer with the exact model, it follows the free motion of m s^2 + Kd s + Kp: after ten
seconds it is within 5 mm, and it continues towards the target at the slow pole, -0.55 / s, through the whole presliding
range. The error after 20 s was computed independently, with a Runge-Kutta method of steps of 5 µs from sample to
sample.

Source: Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995.
"""

from pathlib import Path

import numpy as np

from _axis import Block, error, follow
from _effect import Check, Effect, command_line, near
from _loop import BLACK, BLUE, FS, GREY, RED, TS, panels, save

KP, KI, KD = 3.0, 4.0, 6.0  # [N/m], [N/(m s)], [N s/m]
GOAL, STOP = 1.0, 40.0  # [m], [s]
LEFT = 19.25e-6  # error with the observer after 20 s [m]


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the errors, check the free motion and the remaining error."""
    figure, axes = panels("A friction observer reaches the target without hunting", 1, 2, (9.0, 3.8))
    observer: dict[str, Block] = {"observer": ("LuGreObserver", {})}
    cases = {
        "PID": (KI, {}, RED),
        "PD": (0.0, {}, GREY),
        "PD and observer": (0.0, observer, BLUE),
    }
    errors = {}
    for name, (Ki, added, colour) in cases.items():
        gains = {"Kp": KP, "Ki": Ki, "Kd": KD, "m": 0.0}
        target = ("Sine", {"offset": GOAL, "amplitude[1]": 0.0})
        errors[name] = error(follow(target, ("PID", gains), STOP, added=added), -1.0)
        t = TS * np.arange(errors[name].size)
        axes[0].plot(t[::20], errors[name][::20], color=colour, lw=1.4, label=name)
        axes[1].semilogy(t[::20], np.abs(errors[name][::20]), color=colour, lw=1.4, label=name)
    slow, fast = sorted(np.roots([1.0, KD, KP]).real, reverse=True)
    free = GOAL * (fast * np.exp(slow * t) - slow * np.exp(fast * t)) / (fast - slow)
    axes[1].semilogy(t[::20], free[::20], color=BLACK, ls=":", lw=1.4, label="no friction")
    axes[0].set(xlabel="time [s]", ylabel="error [m]")
    axes[1].set(xlabel="time [s]", ylabel="|error| [m]", ylim=(1e-9, 3.0))
    axes[1].legend(loc="lower left", fontsize=9)
    save(figure, __file__, folder)

    hunts, stays, observed = errors.values()
    checks = (
        Check("PID: largest error after 20 s", 1e3 * np.abs(hunts[t > 20.0]).max(), "mm", 10.0),
        Check("PD: error that stays", stays[-1], "m", 0.01, FS / KP),
        Check(
            "observer: difference from the motion without friction", 1e3 * np.abs(observed - free).max(), "mm", 0.0, 1.0
        ),
        near("observer: error after 20 s", 1e6 * observed[t > 20.0][0], 1e6 * LEFT, 0.01, "µm"),
        Check("observer: largest overshoot over the target", max(0.0, -observed.min()) / GOAL, "", 0.0, 1e-9),
    )
    return Effect(
        f"With the observer the axis is {1e3 * observed[t > 10.0][0]:.1f} mm from its target after 10 s and "
        f"{1e6 * observed[t > 20.0][0]:.0f} µm after 20 s. With PID control it is up to {checks[0].value:.0f} mm off "
        f"after 20 s, and with PD control it stays {1e3 * stays[-1]:.0f} mm away.",
        checks,
    )


if __name__ == "__main__":
    command_line(main)
