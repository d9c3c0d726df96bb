"""Leuven stores reversal points on stacks; Maxwell slip stores them in its elements

Left: a path with inner loops, the state z and the number of stored points. A reversal adds one point, closing a loop
removes two (a loop has two ends), and sliding removes all. Middle: with MaxwellSlip, the loops of 80 nested reversals
all close at the force of their reversal point, although it stores only ten numbers. Right: its price, a piecewise
linear curve.

On the right, the curve of first loading, 1 N (1 - exp(-x/10 µm)), is approximated by N elements that start to slip at
equal distances d up to 30 µm. Between these points it is a chord, so the error is below d^2/8 max|f''|: twice as many
elements leave a quarter of it.

Source: Swevers, Al-Bender, Ganseman, Prajogo, IEEE TAC 45(4), 2000; Lampaert, Swevers, Al-Bender, IEEE TAC 47(4),
2002.
"""

from pathlib import Path

import numpy as np

from _common import BLACK, BLUE, GREY, RED, Array, along, command_line, panels, polyline, save

SPEED, STEP = 1e-5, 5e-3  # [m/s], [s]: 50 nm a step
SHARP = {"n": 100.0}  # loops close in the position
CORNERS = [0.0, 10e-6, 2e-6, 8e-6, 4e-6, 12e-6, -40e-6]  # [m]
REVERSALS = 80
NESTED = [0.0] + [(-1) ** j * 1.5e-7 * (REVERSALS - j) for j in range(REVERSALS)] + [14e-6]  # [m]
LENGTH, END = 10e-6, 30e-6  # of the curve of first loading [m]
ELEMENTS = (2, 5, 10)


def stacks() -> tuple[Array, Array, Array]:
    """Time [s], z [m] and number of points kept by Leuven's model."""
    result = along("Leuven", polyline(CORNERS, SPEED, STEP), STEP, SHARP, ["depth", "z"])
    t, z, depth = (result[name].to_numpy() for name in ("time", "friction.z", "friction.depth"))
    return t, z, depth


def curve(x: Array) -> Array:
    """Curve of first loading [N]."""
    return np.asarray(1.0 - np.exp(-x / LENGTH))


def elements(N: int) -> dict[str, float]:
    """Stiffnesses and levels of N elements that slip at equal distances, with their sum on the curve there."""
    slips = np.linspace(0.0, END, N + 1)
    slopes = np.append(np.diff(curve(slips)) / np.diff(slips), 0.0)
    k = slopes[:-1] - slopes[1:]
    values = {"N": float(N)} | {f"k[{i}]": float(each) for i, each in enumerate(k, 1)}
    return values | {f"W[{i}]": float(each) for i, each in enumerate(k * slips[1:], 1)}


def main(folder: Path) -> str:
    """Draw the stacks, the loops and the polygons, check them."""
    figure, (stack, loops, polygon) = panels("Memory on stacks, and without", 1, 3, (10.4, 3.9))
    t, z, depth = stacks()
    stack.plot(t, 1e6 * z, color=BLUE, lw=1.4, label="z [µm]")
    stack.step(t, depth, where="post", color=RED, lw=1.4, label="points on the stacks")
    stack.set(xlabel="time [s]", title="Leuven", ylim=(-45.0, 25.0))
    stack.legend(fontsize=8.5, loc="upper left")

    x = polyline(NESTED, SPEED, 2.5e-3)
    F = along("MaxwellSlip", x, 2.5e-3)["friction.F"].to_numpy()
    turns = np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1
    maxima = turns[np.argsort(x[turns])][-REVERSALS // 2 :]
    out = np.interp(x[maxima], x[turns[-1] :], F[turns[-1] :])
    missed = float(np.abs(out - F[maxima]).max())
    loops.plot(1e6 * x, F, color=GREY, lw=0.5)
    loops.plot(1e6 * x[turns[-1] :], F[turns[-1] :], color=BLUE, lw=1.8, label="way out")
    loops.plot(1e6 * x[turns], F[turns], "o", color=BLACK, ms=2, label="reversal points")
    loops.set(xlabel="position [µm]", ylabel="friction [N]", title=f"MaxwellSlip, {REVERSALS} reversals")
    loops.legend(fontsize=8.5, loc="upper left")

    path = np.linspace(0.0, END, 601)
    errors = {}
    for N, colour in zip(ELEMENTS, (RED, BLUE, BLACK), strict=True):
        force = along("MaxwellSlip", path, STEP, elements(N))["friction.F"].to_numpy()
        errors[N] = float(np.abs(force - curve(path)).max())
        polygon.plot(1e6 * path, 1e3 * (force - curve(path)), color=colour, lw=1.2, label=f"N = {N}")
        bound = (END / N) ** 2 / 8.0 / LENGTH**2
        assert 0.4 * bound < errors[N] < bound
    polygon.set(xlabel="position [µm]", ylabel="error of the curve [mN]", title="MaxwellSlip")
    polygon.legend(fontsize=8.5)
    save(figure, __file__, folder)

    x = polyline(CORNERS, SPEED, STEP)
    steps = np.diff(depth)
    turning = np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1
    assert np.array_equal(np.flatnonzero(steps == 1), turning)  # each reversal, in the step that follows
    fresh = float(np.abs(z[turning + 1]).max())
    assert fresh < 6e-8  # one step after 0
    forgotten = np.flatnonzero(steps < 0)
    assert list(steps[forgotten]) == [-2, -2, -1]  # two inner loops close, and then the contact slides
    assert np.abs(x[forgotten[:2] + 1] - [8e-6, 10e-6]).max() < 6e-8  # where these loops began
    assert depth[-1] == 0
    assert missed < 1e-12  # N, rounding
    return (
        f"Leuven stores {turning.size} points, with z within {1e6 * fresh:.2f} µm of zero one step later, and none in "
        f"sliding. With Maxwell slip {maxima.size} of {maxima.size} loops close to 1e-12 N. N = 2, 5 and 10 elements "
        f"miss the curve by " + ", ".join(f"{1e3 * errors[N]:.0f}" for N in ELEMENTS) + " mN."
    )


if __name__ == "__main__":
    command_line(main)
