"""A prefilter of the reference is equivalent to feedforward

A controller without a force input can receive the feedforward F through its reference: with R = 1 + F/C, where C is the
controller, C R r = C r + F r on any plant. The prefilter shifts the reference by far more than the error of the axis,
so a drive that monitors its following error sees the shift.

The axis has LuGre friction, on a sine of 5 mm at 1 Hz, under a PID controller with feedforward of inertia and LuGre
friction. The master is gauss-seidel, with ten communication steps in a sample: it repeats the same steps for the same
forces. An iterating master solves its loops to a tolerance, and the runs differ by that, 1e-8 of the force.

Source: the algebra of C R r = C r + F r.
"""

from functools import partial
from pathlib import Path

import numpy as np

from _axis import Block, cosine, error, follow
from _effect import Effect, command_line, small
from _loop import BLUE, GAINS, GREY, RED, TS, panels, save
from harness import Result

F, INNER = 1.0, 10  # frequency [Hz], communication steps in a sample
OF_CONTROLLER = {name: GAINS[name] for name in ("Kp", "Kd", "Ki")}
PID: Block = ("PID", OF_CONTROLLER | {"m": 0.0})
FRICTION: dict[str, tuple[Block | None, str]] = {  # of the axis, and the feedforward
    "LuGre": (("LuGre", {}), "LuGreFeedforward"),
    "no friction": (None, "StaticFeedforward"),
    "GMS": (("GMS", {}), "GMSFeedforward"),
}


def runs(A: float, friction: Block | None, forward: str) -> tuple[Result, Result]:
    """With the feedforward at the input f of the controller, and with the prefilter in front of it."""
    run = partial(
        follow, cosine(A, F), PID, 2.0 / F, friction=friction, mass={"x0": A}, inner=INNER, master="gauss-seidel"
    )
    given = {"m": 1.0, "Ts": TS}
    with_force = run(added={"forward": (forward, given)})
    wires = ["forward.u -> prefilter.f", "prefilter.r_out -> servo.r", "prefilter.rd_out -> servo.rd"]
    names = ("r", "rd", "rdd") if forward != "StaticFeedforward" else ("rd", "rdd")
    wires += [f"reference.{name} -> forward.{name}" for name in names]
    wires += [f"reference.{name} -> prefilter.{name}" for name in ("r", "rd", "rdd")]
    others: dict[str, Block] = {
        "forward": (forward, given),
        "prefilter": ("Prefilter", OF_CONTROLLER | {"m": 0.0, "Ts": TS}),
    }
    return with_force, run(others=others, wires=wires)


def main(folder: Path, full: bool = False) -> Effect:
    """Draw both forces and what the controller sees, check that the forces are the same."""
    figure, axes = panels("A prefilter of the reference is equivalent to feedforward", 1, 3, (11.0, 3.6))
    checks = []
    for name, (friction, forward) in FRICTION.items():
        for A in (5e-6, 5e-5, 5e-4, 5e-3) if full else (5e-6, 5e-3):
            with_force, with_filter = runs(A, friction, forward)
            u = with_force["servo.u"].to_numpy()
            apart = np.abs(with_filter["servo.u"].to_numpy() - u) / np.abs(u).max()
            text = f"{name}, {1e6 * A:g} µm: difference of the forces over the largest force"
            checks.append(small(text, float(apart.max()), 1e-9))
            if name == "LuGre" and A == 5e-3:
                t = with_force["time"].to_numpy()
                seen = error(with_filter, -1.0, "prefilter.r_out")
                true = error(with_filter, -1.0)
                axes[0].plot(t, u, color=BLUE, lw=2.5, label="feedforward")
                axes[0].plot(t, with_filter["servo.u"], color=RED, ls="--", lw=1.3, label="prefilter")
                axes[1].semilogy(t, np.maximum(apart, 1e-17), color=RED, lw=1.0)
                axes[2].plot(t, 1e6 * seen, color=RED, lw=1.4, label="as the controller sees it")
                axes[2].plot(t, 1e6 * true, color=GREY, lw=1.4, label="of the axis")
                largest = 1e6 * np.abs(seen).max(), 1e6 * np.abs(true).max()
    axes[0].set(xlabel="time [s]", ylabel="force [N]", ylim=(-1.9, 1.5))
    axes[1].set(xlabel="time [s]", ylabel="difference over the largest force", ylim=(1e-17, 1e-9))
    axes[2].set(xlabel="time [s]", ylabel="error [µm]", ylim=(-90.0, 60.0))
    for axis in (axes[0], axes[2]):
        axis.legend(loc="lower right", fontsize=8)
    save(figure, __file__, folder)
    return Effect(
        f"The forces differ by less than 1e-9 of the largest. The controller behind the prefilter sees an error of "
        f"{largest[0]:.0f} µm, while the axis has {largest[1]:.2f} µm.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
