"""Short force pulses remove the error that a PD controller leaves

A pulse that is stronger than static friction frees the axis, and the slide that follows is known. Left: slides after
one pulse, on the law d = Fp (Fp - Fc) tp^2 / (2 m Fc). Right: an axis that friction holds short of its target; each
pulse of 1 ms removes at least half of the error.

Fp is the force and tp the time of the pulse, m the mass and Fc the Coulomb friction; Fp for a wanted d follows from
the law. The next pulse corrects the error of the one before. On the left the plant is 1 kg with Fc = 1 N (KarnoppMass,
without viscous friction) with pulses from ImpulsiveControl. On the right 1 kg on LuGre, with viscous friction and a
presliding displacement of 15 µm, is under a PD controller with the gains of the 1995 paper, Kp = 3 and Kd = 6. Pulses
sized for Fc fall short, because part of each slide springs back and the PD controller brakes the rest.

The errors on LuGre were computed independently, with a Runge-Kutta method at 10 µs from sample to sample.

Source: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994 (pulses); Newton's second law (the slide).
"""

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np

from _effect import Check, Effect, command_line, small
from _loop import BLACK, BLUE, FC, FS, GREEN, OMEGA, RED, TS, Array, panels, save, simulate

MASS = 1.0  # [kg]
DURATIONS = {2: RED, 5: BLUE, 20: GREEN}  # of the pulses, in samples
FORCES = (1.6, 2.0, 3.0, 5.0, 10.0, 20.0)  # [N]
KP, KD, TOLERANCE = 3.0, 6.0, 5e-6  # [N/m], [N s/m], error below which there is no pulse [m]
LEFT: Mapping[float, tuple[float, ...]] = {  # errors before each pulse and at the end, by target [m]
    50e-6: (49.9983e-6, 20.2325e-6, 8.6413e-6, 2.9999e-6),
    0.5e-3: (499.983e-6, 125.655e-6, 40.7535e-6, 16.6105e-6, 7.1708e-6, 2.3586e-6),
    5e-3: (4999.83e-6, 1588.777e-6, 409.292e-6, 105.019e-6, 35.8344e-6, 14.8640e-6, 6.4374e-6, 2.0430e-6),
}
SERVO: Mapping[float, tuple[float, ...]] = {  # the same, with the gains for poles at 15 Hz
    20e-6: (15.7189e-6, 8.6019e-6, 5.3843e-6, 3.8802e-6),
    50e-6: (33.2734e-6, 16.8010e-6, 10.0271e-6, 6.1924e-6, 4.4125e-6),
}


def slide(force: float, tp: float) -> float:
    """The closed form [m]."""
    return force * (force - FC) * tp**2 / (2.0 * MASS * FC)


def rigid(stop: float, **pulses: float) -> Array:
    """Position of a mass without presliding and without a controller, that gets pulses toward 1 m or `r`."""
    given = {"r": 1.0, "f": 0.0, "Ts": TS, "u_min": -1e3, "u_max": 1e3, "Fs": FC} | pulses
    start = {f"pulses.{name}": value for name, value in given.items()}
    start |= {"mass.m": MASS, "mass.Fc": FC, "mass.Fs": FC, "mass.Fv": 0.0, "mass.DV": 1e-9}
    wires = ["mass.x -> pulses.x", "mass.v -> pulses.v", "pulses.u -> mass.F_ext"]
    result = simulate({"pulses": "ImpulsiveControl", "mass": "KarnoppMass"}, wires, start, stop)
    return result["mass.x"].to_numpy()


def lugre(target: float, enabled: bool, stop: float, Kp: float = KP, Kd: float = KD) -> tuple[Array, Array, Array]:
    """Time, error and number of pulses of an axis on LuGre under a PD controller and pulses."""
    models = {"pd": "PID", "pulses": "ImpulsiveControl", "mass": "Mass", "friction": "LuGre"}
    wires = ["mass.x -> pd.x", "mass.v -> pd.v", "mass.x -> pulses.x", "mass.v -> pulses.v", "pd.u -> pulses.f"]
    wires += ["pulses.u -> mass.F_drive", "mass.v -> friction.v", "friction.F -> mass.F_friction"]
    start = {"pd.r": target, "pd.rd": 0.0, "pd.rdd": 0.0, "pd.Kp": Kp, "pd.Kd": Kd, "pd.Ki": 0.0, "pd.Ts": TS}
    start |= {"pulses.r": target, "pulses.m": MASS, "pulses.Fc": FC, "pulses.Fs": FS, "pulses.tol": TOLERANCE}
    # a tolerance that no error exceeds disables the pulses and changes nothing else
    start |= {} if enabled else {"pulses.tol": 1.0}
    start |= {"pulses.n_pulse": 2, "pulses.n_stuck": 20, "pulses.Ts": TS, "pulses.u_min": -1e3, "pulses.u_max": 1e3}
    # a pulse is a jump of the force: in steps of 0.5 ms the first slide toward 5 mm would be 1.6 % too long
    result = simulate(models, wires, start, stop, step=TS / 10, record=("*", "pulses.pulses"))
    return result["time"].to_numpy(), target - result["mass.x"].to_numpy(), result["pulses.pulses"].to_numpy()


