"""Feedforward of the inverse plant is as good as the plant model

With a plant P, a feedback controller C and a feedforward F, y/r = (F P + C P)/(1 + C P): the output follows the
reference exactly if F = 1/P. Left: |1 - y/r| with the exact inverse, with a mass that is 20 % off and without F.
Right: with LuGre friction in the plant the same F leaves the friction as an error.

The equation is (2.1) of the report and F = 1/P its (2.3). The diagram has the parts and connections of the system that
is run; the reference also gives its derivatives, which F needs. The plant is 1 kg with viscous friction, C a PID
controller with three poles at 15 Hz. |1 - y/r| comes from a reference of four sines; (2.1) holds for the sampled loop,
in which P is the mass under a force that is held for a sample. With F = 1/P a delay of half a sample is left, pi f Ts
of the error without F. With a mass in F that is 20 % too large, 0.2 of the error without F is left where inertia
dominates. On the right the reference is a sine of 5 mm at 1 Hz.

Source: the transfer functions follow from the diagram; for the sampled loop: Astrom, Wittenmark, Computer-Controlled
Systems, Prentice Hall 1997.
"""

from math import exp, pi
from pathlib import Path

import numpy as np

from _diagram import Arrow, Box, draw, run_loop, sheet, sum_of
from _effect import Check, Effect, command_line, near, small
from _loop import BLACK, BLUE, GAINS, GREY, RED, TS, Array, rms, save
from _servo import sines
from harness import CallablePart, Result

M, FV = 1.0, 0.4  # [kg], [N s/m]
FREQUENCIES = (1.0, 4.0, 9.0, 25.0)  # [Hz]
CASES = {"no F": (0.0, 0.0, GREY), "F = 1/P": (M, FV, BLUE), "mass in F 20 % off": (1.2 * M, FV, RED)}
SETTLED, PERIOD = 1.0, 1.0  # [s]
WIRES = (
    "reference.r -> minus.r",
    "reference.rd -> minus.rd",
    "mass.x -> minus.x",
    "mass.v -> minus.v",
    "minus.e -> C.r",
    "minus.ed -> C.rd",
    "reference.rd -> F.rd",
    "reference.rdd -> F.rdd",
    "C.u -> plus.u1",
    "F.u -> plus.u2",
    "plus.y -> mass.F_drive",
    "mass.v -> friction.v",
    "friction.F -> mass.F_friction",
)
ARROWS = (
    Arrow("reference", "minus", "r", at=(1.0, 0.1)),
    Arrow("minus", "C", "e"),
    Arrow("C", "plus"),
    Arrow("reference", "F", tap=(1.3, 0.0), via=((1.3, 1.6),)),
    Arrow("F", "plus", "f", via=((5.9, 1.6),)),
    Arrow("plus", "mass", "u", at=(6.45, 0.1)),
    Arrow("mass", "minus", "y", via=((9.9, 0.0), (9.9, -2.3), (1.9, -2.3)), at=(9.4, 0.1)),
    Arrow("mass", "friction", "v", tap=(8.3, -0.45), dot=False, end=(8.3, -1.0), at=(8.5, -0.9)),
    Arrow("friction", "mass", "F", tap=(7.3, -1.0), dot=False, end=(7.3, -0.45), at=(7.1, -0.9)),
)


def boxes(friction: str) -> dict[str, Box]:
    """Parts of the loop and their places."""
    error = CallablePart("minus", lambda t, u, x: u[:2] - u[2:], ["r", "rd", "x", "v"], ["e", "ed"], sampled=True)
    return {
        "reference": Box("reference", (0.0, 0.0), "Sine"),
        "minus": Box("", (1.9, 0.0), error, (0.0, 0.0), ("mass",)),
        "F": Box("F", (3.9, 1.6), "InverseDynamics"),
        "C": Box("C", (3.9, 0.0), "PID"),
        "plus": Box("", (5.9, 0.0), sum_of("plus", 1.0, 1.0), (0.0, 0.0)),
        "mass": Box("P: mass", (7.8, 0.0), "Mass", (1.8, 0.9)),
        "friction": Box("P: friction", (7.8, -1.4), friction, (1.8, 0.8)),
    }


def run(friction: str, m: float, Fv: float, reference: dict[str, float], stop: float) -> Result:
    """The loop with m and Fv in the feedforward."""
    start = {f"C.{name}": value for name, value in {**GAINS, "m": 0.0, "Ts": TS}.items()}
    start |= {"C.rdd": 0.0, "C.x": 0.0, "C.v": 0.0, "F.m": m, "F.Fv": Fv, "F.Ts": TS}
    start |= {f"reference.{name}": value for name, value in reference.items()}
    start |= {"friction.Fv": FV} if friction == "Viscous" else {}
    return run_loop(boxes(friction), WIRES, start, stop)


