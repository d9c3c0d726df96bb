"""Feedforward, observer and repetitive control each remove part of the error

A cascade with friction feedforward F, a disturbance observer (the inverse model of the plant and a low-pass Q) and a
repetitive controller RC. The diagram shows the parts and connections of the system that is run; below is the error
over a revolution, with one compensation after the other.

The plant is an axis with GMS friction on a circle of 10 mm radius, a revolution in 0.6 s. F contains the inertia; its
GMS model has stiffnesses and levels 10 % too low. The observer gets the friction share f of F, so that it looks for
the rest only; RC learns from the position error at a rate of 0.7. At first each revolution leaves 0.3 of the error of
the one before. The loop that RC inverts is that of the cascade, with or without the observer, as long as the observer
gets the force of RC and the mass is right.

Source: Jamaludin, Van Brussel, Swevers, IEEE Trans. Industrial Electronics 56(10), 2009.
"""

from math import cos, pi
from pathlib import Path
from typing import Any

import numpy as np

from _diagram import Arrow, Box, draw, run_loop, sheet, sum_of
from _effect import Check, Effect, command_line
from _loop import BLUE, GREEN, GREY, OMEGA, RED, TS, Array, rms, save
from harness import CallablePart, Wire

RADIUS, START, PERIOD = 10e-3, pi / 4.0, 0.6  # [m], [rad], [s]
M, KP, KV, KI = 1.0, OMEGA / 2.0, 3.0 * OMEGA, 1.5 * OMEGA**2  # mass [kg], gains of the cascade
OFF = 0.9  # forces of the model over the true ones
STIFFNESS = (28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3, 2.1e3)  # of the elements of the plant [N/m]
FIRST, LAST = 2, 7  # revolutions: the first at full speed, the last
CASES = {
    "cascade": (0.0, 0.0, 0.0),
    "and F": (1.0, 0.0, 0.0),
    "and observer": (1.0, 1.0, 0.0),
    "and RC": (1.0, 1.0, 1.0),
}
COLOURS = dict(zip(CASES, (GREY, GREEN, BLUE, RED), strict=True))
WIRES = (
    "reference.x -> minus.u1",
    "mass.x -> minus.u2",
    "minus.y -> kp.e",
    "kp.v -> speed.u1",
    "reference.xd -> speed.u2",
    "mass.v -> speed.u3",
    "speed.y -> PI.rd",
    "PI.u -> plus.u1",
    "reference.x -> F.r",
    "reference.xd -> F.rd",
    "reference.xdd -> F.rdd",
    "F.u -> plus.u2",
    "observer.u -> plus.u3",
    "minus.y -> RC.r",
    "RC.u -> plus.u4",
    "plus.y -> mass.F_drive",
    Wire("plus.y", "observer.u_prev", delay=1),
    Wire("F.F_hat", "observer.f_prev", delay=1),
    "mass.v -> observer.v",
    "mass.v -> friction.v",
    "friction.F -> mass.F_friction",
)
BOXES = {
    "reference": Box("reference", (0.0, 0.0), "Circle"),
    "minus": Box("", (1.9, 0.0), sum_of("minus", 1.0, -1.0), (0.0, 0.0), ("mass",)),
    "kp": Box("kp", (3.5, 0.0), CallablePart("kp", lambda t, u, x: KP * u, ["e"], ["v"], sampled=True), (1.2, 0.9)),
    "speed": Box("", (5.1, 0.0), sum_of("speed", 1.0, 1.0, -1.0), (0.0, 0.0), ("mass",)),
    "PI": Box("kv + ki/s", (6.7, 0.0), "CascadePPI"),
    "F": Box("F: GMS", (6.7, 1.7), "GMSFeedforward"),
    "RC": Box("RC", (6.7, 2.9), "RepetitiveController"),
    "observer": Box("1/P, Q", (8.6, -2.9), "DisturbanceObserver", (2.4, 0.9)),
    "plus": Box("", (8.6, 0.0), sum_of("plus", 1.0, 1.0, 1.0, 1.0), (0.0, 0.0)),
    "mass": Box("P: mass", (10.9, 0.0), "Mass", (1.8, 0.9)),
    "friction": Box("P: friction", (10.9, -1.4), "GMS", (1.8, 0.8)),
}
ARROWS = (
    Arrow("reference", "minus", "r", at=(1.0, 0.1)),
    Arrow("minus", "kp", "e", at=(2.68, 0.08)),
    Arrow("kp", "speed"),
    Arrow("reference", "speed", "ṙ", tap=(1.3, 0.85), via=((5.1, 0.85),)),
    Arrow("speed", "PI"),
    Arrow("PI", "plus"),
    Arrow("reference", "F", tap=(1.3, 0.0), via=((1.3, 1.7),)),
    Arrow("F", "plus", via=((8.6, 1.7),)),
    Arrow("minus", "RC", tap=(2.45, 0.0), via=((2.45, 2.9),)),
    Arrow("RC", "plus", via=((9.3, 2.9), (9.3, 0.7))),
    Arrow("plus", "mass", "u", at=(9.45, 0.1)),
    Arrow("plus", "observer", tap=(9.3, 0.0), end=(9.3, -2.45)),
    Arrow("F", "observer", "f", tap=(7.8, 1.7), end=(7.8, -2.45), at=(7.65, -1.4)),
    Arrow("observer", "plus"),
    Arrow("mass", "observer", "v", tap=(11.8, -0.25), dot=False, via=((12.4, -0.25), (12.4, -2.9)), at=(12.6, -1.5)),
    Arrow("mass", "speed", tap=(12.4, -2.9), via=((12.4, -3.8), (5.1, -3.8))),
    Arrow("mass", "minus", "y", via=((13.0, 0.0), (13.0, -4.3), (1.9, -4.3))),
    Arrow("mass", "friction", tap=(11.4, -0.45), dot=False, end=(11.4, -1.0)),
    Arrow("friction", "mass", tap=(10.4, -1.0), dot=False, end=(10.4, -0.45)),
)


