"""An asperity sticks, slips, detaches, oscillates and lands

Left: an asperity of GenericAsperity, a tip mass on three springs: normal, tangential, and one whose hysteresis damps
the free tip. Right: its force on a rough profile. It sticks like a spring, breaks away, slips uphill until slip becomes
unstable, detaches, oscillates, and lands without load.

The asperity starts at a crest, without adhesion and creep. The script solves each phase on its own. Stuck: F = k_t x,
up to mu0 N with N = k_n (h + A). In slip the tip p is where the force of the spring balances the profile w = A cos(2 pi
p/wavelength): x = g(p) = p + N(p) (w'(p) + mu0)/k_t. It detaches where dg/dp = 0. Free, the deflection d is a damped
oscillation, m d'' + c d' + k_t d = 0, from d' = v; its envelope falls to 1 %. Then F = k_t times the path since then.

Source: after Al-Bender, Lampaert, Swevers, Tribology Letters 16, 2004; the equations are those of the block.
"""

from math import cos, log, pi, sin, sqrt
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Rectangle
from scipy.optimize import brentq

from _common import BLACK, BLUE, GREEN, RED, Array, along, command_line, panels, save
from _sketch import FILL, arrow, blank, spring

K_N, K_T, K_H, M = 2e5, 5e3, 2e3, 1e-7  # springs [N/m] and mass of the tip [kg]
HEIGHT, A, WAVELENGTH, MU0 = 1e-6, 2.5e-7, 1e-5, 0.25  # [m], [m], [m]
BLOCK = {"N": 1.0, "k_n": K_N, "k_t": K_T, "k_h": K_H, "m": M, "height": HEIGHT, "A": A, "wavelength": WAVELENGTH}
BLOCK |= {"mu0": MU0, "dmu": 0.0, "creep": 0.0, "height_spread": 0.0, "wavelength_spread": 0.0, "position_spread": 0.0}
SPEED, STEP, END = 1e-2, 2e-7, 4e-5  # [m/s], [s], [m]: 2 nm a step
ALPHA, C = 2.0 * pi / WAVELENGTH, K_H * sqrt(M / K_T)  # [1/m], damping of the free tip [N s/m]


def pull(p: float) -> float:
    """Force of the tangential spring in slip forward [N]."""
    return K_N * (HEIGHT + A * cos(ALPHA * p)) * (MU0 - A * ALPHA * sin(ALPHA * p))


def slope(p: float) -> float:
    """Derivative of the pull [N/m]."""
    w, rise = A * cos(ALPHA * p), -A * ALPHA * sin(ALPHA * p)
    return K_N * (rise * (MU0 + rise) - (HEIGHT + w) * ALPHA**2 * w)


def phases() -> tuple[float, float, float, float]:
    """Return the paths [m] at which it breaks away, detaches and lands, and the tip's position where it detaches."""
    breaks = pull(0.0) / K_T
    last = brentq(lambda p: 1.0 + slope(p) / K_T, 0.6 * WAVELENGTH, WAVELENGTH, xtol=1e-18)
    detaches = last + pull(last) / K_T
    return breaks, detaches, detaches + SPEED * log(100.0) * 2.0 * M / C, last


def expected(x: Array) -> Array:
    """Return the force over the path [N]."""
    breaks, detaches, lands, last = phases()
    F = K_T * x
    for i in np.flatnonzero((x > breaks) & (x < detaches)):
        F[i] = pull(brentq(lambda p, b=x[i]: p + pull(p) / K_T - b, 0.3 * WAVELENGTH, last, xtol=1e-18))
    rate = C / (2.0 * M)
    t, d0, frequency = (x - detaches) / SPEED, detaches - last, sqrt(K_T / M - rate**2)
    decay, cosine, sine = np.exp(-rate * np.maximum(t, 0.0)), np.cos(frequency * t), np.sin(frequency * t)
    push = (SPEED + rate * d0) / frequency
    d = decay * (d0 * cosine + push * sine)
    d_rate = -rate * d + decay * frequency * (push * cosine - d0 * sine)
    F = np.where(x > detaches, K_T * d + C * d_rate, F)
    return np.where(x > lands, K_T * (x - lands), F)


