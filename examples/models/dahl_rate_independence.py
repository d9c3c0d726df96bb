"""Dahl's hysteresis loops do not depend on the rate; LuGre's do

Dahl's force depends on the path alone, LuGre's on the velocity as well, through g(v). The loops are steady, on a sine
at 0.1 Hz and at 10 Hz.

The tip of Dahl's loop is at Fc tanh(sigma A / Fc). At 10 Hz LuGre slides at up to 1.3 mm/s, above the Stribeck
velocity of 1 mm/s. There g(v) has fallen and the loop is lower, and sigma1 rounds its ends. At 0.1 Hz g(v) = Fs, and
the tip is at Fs tanh(sigma0 A / Fs). The script also asserts the cause: without the damping sigma1 and sigma2 LuGre's
loops still differ, and with constant g they are those of Dahl.

Source: Dahl, AIAA Journal 14(12), 1976; Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995.
"""

from collections.abc import Mapping
from math import tanh
from pathlib import Path

import numpy as np

from _common import BLUE, RED, Array, along, command_line, panels, save

A = 2e-5  # amplitude [m]
SLOW, FAST = 0.1, 10.0  # [Hz]
UNDAMPED = {"sigma1": 0.0, "sigma2": 0.0}
CONSTANT_G = UNDAMPED | {"Fs": 1.0}  # = Fc


def loop(model: str, frequency: float, parameters: Mapping[str, float]) -> tuple[Array, Array]:
    """Position [m] and force [N] over the third period, when the start is forgotten."""
    n = 500
    x = A * np.sin(2.0 * np.pi * np.arange(3 * n + 1) / n)
    result = along(model, x, 1.0 / (n * frequency), parameters)
    return x[2 * n :], result["friction.F"].to_numpy()[2 * n :]


def main(folder: Path) -> str:
    """Draw the loops, check that Dahl's are one and LuGre's two."""
    figure, axes = panels("Dahl's loops do not depend on the rate; LuGre's do", 1, 3, (9.0, 3.6))
    cases = [("Dahl", "Dahl", {}), ("LuGre", "LuGre", {}), ("LuGre, constant g(v), σ₁ = σ₂ = 0", "LuGre", CONSTANT_G)]
    tips, gaps = {}, {}
    for axis, (title, model, parameters) in zip(axes, cases, strict=True):
        (x, slow), (_, fast) = (loop(model, f, parameters) for f in (SLOW, FAST))
        axis.plot(1e6 * x, slow, color=BLUE, lw=3.0, label=f"{SLOW:g} Hz")
        axis.plot(1e6 * x, fast, color=RED, lw=1.2, label=f"{FAST:g} Hz")
        axis.set(title=title, xlabel="position [µm]", ylim=(-1.45, 1.45))
        axis.title.set_fontsize(10)
        tips[title], gaps[title] = slow.max(), np.abs(slow - fast).max()
    axes[0].set_ylabel("friction force [N]")
    axes[0].legend(loc="upper left", fontsize=9)
    save(figure, __file__, folder)

    dahl, lugre, flat = (title for title, *_ in cases)
    sigma, Fc, Fs = 1e5, 1.0, 1.5  # start values of the models
    assert abs(tips[dahl] - Fc * tanh(sigma * A / Fc)) < 1e-6  # steady loop, closed form
    assert abs(tips[lugre] - Fs * tanh(sigma * A / Fs)) < 2e-3  # the same with g = Fs, as v is far below vs
    assert gaps[dahl] < 1e-12 and gaps[flat] < 1e-12  # N, rounding
    undamped = [loop("LuGre", f, UNDAMPED)[1].max() for f in (SLOW, FAST)]
    assert undamped[0] - undamped[1] > 0.1  # N, a fifth of the Fs - Fc by which g may fall
    return (
        f"Dahl's loops differ by less than 1e-12 N, LuGre's by up to {gaps[lugre]:.2f} N. "
        f"Their tips are at {tips[dahl]:.3f} N and, at {SLOW:g} Hz, {tips[lugre]:.3f} N."
    )


if __name__ == "__main__":
    command_line(main)
