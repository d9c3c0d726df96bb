"""Dithered friction acts as a damper, which feedforward can compensate

Shaken with a velocity A sin(2 pi f t), Coulomb friction has the mean of a damper, 2 Fc/(pi A), for slow motion.
Feedforward alone leaves the jump of friction; dither alone leaves the error of the damper; dither with the damper added
to the feedforward removes nearly all of it. The axis follows a sine of 5 mm at 0.5 Hz.

The mean is (2 Fc/pi) asin(v/A) at the velocity v. The plant is 1 kg with Coulomb and viscous friction, 1 N and 20 N
s/m (KarnoppMass), under a soft PD controller, Kp = 1 kN/m; errors are averaged over a period of the dither.
Feedforward of inertia and viscous friction leaves Fc/Kp = 1 mm to either side. Dither is 50 N at 200 Hz, A = 40 mm/s.
Both together, with 20 + 2 Fc/(pi A) N s/m in the feedforward, leave what asin differs from a straight line.

Source: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994 (dither); the mean follows by integration.
"""

from math import asin, pi
from pathlib import Path

import numpy as np

from _effect import Check, Effect, command_line, near
from _loop import BLACK, BLUE, FC, GREY, RED, Array, panels, save, simulate

M, FV, KP, KD = 1.0, 20.0, 1e3, 60.0  # [kg], [N s/m], [N/m], [N s/m]
AD, FREQUENCY, TS = 50.0, 200.0, 1e-4  # [N], [Hz], [s]
A = AD / (2.0 * pi * FREQUENCY * M)  # amplitude of the velocity [m/s]
STROKE, SLOW = 5e-3, 0.5  # of the reference [m], [Hz]
SPEED = 2.0 * pi * SLOW * STROKE  # its largest [m/s]
DAMPER = 2.0 * FC / (pi * A)  # of the shaken contact [N s/m]
WIRES = (
    "reference.r -> servo.r",
    "reference.rd -> servo.rd",
    "reference.rdd -> servo.rdd",
    "mass.x -> servo.x",
    "mass.v -> servo.v",
    "reference.rd -> forward.rd",
    "reference.rdd -> forward.rdd",
    "forward.u -> servo.f",
    "servo.u -> dither.f",
    "dither.u -> mass.F_ext",
)
PARTS = {"reference": "Sine", "forward": "InverseDynamics", "servo": "PID", "dither": "Dither", "mass": "KarnoppMass"}


def error(shaken: bool, forward: bool) -> Array:
    """Error in the second half of a period and a half of the reference, averaged over periods of the dither [m]."""
    values = {
        "reference": {"amplitude[1]": STROKE, "frequency[1]": SLOW, "phase[1]": pi / 2.0},
        "forward": {"m": M if forward else 0.0, "Fv": (FV + DAMPER * shaken) if forward else 0.0, "Ts": TS},
        "servo": {"Kp": KP, "Kd": KD, "Ki": 0.0, "m": 0.0, "Ts": TS},
        "dither": {"Ad": AD if shaken else 0.0, "frequency": FREQUENCY, "Ts": TS},
        "mass": {"m": M, "Fc": FC, "Fs": FC, "Fv": FV, "DV": 1e-6, "x0": STROKE, "v0": -A if shaken else 0.0},
    }
    start = {f"{part}.{name}": value for part, given in values.items() for name, value in given.items()}
    result = simulate(PARTS, WIRES, start, 1.5 / SLOW, step=TS, record=["reference.r", "mass.x"])
    e = (result["reference.r"] - result["mass.x"]).to_numpy()
    n = round(1.0 / (FREQUENCY * TS))
    return np.convolve(e, np.full(n, 1.0 / n), "valid")[-round(1.0 / (SLOW * TS)) :]


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the errors, check them against the damper."""
    figure, (axis,) = panels("Dither and feedforward of the velocity", 1, 1, (8.0, 4.2))
    largest = {}
    for name, shaken, forward, colour in (
        ("neither", False, False, GREY),
        ("feedforward", False, True, BLACK),
        ("dither", True, False, BLUE),
        ("both", True, True, RED),
    ):
        e = error(shaken, forward)
        largest[name] = 1e6 * float(np.abs(e).max())
        axis.plot(TS * np.arange(e.size), 1e3 * e, color=colour, lw=1.5, label=name)
    axis.set(xlabel="time [s]", ylabel="error, mean over 5 ms [mm]")
    axis.legend(fontsize=9)
    save(figure, __file__, folder)
    curved = 2.0 * FC / pi * (asin(SPEED / A) - SPEED / A) / KP * 1e6
    checks = (
        Check("neither: largest error", largest["neither"], "µm"),
        near("feedforward alone: largest error over Fc/Kp", largest["feedforward"] / (1e6 * FC / KP), 1.0, 0.1),
        Check("dither alone: largest error", largest["dither"], "µm"),
        Check("both: largest error", largest["both"], "µm"),
        Check("both: largest error over what asin leaves of a line", largest["both"] / curved, "", 0.5, 1.5),
        Check(
            "both over the better one alone",
            largest["both"] / min(largest["feedforward"], largest["dither"]),
            "",
            0.0,
            0.1,
        ),
    )
    return Effect(
        f"The largest error is {1e-3 * largest['feedforward']:.2f} mm with feedforward alone, "
        f"{1e-3 * largest['dither']:.2f} mm with dither alone and {1e-3 * largest['both']:.3f} mm with both.",
        checks,
    )


if __name__ == "__main__":
    command_line(main)