def sketch(axis: Axes) -> None:
    """The asperity between the slider and the profile."""
    blank(axis, xlim=(0.0, 10.0), ylim=(-0.8, 8.0))
    axis.add_patch(Rectangle((0.8, 5.6), 8.4, 1.2, facecolor=FILL, edgecolor=BLACK, lw=1.5))
    arrow(axis, (1.6, 7.3), (3.6, 7.3), "x, v", (4.3, 7.3))
    p = np.linspace(0.4, 9.6, 200)
    axis.plot(p, 0.9 + 0.35 * np.cos(2.2 * (p - 5.0)), color=BLACK, lw=1.8)
    axis.fill_between(p, 0.9 + 0.35 * np.cos(2.2 * (p - 5.0)), -0.2, color="#eeeeee")
    axis.plot([2.0, 2.0], [5.6, 1.9], color=BLACK, lw=1.5)  # arms of the slider that hold the springs beside the tip
    axis.plot([8.0, 8.0], [5.6, 1.9], color=BLACK, lw=1.5)
    spring(axis, (5.0, 5.6), (5.0, 1.9))
    spring(axis, (2.0, 1.9), (4.65, 1.7))
    spring(axis, (8.0, 1.9), (5.35, 1.7))
    axis.add_patch(Circle((5.0, 1.6), 0.38, facecolor=FILL, edgecolor=BLACK, lw=1.5, zorder=3))
    for label, at in (
        ("m", (5.0, 1.6)),
        ("k_n", (5.75, 3.8)),
        ("k_t", (3.3, 2.7)),
        ("k_h", (6.7, 2.7)),
        ("w(p)", (1.3, 0.4)),
    ):
        axis.text(*at, f"${label}$", fontsize=11, ha="center", va="center", zorder=4)


def main(folder: Path) -> str:
    """Draw the asperity and its force, check the force and the phases."""
    x = np.arange(0.0, END, SPEED * STEP)
    result = along("GenericAsperity", x, STEP, BLOCK, ["stuck", "slipping", "loose"])
    F = result["friction.F"].to_numpy()
    modes = {"stuck": ("stuck", BLUE), "slipping": ("slipping", GREEN), "loose": ("free", RED)}

    figure, (drawing, force) = panels("One asperity sticks, slips, detaches and lands", 1, 2, (9.4, 4.2))
    sketch(drawing)
    for mode, (label, colour) in modes.items():
        on = result[f"friction.{mode}"].to_numpy() > 0.5
        force.plot(1e6 * x, np.where(on, 1e3 * F, np.nan), color=colour, lw=1.6, label=label)
    force.set(xlabel="path [µm]", ylabel="force [mN]")
    force.legend(fontsize=9)
    save(figure, __file__, folder)

    breaks, detaches, lands, _ = phases()
    for mode, (begin, end) in zip(modes, ((0.0, breaks), (breaks, detaches), (detaches, lands)), strict=True):
        at = x[result[f"friction.{mode}"].to_numpy() > 0.5]
        at = at[at < lands]
        assert abs(at[0] - begin) <= 2.0 * SPEED * STEP and abs(at[-1] - end) <= 2.0 * SPEED * STEP
    off = np.abs(F - expected(x))[np.abs(x - breaks) > 1e-12]  # the force jumps there
    assert off.max() < 1e-9
    return (
        f"It breaks away after {1e6 * breaks:.1f} µm at {1e3 * K_T * breaks:.1f} mN, detaches after "
        f"{1e6 * detaches:.1f} µm at {1e3 * pull(phases()[3]):.1f} mN and lands {1e6 * (lands - detaches):.2f} µm "
        "later. The force agrees with the solution of each phase to 1e-9 N."
    )


if __name__ == "__main__":
    command_line(main)
