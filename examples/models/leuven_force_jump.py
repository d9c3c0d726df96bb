"""Leuven's force jumps where an inner loop closes; ModifiedLeuven's does not

When a path from 0 to 6 µm, back to -6 µm and on to 14 µm passes 6 µm again, the inner loop closes. Leuven's force jumps
there, although the velocity is continuous and far from zero.

The path consists of half cosines. In Leuven's model the ratio r = Fd / (S - Fb), on which dz/dt = v (1 - r^n) depends,
becomes Fh / S when the base Fb of the inner loop is dropped, and the force jumps by sigma1 v (r_before^n - r_after^n).
In ModifiedLeuven r is always Fh / S. With half the step, the largest change of its force in one step is half as large;
the jump of Leuven remains.

Source: Swevers, Al-Bender, Ganseman, Prajogo, IEEE TAC 45(4), 2000; Lampaert, Swevers, Al-Bender, IEEE TAC 47(4),
2002.
"""

from itertools import pairwise
from math import exp
from pathlib import Path

import numpy as np

from _common import BLUE, RED, Array, along, command_line, panels, save

CORNERS = 1e-6 * np.array([0.0, 6.0, -6.0, 14.0])  # [m]
LEG = 0.02  # [s]
sigma1, n, Fc, Fs, vs = 1e5**0.5, 2.0, 1.0, 1.5, 1e-3  # start values of Leuven


def half_cosines(steps: int) -> Array:
    """Return the path [m] with this number of steps per leg."""
    rise = 0.5 * (1.0 - np.cos(np.pi * np.arange(1, steps + 1) / steps))
    legs = [start + (end - start) * rise for start, end in pairwise(CORNERS)]
    return np.concatenate([CORNERS[:1], *legs])


def main(folder: Path) -> str:
    """Draw both forces, compare the jump with its closed form."""
    figure, (whole, near) = panels(
        "Leuven's force jumps where an inner loop closes, ModifiedLeuven's does not", 1, 2, (9.0, 4.0)
    )
    largest = {}
    for model, colour in (("Leuven", RED), ("ModifiedLeuven", BLUE)):
        for steps in (2000, 4000):
            x = half_cosines(steps)
            result = along(model, x, LEG / steps, record=["depth", "Fh", "Fb"] if model == "Leuven" else [])
            F = result["friction.F"].to_numpy()
            largest[model, steps] = np.abs(np.diff(F)).max()
            if model == "Leuven":
                leuven = result
        for axis, scale in ((whole, x), (near, result["time"].to_numpy())):
            axis.plot((1e6 if axis is whole else 1e3) * scale, F, color=colour, lw=1.4, label=model)

    depth = leuven["friction.depth"].to_numpy()
    (last,) = np.flatnonzero((depth[:-1] == 2) & (depth[1:] == 0))  # the last sample before the loop closes
    v, Fh, Fb = (float(leuven[name][last]) for name in ("path.v", "friction.Fh", "friction.Fb"))
    S = Fc + (Fs - Fc) * exp(-((v / vs) ** 2))
    expected = sigma1 * v * (((Fh - Fb) / (S - Fb)) ** n - (Fh / S) ** n)

    at, F = 1e3 * float(leuven["time"][last]), leuven["friction.F"].to_numpy()
    middle = 0.5 * (F[last] + F[last + 1])
    near.annotate(
        f"jump of {F[last + 1] - F[last]:.3f} N",
        (at, middle),
        (at + 0.5, middle - 0.05),
        arrowprops={"arrowstyle": "->"},
    )
    near.set(
        xlim=(at - 3.0, at + 3.0), ylim=(F[last] - 0.2, F[last] + 0.2), xlabel="time [ms]", title="around the closing"
    )
    whole.set(xlabel="position [µm]", ylabel="friction force [N]", title="whole path")
    whole.legend(loc="upper left", fontsize=9)
    save(figure, __file__, folder)

    assert v > vs  # no reversal
    for steps in (2000, 4000):  # N; apart from the jump the force changes by less than 0.2 mN in a step
        assert abs(largest["Leuven", steps] - expected) < 5e-4
    assert largest["ModifiedLeuven", 4000] < 0.6 * largest["ModifiedLeuven", 2000]
    return (
        f"At {1e3 * v:.2f} mm/s Leuven's force jumps by {largest['Leuven', 4000]:.3f} N (closed form: {expected:.3f} "
        f"N). In a step of 5 µs ModifiedLeuven's force changes by at most {largest['ModifiedLeuven', 4000]:.4f} N."
    )


if __name__ == "__main__":
    command_line(main)
