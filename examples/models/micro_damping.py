"""The bristle damping sigma1 matters in presliding, and little beyond

A mass of 1 kg on LuGre friction, with sigma1 and without it. A step of 1 mN moves it by 10 nm, where the contact is a
spring with a damper: without sigma1 it rings. A force of 3 N for 50 ms moves it by 7 mm, and there the two motions
differ by only a few per cent.

In presliding the contact is the spring sigma0 with the damper sigma1 + sigma2. The overshoot is that of a linear
oscillator, exp(-pi zeta/sqrt(1 - zeta^2)) with zeta = (sigma1 + sigma2)/(2 sqrt(sigma0 m)), which is 0.5 with sigma1.
The difference over millimetres comes from the first moments, in which the contact is still elastic.

Source: Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995 (the model).
"""

from collections.abc import Callable
from math import exp, pi, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from _common import BLUE, RED, Array, command_line, panels, save
from friction_fmus import build
from harness import CallablePart, FmuPart, Port, System

SIGMA0, SIGMA1, SIGMA2 = 1e5, 316.22776601683796, 0.4  # [N/m], [N s/m], [N s/m]
SMALL, LARGE, LONG = 1e-3, 3.0, 0.05  # [N], [N], [s]


def pushed(sigma1: float, push: Callable[[float], float], stop: float) -> tuple[Array, Array]:
    """Time [s] and position [m] of 1 kg."""
    drive = CallablePart("drive", lambda t, u, x: push(t), outputs=[Port("F", "N")])
    wires = ["drive.F -> mass.F_drive", "mass.v -> friction.v", "friction.F -> mass.F_friction"]
    with TemporaryDirectory() as folder:
        parts = [drive, *(FmuPart(n, build(m, Path(folder))) for n, m in (("mass", "Mass"), ("friction", "LuGre")))]
        with System(parts, wires, {"friction.sigma1": sigma1}) as system:
            run = system.run(stop=stop, step=1e-4, master="newton")
    return run["time"].to_numpy(), run["mass.x"].to_numpy()


def overshoot(sigma1: float) -> float:
    """Of a linear oscillator, over its final value."""
    zeta = (sigma1 + SIGMA2) / (2.0 * sqrt(SIGMA0))
    return exp(-pi * zeta / sqrt(1.0 - zeta**2))


def main(folder: Path) -> str:
    """Draw both motions, check the overshoot and how far the large ones are apart."""
    figure, axes = panels("The bristle damping sigma1 matters in presliding", 1, 2, (9.0, 3.9))
    found = {}
    cases: tuple[tuple[str, Callable[[float], float], float, float], ...] = (
        ("nm", lambda t: SMALL, 0.1, 1e9),
        ("mm", lambda t: LARGE if t < LONG else 0.0, 0.2, 1e3),
    )
    for axis, (unit, push, stop, scale) in zip(axes, cases, strict=True):
        for sigma1, colour in ((0.0, RED), (SIGMA1, BLUE)):
            t, x = found[unit, sigma1] = pushed(sigma1, push, stop)
            axis.plot(1e3 * t, scale * x, color=colour, lw=1.5, label=f"sigma1 = {sigma1:.0f} N s/m")
        axis.set(xlabel="time [ms]", ylabel=f"position [{unit}]")
        axis.legend(fontsize=9, loc="lower right")
    save(figure, __file__, folder)

    for sigma1 in (0.0, SIGMA1):
        peak = found["nm", sigma1][1].max() / (SMALL / SIGMA0) - 1.0
        assert abs(peak - overshoot(sigma1)) < 0.01
    with_it, without = (found["mm", sigma1][1] for sigma1 in (SIGMA1, 0.0))
    apart = float(np.abs(with_it - without).max() / with_it[-1])
    assert apart < 0.1
    small = float(np.abs(found["nm", SIGMA1][1] - found["nm", 0.0][1]).max() / (SMALL / SIGMA0))
    assert small > 0.8
    return (
        f"After a step of 1 mN the overshoot is {100.0 * overshoot(SIGMA1):.0f} % with sigma1 and "
        f"{100.0 * overshoot(0.0):.1f} % without; the motions differ by {100.0 * small:.0f} %. Over "
        f"{1e3 * with_it[-1]:.1f} mm they differ by {100.0 * apart:.1f} %."
    )


if __name__ == "__main__":
    command_line(main)
