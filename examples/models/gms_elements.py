"""A GMS element sticks as a spring and is then attracted to its level

Left: the elements of GMS. Right: three elements at 0.2 mm/s, after 0.3 s at 20 mm/s, and back. Each sticks until its
deflection z_i reaches the level s_i(v) (dashed). After the jump of the speed it is attracted to the lower level at a
finite rate: friction lags.

The script compares (1.22) and (1.23) with the FMU: until it slips z_i = v t; in slip at constant speed, z_i - s_i falls
as exp(-C t/S). Here s_i = sgn(v) alpha_i S(v)/k_i, and the rate C_i of (1.23) is C alpha_i/k_i. The sigma_i of (1.21)
multiplies dz_i/dt and is thus a damping in N s/m, not a stiffness: with sigma > 0 the force of the FMU is higher by the
sum of sigma dz_i/dt.

Source: Al-Bender, Lampaert, Swevers, IEEE TAC 50(11), 2005.
"""

from math import copysign, exp
from pathlib import Path

import numpy as np

from _common import BLUE, GREEN, RED, Array, along, command_line, panels, save
from _sketch import elements

K, ALPHA = np.array([8e4, 2e4, 1e4]), np.array([0.4, 0.35, 0.25])  # [N/m]
FC, FS, VS, C, SIGMA = 1.0, 1.5, 1e-3, 100.0, 20.0  # [N], [N], [m/s], [N/s], [N s/m]
SLOW, FAST, STEP = 2e-4, 2e-2, 1e-4  # [m/s], [m/s], [s]
JUMP, TURN, END = 3000, 3500, 3700  # [steps]


def levels(v: float) -> Array:
    """Deflections that the elements are attracted to [m]."""
    return np.asarray(copysign(FC + (FS - FC) * exp(-((v / VS) ** 2)), v) * ALPHA / K)


def main(folder: Path) -> str:
    """Draw the elements and their deflections, check them against the equations."""
    v = np.concatenate([np.full(JUMP, SLOW), np.full(TURN - JUMP, FAST), np.full(END - TURN, -FAST)])
    x, t = STEP * np.cumsum([0.0, *v]), STEP * np.arange(END + 1)
    parameters = {"N": 3.0, "Fc": FC, "Fs": FS, "vs": VS, "C": C, "sigma2": 0.0}
    parameters |= {f"k[{i}]": k for i, k in enumerate(K, 1)} | {f"alpha[{i}]": a for i, a in enumerate(ALPHA, 1)}
    names = [f"Fi[{i}]" for i in (1, 2, 3)]
    result = along("GMS", x, STEP, parameters, names)
    damped = along("GMS", x, STEP, parameters | {"sigma": SIGMA})
    z = np.stack([result[f"friction.{name}"].to_numpy() for name in names], axis=1) / K

    figure, (drawing, motion) = panels("GMS: springs that are attracted to a level in slip", 1, 2, (9.4, 4.2))
    elements(drawing, "x, v", "s", deflection="z")
    for i, colour in enumerate((BLUE, GREEN, RED)):
        motion.plot(1e3 * t, 1e6 * z[:, i], color=colour, lw=1.6, label=f"$z_{i + 1}$")
        for start, end, speed in ((0, JUMP, SLOW), (JUMP, TURN, FAST), (TURN, END, -FAST)):
            motion.plot([1e3 * t[start], 1e3 * t[end]], 2 * [1e6 * levels(speed)[i]], color=colour, ls="--", lw=0.9)
    motion.set(xlabel="time [ms]", ylabel="deflection [µm]")
    motion.legend(fontsize=9)
    save(figure, __file__, folder)

    since, low, decay = t[JUMP : TURN + 1, None] - t[JUMP], levels(FAST), C / FC
    slow = np.minimum(SLOW * t[: JUMP + 1, None], levels(SLOW))
    fast = low + (levels(SLOW) - low) * np.exp(-decay * since)
    assert np.abs(z[: JUMP + 1] - slow).max() < 1e-12 and np.abs(z[JUMP : TURN + 1] - fast).max() < 1e-12  # m
    assert np.abs(z[-1] + low).max() < 1e-12  # at its level, backward
    extra = (damped["friction.F"] - result["friction.F"]).to_numpy()
    assert np.abs(extra[1:50] - 3.0 * SIGMA * SLOW).max() < 1e-12  # N, all stick
    rates = -decay * (fast - low).sum(axis=1)
    assert np.abs(extra[JUMP + 1 : TURN + 1] - SIGMA * rates[1:]).max() < 1e-12  # N, all slip
    begins, ends = (", ".join(f"{1e6 * each:.1f}" for each in levels(speed)) for speed in (SLOW, FAST))
    return (
        f"The elements slip after {begins} µm and fall to {ends} µm at the rate C/S = {decay:.0f} 1/s, as the "
        f"equations of GMS say. The sigma of {SIGMA:.0f} N s/m is a damping and adds {1e3 * extra[1]:.0f} mN in stick."
    )


if __name__ == "__main__":
    command_line(main)
