"""Leuven's stacks can overflow; the outermost loops are kept

The path has 80 nested reversals and leads out through all of them; the stacks hold 64 points. When they are full, each
new point replaces the innermost loop, `stack_overflow` becomes true, and the FMU warns once.

fmi2DoStep returns one fmi2Warning with a message. On the way out, every loop that was kept closes at the force of its
reversal point, until the stacks are empty.

Source: Swevers, Al-Bender, Ganseman, Prajogo, IEEE TAC 45(4), 2000; which points are dropped is this library's choice.
"""

import logging
from pathlib import Path

import numpy as np

from _common import BLACK, BLUE, GREY, RED, along, command_line, panels, polyline, save

SPEED, STEP = 1e-5, 2.5e-3  # [m/s], [s]: 25 nm a step
ONE_STEP = 2.5e-3  # of the force [N], at the stiffness A/zc = 0.1 N/µm
REVERSALS, HELD = 80, 64
LOST = slice(62, 78)  # of the reversal points, when the last two are on the full stacks
CORNERS = [0.0] + [(-1) ** j * 1.5e-7 * (REVERSALS - j) for j in range(REVERSALS)] + [14e-6]  # [m]
SHARP = 100.0  # exponent n: no slip before the sliding, so that loops close in the position as well


class Messages(logging.Handler):
    """Keeps what an FMU logs."""

    def __init__(self) -> None:
        """Nothing yet."""
        super().__init__()
        self.warnings: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep the warnings."""
        self.warnings += [record.getMessage()] if record.levelno == logging.WARNING else []


def main(folder: Path) -> str:
    """Draw the loops and the depth of the stacks, check the points that are kept."""
    messages = Messages()
    logging.getLogger("harness.friction").addHandler(messages)
    x = polyline(CORNERS, SPEED, STEP)
    result = along("Leuven", x, STEP, {"n": SHARP}, ["depth", "Fh", "stack_overflow"])
    logging.getLogger("harness.friction").removeHandler(messages)
    Fh, depth, overflow = (result[f"friction.{name}"].to_numpy() for name in ("Fh", "depth", "stack_overflow"))
    turns = np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1
    out = turns[-1]
    closings = out + np.flatnonzero(np.diff(depth[out + 1 :]) < 0) + 1
    maxima = np.delete(turns, LOST)[-2::-2]

    figure, (loops, stack) = panels("Leuven's stacks can overflow; the outermost loops are kept", 1, 2, (9.0, 4.2))
    loops.plot(1e6 * x, Fh, color=GREY, lw=0.5)
    loops.plot(1e6 * x[out:], Fh[out:], color=BLUE, lw=2.0, label="way out")
    loops.plot(1e6 * x[turns], Fh[turns], "o", color=BLACK, ms=3, label="reversal point")
    loops.plot(1e6 * x[turns[LOST]], Fh[turns[LOST]], "o", color=RED, ms=4, label="forgotten reversal point")
    loops.set(xlabel="position [µm]", ylabel="hysteresis force [N]")
    loops.legend(loc="upper left", fontsize=8)
    t = result["time"].to_numpy()
    stack.step(t[turns], 1 + np.arange(REVERSALS), where="post", color=RED, lw=1.2, label="reversals so far")
    stack.step(t, depth, where="post", color=BLUE, lw=1.6, label="points on the stacks")
    full = int(np.argmax(overflow))
    stack.plot(t[full], depth[full], "o", color=BLACK, ms=6, label="stack_overflow, fmi2Warning")
    stack.set(xlabel="time [s]", ylabel="number of points")
    stack.legend(loc="upper left", fontsize=8)
    save(figure, __file__, folder)

    assert depth.max() == HELD and depth[-1] == 0
    assert full == turns[HELD] + 1  # the first step after the reversal that is one too many
    assert len(messages.warnings) == 1
    assert closings.size == maxima.size == HELD // 2
    assert np.abs(Fh[closings] - Fh[maxima]).max() <= ONE_STEP
    return (
        f"Of {REVERSALS} reversal points {depth.max()} are kept. On the way out {closings.size} loops close, each at "
        f"the force of its reversal point to {1e3 * ONE_STEP:g} mN, the change in one step."
    )


if __name__ == "__main__":
    command_line(main)