def errors(forward: float, observer: float, repetitive: float, revolutions: int) -> Array:
    """Error in each revolution [m], shape (revolutions, samples), with shares of the compensations."""
    N = round(PERIOD / TS)
    values = {
        "reference": {"radius": RADIUS, "feed": 2.0 * pi * RADIUS / PERIOD, "start_angle": START, "t_ramp": PERIOD},
        "PI": {"kp": 0.0, "kv": KV, "ki": KI, "m": 0.0, "r": 0.0, "rdd": 0.0, "x": 0.0, "v": 0.0},
        "F": {"m": M, "gain": forward, "Fc": OFF, "Fs": 1.5 * OFF}
        | {f"k[{i}]": OFF * k for i, k in enumerate(STIFFNESS, 1)},
        "observer": {"m": M, "gain": observer, "fq": 30.0},
        "RC": {"m": M, "Kp": KV * KP + KI, "Kd": KV, "Ki": KI * KP, "N": N, "M": 64, "fq": 100.0, "x": 0.0}
        | {"rate": 0.7, "gain": repetitive},
        "mass": {"x0": RADIUS * cos(START)},
    }
    start = {f"{part}.{name}": value for part, given in values.items() for name, value in given.items()}
    start |= {f"{part}.Ts": TS for part in ("PI", "F", "observer", "RC")}
    result = run_loop(BOXES, WIRES, start, revolutions * PERIOD, record=["reference.x", "mass.x"])
    error = (result["reference.x"] - result["mass.x"]).to_numpy()
    return np.asarray(error[1 : revolutions * N + 1].reshape(-1, N))


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the diagram and the errors, check that each addition takes a part of the rest."""
    figure, diagram, revolution, course = sheet(
        "Cascade, feedforward, observer and repetition", (9.4, 7.4), (1.25, 1.0)
    )
    draw(diagram, BOXES, WIRES, ARROWS)
    found = {}
    for name, shares in CASES.items():
        found[name] = errors(*shares, LAST + 1 if shares[2] else FIRST + 1)
        style: dict[str, Any] = {"color": COLOURS[name], "lw": 1.3, "label": name}
        late = 1e6 * found[name][-1]
        revolution.plot(360.0 * np.arange(late.size) / late.size, late, **style)
        each = [1e6 * rms(row) for row in found[name][FIRST:]]
        each *= LAST - FIRST + 1 if len(each) == 1 else 1
        course.semilogy(range(FIRST, LAST + 1), each, "o-", ms=4, **style)
    revolution.set(xlabel="angle from the start of the revolution [°]", ylabel="error [µm]", xticks=range(0, 361, 90))
    course.set(xlabel="revolution", ylabel="error, rms [µm]", xticks=range(FIRST, LAST + 1))
    course.legend(fontsize=8.5, loc="center right")
    save(figure, __file__, folder)

    cascade, forward, observer, all_of_them = (1e9 * rms(found[name][-1]) for name in CASES)
    learning = [rms(row) for row in found["and RC"][FIRST:]]
    checks = (
        Check("cascade: error", cascade, "nm"),
        Check("F: error", forward, "nm"),
        Check("F and observer: error", observer, "nm"),
        Check("F, observer and RC: error", all_of_them, "nm"),
        Check("F over cascade", forward / cascade, "", 0.05, 0.16),
        Check("F and observer over F", observer / forward, "", 0.0, 0.35),
        Check("F, observer and RC over F and observer", all_of_them / observer, "", 0.0, 0.1),
        Check(
            "RC: error of a revolution relative to that of the one before", learning[1] / learning[0], "", 0.25, 0.35
        ),
    )
    return Effect(
        f"The rms error falls from {1e-3 * cascade:.1f} µm to {1e-3 * forward:.2f} µm with feedforward, "
        f"{observer:.0f} nm with the observer added and {all_of_them:.0f} nm with the repetitive controller added.",
        checks,
    )


if __name__ == "__main__":
    command_line(main)
