"""An integral makes the loop hunt if static friction exceeds Coulomb friction

Static friction holds the axis short of its target until the integral has wound up to break-away. Friction then falls to
the Coulomb level, and the excess force carries the axis past the target, where it waits again. With Fs = Fc there is no
excess and no limit cycle. Without the integral the axis stays up to Fs/Kp from its target.

The figure shows 1 kg under the PID controller of the 1995 paper, Kp = 3, Ki = 4 and Kd = 6, on its way to a target at 1
m. With Fs = Fc the axis still waits, each time longer, but each time it rests less than half as far from the target.
Without friction the loop settles in seconds. On a rigid contact the amplitude is proportional to Fs - Fc, and nearly
so here.

Period and amplitude were computed independently, with an ODE solver at tight tolerances and a continuous PID
controller.

Source: Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995 (the loop); for the condition Fs > Fc:
Armstrong, Amin, Automatica 32(5), 1996.
"""

from pathlib import Path

import numpy as np

from _effect import Check, Effect, command_line, near
from _loop import BLUE, FC, FS, GREEN, RED, VS, Array, panels, run, save

KP, KI, KD = 3.0, 4.0, 6.0  # [N/m], [N/(m s)], [N s/m]
STOP = 120.0  # [s]
WAIT, SWING = 12.2183, 0.063903  # of LuGre, period [s], largest error in the cycle [m]

OTHERS = {  # the same in full, for other Kp, Ki and Fs
    (3.0, 8.0, FS): (6.6769, 0.066389),
    (6.0, 8.0, FS): (10.1946, 0.035965),
    (3.0, 4.0, 1.2): (23.3365, 0.026362),
}


def slips(t: Array, v: Array) -> Array:
    """Times at which the axis gets faster than ten Stribeck velocities [s]."""
    fast = np.abs(v) >= 10.0 * VS
    return t[1:][fast[1:] & ~fast[:-1]]


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the error and check the cycle, or that there is none."""
    figure, axes = panels("An integral makes the loop hunt if Fs > Fc", 2, 1, (8.0, 5.5))
    cases = {
        "Fs = 1.5 Fc": (KI, "LuGre", FS, RED, 0),
        "Fs = Fc": (KI, "LuGre", FC, BLUE, 0),
        "no friction": (KI, None, FS, GREEN, 0),
        "Fs = 1.5 Fc, no integral": (0.0, "LuGre", FS, RED, 1),
    }
    errors, starts = {}, {}
    for name, (Ki, friction, Fs, colour, row) in cases.items():
        target = {"reference.offset": 1.0, "reference.amplitude[1]": 0.0} | ({"friction_x.Fs": Fs} if friction else {})
        gains = {"Kp": KP, "Ki": Ki, "Kd": KD, "m": 0.0}
        result = run("Sine", {"x": ("r", "rd", "rdd")}, STOP, target, friction=friction, gains=gains)
        t = result["time"].to_numpy()
        errors[name] = (result["reference.r"] - result["mass_x.x"]).to_numpy()
        starts[name] = slips(t, result["mass_x.v"].to_numpy())
        axes[row].plot(t[::20], errors[name][::20], color=colour, lw=1.3, label=name)
    axes[0].set(ylabel="error [m]", ylim=(-0.13, 0.15))
    axes[1].set(ylabel="error [m]", xlabel="time [s]", ylim=(-0.1, 1.0))
    for axis in axes:
        axis.legend(loc="upper right", ncols=3, fontsize=9)
    save(figure, __file__, folder)

    hunting, calm, free, held = errors.values()
    waits = np.diff(starts["Fs = 1.5 Fc"])[-5:]
    swing = np.abs(hunting[t > 80.0]).max()
    rests = np.abs(calm[np.searchsorted(t, starts["Fs = Fc"][3:] - 1.0)])  # one second before it slips
    assert rests.size == 3 and np.all(np.diff(starts["Fs = Fc"], 2) > 0.0)  # each wait is longer
    assert np.ptp(held[t > 20.0]) < 1e-3
    slowest = np.roots([1.0, KD, KP, KI]).real.max()
    checks = [
        near("LuGre: period", float(np.mean(waits)), WAIT, 5e-4, "s"),
        near("LuGre: largest error in the cycle", 1e3 * swing, 1e3 * SWING, 1e-3, "mm"),
        near(
            "LuGre: that of the last 20 s relative to that of the last 40 s",
            hunting[t > 100.0].max() / swing,
            1.0,
            1e-3,
        ),
        Check(
            "Fs = Fc: error at a rest relative to that at the rest before", (rests[1:] / rests[:-1]).max(), "", 0.0, 0.5
        ),
        Check(
            "Fs = Fc: error of the last 30 s relative to that at the last rest",
            np.abs(calm[t > 90.0]).max() / rests[-1],
            "",
            0.0,
            0.5,
        ),
        Check("no friction: error after 20 s", np.abs(free[t > 20.0]).max(), "m", 0.0, 2.0 * np.exp(20.0 * slowest)),
        Check("no integral: remaining error", held[-1], "m", 0.0, FS / KP),
    ]
    if full:
        target = {"reference.offset": 1.0, "reference.amplitude[1]": 0.0}
        for (Kp, Ki, Fs), (wait, largest) in OTHERS.items():
            gains = {"Kp": Kp, "Ki": Ki, "Kd": KD, "m": 0.0}
            result = run("Sine", {"x": ("r", "rd", "rdd")}, STOP, target | {"friction_x.Fs": Fs}, gains=gains)
            error = np.abs((result["reference.r"] - result["mass_x.x"]).to_numpy())[t > 100.0].max()
            found = np.diff(slips(t, result["mass_x.v"].to_numpy()))[-1]
            name = f"LuGre, Kp = {Kp:g}, Ki = {Ki:g}, Fs = {Fs:g} Fc"
            checks.append(near(f"{name}: period", float(found), wait, 2e-3, "s"))
            checks.append(near(f"{name}: largest error in the cycle", 1e3 * error, 1e3 * largest, 2e-3, "mm"))
            if Fs != FS:
                checks.append(
                    near(
                        f"{name}: amplitude / (Fs - Fc) relative to that above",
                        error / swing * 0.5 / (Fs - FC),
                        1.0,
                        0.05,
                    )
                )
    return Effect(
        f"On LuGre the axis slips every {np.mean(waits):.2f} s and overshoots by {1e3 * swing:.1f} mm forever. With "
        f"Fs = Fc it rests {', '.join(f'{1e3 * rest:.0f}' for rest in rests)} mm from its target and closer each time. "
        f"Without the integral it stays {1e3 * held[-1]:.0f} mm away.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
