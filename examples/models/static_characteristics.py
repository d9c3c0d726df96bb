"""Static models define friction in sliding, but not at rest

Left: Coulomb friction, viscous friction and static friction above the Coulomb level. Right: the Stribeck curve. At v =
0 friction takes any value up to Fs (vertical lines), so the static blocks have an input for the other forces. In
steady sliding LuGre ends on the curve (dots).

LuGre has separate parameters for v < 0 if wanted. The Stribeck part as a function of the velocity has to be odd. With
Tustin's (Fs - Fc) exp(-|v|/vs), taken as it is, friction at v < 0 is that at v > 0 less twice Fc and the viscous part,
and pushes the mass along (dotted).

Source: Olsson, Astrom, Canudas de Wit, Gaefvert, Lischinsky, European Journal of Control 4(3), 1998.
"""

from collections.abc import Mapping
from math import exp
from pathlib import Path

import numpy as np

from _common import BLACK, BLUE, GREEN, RED, Array, along, command_line, panels, save

SPEEDS = np.array([1e-5, 1e-4, 2e-4, 3e-4, 5e-4, 7e-4, 1e-3, 1.4e-3, 2e-3, 3e-3, 5e-3, 0.01, 0.02])  # [m/s]
FC, FS, FV, VS = 1.0, 1.5, 0.4, 1e-3  # start values of the blocks
STEEP = 40.0  # viscous coefficient of the figure, so that it can be seen [N s/m]
HELD = 100.0  # how long each velocity is held [s]
OTHER_WAY = {"asymmetric": 1.0, "Fc_neg": 0.7, "Fs_neg": 1.2, "sigma2_neg": STEEP}
NO_FORCE = {"F_ext": 0.0}


def forces(model: str, velocities: Array, parameters: Mapping[str, float]) -> Array:
    """Friction [N] at the end of holding each velocity [m/s]."""
    path = np.concatenate([[0.0], np.cumsum(velocities) * HELD])
    return np.asarray(along(model, path, HELD, parameters)["friction.F"].to_numpy()[1:])


def at_rest(model: str, push: float) -> float:
    """Friction [N] against a force [N] at v = 0."""
    return float(along(model, np.zeros(2), HELD, {"F_ext": push})["friction.F"][-1])


def stribeck(v: Array, Fc: float, Fs: float, Fv: float) -> Array:
    """Curve of the block Stribeck with delta = 2."""
    return np.asarray(np.sign(v) * (Fc + (Fs - Fc) * np.exp(-((v / VS) ** 2))) + Fv * v)


def even(v: Array) -> Array:
    """Return (1.3) with Tustin's term as printed."""
    return np.asarray(FC * np.sign(v) + STEEP * v + (FS - FC) * np.exp(-np.abs(v) / VS))


def main(folder: Path) -> str:
    """Draw the curves, check them against their equations."""
    v = np.concatenate([-SPEEDS[::-1], SPEEDS])
    viscous = {"Fv": STEEP}
    figure, (basic, curve) = panels("Friction over velocity; at rest it can take any value up to Fs", 1, 2, (9.4, 4.2))
    coulomb = forces("Coulomb", v, NO_FORCE)
    film = forces("Viscous", v, viscous)
    stiction = forces("Stiction", v, viscous | NO_FORCE)
    falling = forces("Stribeck", v, viscous | NO_FORCE)
    bristles = forces("LuGre", v, {"sigma2": STEEP} | OTHER_WAY)
    tustin = forces("Tustin", v, viscous | NO_FORCE)
    for axis, lines in (
        (
            basic,
            [("Coulomb", coulomb, BLACK, 2.6), ("viscous", film, GREEN, 1.5), ("all with Fs", stiction, BLUE, 1.5)],
        ),
        (curve, [("Stribeck", falling, BLUE, 2.0), ("Tustin", tustin, BLACK, 1.2)]),
    ):
        for label, force, colour, width in lines:
            for half in (v < 0.0, v > 0.0):
                axis.plot(1e3 * v[half], force[half], color=colour, lw=width, label=label if half[-1] else None)
        axis.plot([0.0, 0.0], [-FS, FS], color=RED, lw=1.5, label="at rest: any value up to Fs")
        axis.set(xlabel="velocity [mm/s]", xlim=(-10.0, 10.0), ylim=(-2.0, 3.6), yticks=(-1.5, -1.0, 0.0, 1.0, 1.5))
    curve.plot(1e3 * v, bristles, "o", color=GREEN, ms=4, label="LuGre, other levels for v < 0")
    for half in (v < 0.0, v > 0.0):
        even_label = "with an even term" if half[-1] else None
        curve.plot(1e3 * v[half], even(v)[half], color=RED, ls=":", lw=1.5, label=even_label)
    basic.set_ylabel("friction force [N]")
    basic.legend(loc="upper left", fontsize=8.5)
    curve.legend(loc="upper left", fontsize=8.5)
    save(figure, __file__, folder)

    load = forces("Coulomb", v, {"Fn": 2.0} | NO_FORCE)  # twice the normal force
    assert np.array_equal(coulomb, FC * np.sign(v)) and np.array_equal(load, 2.0 * coulomb)
    assert np.allclose(film, STEEP * v, rtol=1e-12)
    assert np.allclose(stiction, coulomb + film, rtol=1e-12)
    assert np.allclose(falling, stribeck(v, FC, FS, STEEP), rtol=1e-12)
    assert 0 < np.argmin(falling[v > 0.0]) < SPEEDS.size - 1  # it falls, and then rises
    assert [at_rest("Stiction", push) for push in (-2.0, 0.5, 1.2, 2.0)] == [-FS, 0.5, 1.2, FS]
    back = stribeck(v, OTHER_WAY["Fc_neg"], OTHER_WAY["Fs_neg"], STEEP)
    apart = float(np.abs(bristles - np.where(v < 0.0, back, falling)).max())
    # the bristles of the slowest motion have gone 1 mm, 1e-3 m sigma0/Fs = 67 times their length
    assert apart < 1e-9
    assert np.allclose(tustin + tustin[::-1], 0.0, atol=1e-12)
    wrong = float((even(v) + even(-v)).max())
    assert abs(wrong - 2.0 * (FS - FC) * exp(-SPEEDS[0] / VS)) < 1e-12
    return (
        f"At rest friction takes any value up to {at_rest('Stiction', 2.0):g} N. In steady sliding LuGre is within "
        f"1e-9 N of the Stribeck curve. With an even term, the Stribeck curve differs by {wrong:.2f} N from an "
        "odd function."
    )


if __name__ == "__main__":
    command_line(main)