def main(folder: Path, full: bool = False) -> Effect:
    """Draw slides and errors, check them against the closed form and the independent computation."""
    figure, (slides, errors) = panels(
        "Short force pulses remove the error that a PD controller leaves", 1, 2, (9.0, 4.2)
    )
    worst = 0.0
    for n, colour in DURATIONS.items():
        found = []
        for force in FORCES:
            # the axis has to rest for longer than it slides before a next pulse: there is one in the run
            sliding = round(force / FC * n)
            x = rigid((2.2 * sliding + 30) * TS, sized=0.0, F_pulse=force, n_pulse=n, n_stuck=sliding + 20)
            assert x[-1] == x[-5]
            found.append(float(x[-1]))
            worst = max(worst, abs(x[-1] / slide(force, n * TS) - 1.0))
        law = np.geomspace(1.3, 25.0, 60).tolist()
        slides.loglog(law, [1e3 * slide(each, n * TS) for each in law], color=colour, lw=1.0)
        slides.loglog(
            FORCES, 1e3 * np.array(found), color=colour, ls="", marker="o", ms=5, label=f"{1e3 * n * TS:g} ms"
        )
    checks = [small("rigid: slide after a pulse, largest relative deviation from the law", worst, 1e-9)]
    for target in (1e-5, 1e-3, 1e-1) if full else (1e-3,):
        left = target - rigid(1.0, r=target, sized=1.0, tol=1e-3 * target, n_pulse=2, n_stuck=20)[-1]
        checks.append(
            small(
                f"rigid, target at {1e3 * target:g} mm: error after one sized pulse over it", abs(left) / target, 1e-5
            )
        )

    cases = [(target, left, KP, KD, "") for target, left in LEFT.items()]
    if full:
        cases += [(target, left, 3.0 * OMEGA**2, 3.0 * OMEGA, "gains of 15 Hz, ") for target, left in SERVO.items()]
    counts = []
    for (target, expected, Kp, Kd, which), colour in zip(
        cases, (BLUE, RED, GREEN, BLACK, BLACK)[: len(cases)], strict=True
    ):
        name = f"LuGre, {which}target at {1e6 * target:g} µm"
        t, held, _ = lugre(target, False, 0.4, Kp, Kd)
        stays = Check(
            f"{name}: remaining error under PD control over Fs/Kp", held[-1] * Kp / FS, "", TOLERANCE * Kp / FS, 1.0
        )
        moved = 1e6 * float(np.ptp(held[t > 0.1]))
        t, e, number = lugre(target, True, 0.4, Kp, Kd)
        before = [*e[np.flatnonzero(np.diff(number))], e[-1]]
        counts.append(len(before) - 1)
        off = max(abs(a / b - 1.0) for a, b in zip(before, expected, strict=True))
        ratio = max(b / a for a, b in pairwise(before))
        checks += [
            stays,
            small(f"{name}: motion under PD control after 0.1 s", moved, 0.01, "µm"),
            Check(f"{name}: errors before pulses, relative difference from the independent ones", off, "", 0.0, 3e-3),
            Check(f"{name}: largest ratio of errors from pulse to pulse", ratio, "", 0.0, 0.8),
            Check(f"{name}: error at the end", 1e6 * abs(e[-1]), "µm", 0.0, 1e6 * TOLERANCE),
        ]
        if not which:
            errors.semilogy(
                1e3 * t, 1e6 * np.abs(e), color=colour, lw=1.3, label=f"PD and pulses, from {1e3 * target:g} mm"
            )
            errors.semilogy(1e3 * t, 1e6 * held, color=colour, lw=1.0, ls="--")
    errors.semilogy([], [], color=BLACK, lw=1.0, ls="--", label="PD alone")
    errors.set(xlabel="time [ms]", ylabel="error [µm]", xlim=(0.0, 400.0), ylim=(1.0, 1e5))
    errors.legend(fontsize=9, loc="upper right")
    slides.set(
        xlabel="force of the pulse [N]", ylabel="slide [mm]", xticks=[2, 5, 10, 20], xticklabels=["2", "5", "10", "20"]
    )
    slides.minorticks_off()
    slides.legend(title="duration; lines: the law", fontsize=9, title_fontsize=9)
    save(figure, __file__, folder)
    return Effect(
        f"Errors of 50 µm, 0.5 mm and 5 mm fall below 5 µm after {counts[0]}, {counts[1]} and {counts[2]} pulses.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