def transfer(frequency: float, m: float, Fv: float) -> complex:
    """(2.1) for the sampled loop."""
    s = 2j * pi * frequency
    z = np.exp(s * TS)
    a = exp(-FV / M * TS)
    moved = M * (1.0 - a) / FV
    A, b = np.array([[1.0, moved], [0.0, a]]), np.array([(TS - moved) / FV, moved / M])
    position, velocity = np.linalg.solve(z * np.eye(2) - A, b)
    of_error = GAINS["Kp"] + GAINS["Ki"] * TS / (z - 1.0)
    forward = m * s**2 + Fv * s
    return complex(
        position * (forward + of_error + GAINS["Kd"] * s) / (1.0 + position * of_error + velocity * GAINS["Kd"])
    )


def measured(m: float, Fv: float) -> Array:
    """y/r of the loop at the frequencies."""
    amplitudes = [(1e-3 / f**2, f, 0.3 * f) for f in FREQUENCIES]
    result = run("Viscous", m, Fv, sines(*amplitudes), SETTLED + PERIOD)
    late = slice(-round(PERIOD / TS) - 1, -1)
    t = result["time"].to_numpy()[late]
    x, r = (result[name].to_numpy()[late] for name in ("mass.x", "reference.r"))
    return np.array([np.exp(-2j * pi * f * t) @ x / (np.exp(-2j * pi * f * t) @ r) for f in FREQUENCIES])


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the diagram, the transfer functions and the error; check them against (2.1)."""
    figure, diagram, gain, trace = sheet("Feedback C and feedforward F", (9.4, 6.6), (1.0, 1.15))
    draw(diagram, boxes("Viscous"), WIRES, ARROWS)
    checks = []
    grid = np.geomspace(0.5, 50.0, 60)
    left = {}
    for name, (m, Fv, colour) in CASES.items():
        found = measured(m, Fv)
        known = np.array([transfer(f, m, Fv) for f in FREQUENCIES])
        left[name] = np.abs(1.0 - found)
        apart = float(np.abs(found - known).max())
        checks.append(small(f"{name}: largest difference of y/r from (2.1)", apart, 1e-6))
        gain.loglog(grid, [abs(1.0 - transfer(f, m, Fv)) for f in grid], color=colour, lw=1.5, label=name)
        gain.loglog(FREQUENCIES, left[name], "o", color=colour, ms=5)
    gain.set(xlabel="frequency [Hz]", ylabel="|1 - y/r|", ylim=(1e-7, 10.0))
    gain.legend(fontsize=8.5, loc="upper left")
    perfect, without, wrong = (left[name] for name in ("F = 1/P", "no F", "mass in F 20 % off"))
    share = float(perfect[-1] / without[-1])
    checks.append(near("25 Hz, F = 1/P: |1 - y/r| relative to that without F", share, pi * FREQUENCIES[-1] * TS, 0.05))
    checks.append(
        near("25 Hz, mass 20 % off: |1 - y/r| relative to that without F", float(wrong[-1] / without[-1]), 0.2, 0.05)
    )

    errors = {}
    for friction, colour in (("Viscous", BLUE), ("LuGre", BLACK)):
        result = run(friction, M, FV, sines((5e-3, 1.0, pi / 2.0)), 2.0)
        e = (result["reference.r"] - result["mass.x"]).to_numpy()[round(1.0 / TS) :]
        errors[friction] = rms(e)
        trace.plot(
            TS * np.arange(e.size), 1e6 * e, color=colour, lw=1.5, label=f"{friction}, F = 1/P of the linear part"
        )
    trace.set(xlabel="time [s]", ylabel="error [µm]", ylim=(-80.0, 110.0))
    trace.legend(fontsize=8.5, loc="upper left")
    save(figure, __file__, folder)
    share = errors["LuGre"] / errors["Viscous"]
    checks.append(Check("5 mm, 1 Hz: error with LuGre relative to that with viscous friction", share, "", 100.0))
    return Effect(
        f"From 1 to 25 Hz, |1 - y/r| is at most {perfect.max():.3f} with F = 1/P; at 25 Hz, a mass 20 % off leaves "
        f"{wrong[-1] / without[-1]:.2f} of the value without F. The error is {1e6 * errors['LuGre']:.0f} µm with LuGre "
        f"friction and {1e6 * errors['Viscous']:.3f} µm with viscous friction alone.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
