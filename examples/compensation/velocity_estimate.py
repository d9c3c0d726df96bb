"""An estimated velocity causes less drive force than differences of positions

Adaptive compensation with a LuGre model needs the velocity. With an encoder of 1 µm at 2 kHz, differences of two
positions come in steps of 2 mm/s; the observer in ANDFC has an error eight times smaller. The axis follows a sine of
0.5 mm at 1 Hz.

ANDFC estimates the velocity from the position, with an observer that knows the mass, the force and the friction. The
error of a difference is q/(Ts sqrt(6)) = 0.82 mm/s (root mean square) if the roundings are independent. The observer
has its poles at 1000 rad/s. AdaptiveLuGre, led by differences, drives the axis with a force that changes a hundred
times as much as without rounding, and its error grows tenfold; with ANDFC the force changes some 14 times as much and
the error doubles. Both laws have the exact parameters of the friction.

Source: Widrow, Kollar: Quantization Noise, Cambridge University Press 2008 (the error of a difference); Tan,
Kanellakopoulos, American Control Conference, 1999 (ANDFC).
"""

from math import pi, sqrt
from pathlib import Path

import numpy as np

from _axis import error, follow
from _effect import Check, Effect, command_line, near, small
from _loop import BLACK, BLUE, OMEGA, RED, TS, panels, rms, save
from harness import Result

A, Q, SINCE = 5e-4, 1e-6, 2.0  # amplitude [m], step of the encoder [m], end of settling [s]
COMMON = {"m": 1.0, "lam": OMEGA, "Ks": 2.0 * OMEGA}
LAWS = {
    "AdaptiveLuGre": {"Gamma": 4000.0},
    "ANDFC": {"wo": 1000.0, "k0": 0.02, "k1": 0.5, "Gamma0": 2000.0, "Gamma1": 20.0, "Gamma2": 20.0},
}


def run(law: str, step: float, amplitude: float = A) -> Result:
    """The axis under a law that reads an encoder of the given step [m], 0: no rounding."""
    speed = 2.0 * pi * amplitude
    wires = ["mass.x -> encoder.x", "mass.v -> encoder.v", "encoder.x_measured -> servo.x"]
    wires += ["encoder.v_measured -> servo.v"] if law == "AdaptiveLuGre" else []
    return follow(
        ("Sine", {"amplitude[1]": amplitude, "frequency[1]": 1.0}),
        (law, COMMON | LAWS[law]),
        SINCE + 1.0,
        mass={"v0": speed},
        others={"encoder": ("Encoder", {"q": step, "Ts": TS, "v0": speed})},
        wires=wires,
    )


def main(folder: Path, full: bool = False) -> Effect:
    """Draw velocities and forces, check what the encoder adds."""
    figure, (speeds, forces) = panels("Estimated velocity and difference of positions", 1, 2, (9.4, 3.9))
    late = slice(round(SINCE / TS), None)
    variation, errors, off = {}, {}, {}
    for law, colour in (("AdaptiveLuGre", RED), ("ANDFC", BLUE)):
        for step in (0.0, Q):
            result = run(law, step)
            u = result["servo.u"].to_numpy()[late]
            variation[law, step] = float(np.abs(np.diff(u)).sum())
            errors[law, step] = 1e6 * rms(error(result, SINCE))
        v = result["mass.v"].to_numpy()[late]
        used = result["servo.v_est" if law == "ANDFC" else "encoder.v_measured"].to_numpy()[late]
        off[law] = 1e3 * rms(used - v)
        t, part = 1e3 * TS * np.arange(v.size), slice(200, 400)
        name = "estimate of ANDFC" if law == "ANDFC" else "difference"
        speeds.plot(t[part], 1e3 * used[part], color=colour, lw=1.0, label=name)
        forces.plot(t[part], u[part], color=colour, lw=0.9, label=law)
    speeds.plot(t[part], 1e3 * v[part], color=BLACK, lw=1.2, label="velocity")
    speeds.set(xlabel="time [ms]", ylabel="velocity [mm/s]", ylim=(-4.0, 8.0))
    forces.set(xlabel="time [ms]", ylabel="force [N]")
    for axis in (speeds, forces):
        axis.legend(fontsize=8.5, loc="upper right")
    save(figure, __file__, folder)

    fast = run("AdaptiveLuGre", Q, 5e-3)  # so fast that the roundings are independent
    rounding = 1e3 * rms((fast["encoder.v_measured"] - fast["mass.v"]).to_numpy()[late])
    more = {law: variation[law, Q] / variation[law, 0.0] for law in LAWS}
    checks = (
        near("5 mm: error of the difference", rounding, 1e3 * Q / (TS * sqrt(6.0)), 0.15, "mm/s"),
        Check("difference: error of the velocity", off["AdaptiveLuGre"], "mm/s"),
        Check(
            "ANDFC: error of the velocity relative to that of the difference",
            off["ANDFC"] / off["AdaptiveLuGre"],
            "",
            0.0,
            0.2,
        ),
        *(
            Check(f"{law}: variation of the force relative to that without rounding", each)
            for law, each in more.items()
        ),
        Check(
            "ANDFC over difference: variation of the force",
            variation["ANDFC", Q] / variation["AdaptiveLuGre", Q],
            "",
            0.0,
            0.2,
        ),
        small(
            "ANDFC over difference: error", errors["ANDFC", Q] / errors["AdaptiveLuGre", Q], 0.2
        ),  # rounding is chaotic
    )
    return Effect(
        f"With an encoder of 1 µm the tracking error is {errors['AdaptiveLuGre', Q]:.0f} µm with differences and "
        f"{errors['ANDFC', Q]:.1f} µm with the estimate, whose drive force varies "
        f"{variation['AdaptiveLuGre', Q] / variation['ANDFC', Q]:.0f} times less.",
        checks,
    )


if __name__ == "__main__":
    command_line(main)
