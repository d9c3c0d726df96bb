"""At constant speed, the feedback force is the error of the friction feedforward

At constant speed inertia takes no force, so the feedback adds what the friction feedforward lacks. Stored in a table
over speed, it identifies the friction curve in two passes. The damping of the controller must exceed the steepest fall
of the curve; otherwise the axis sticks and slips and the mean force is not the friction at that speed.

The steepest fall is 0.858 (Fs - Fc)/vs, here 429 N s/m. The figure shows the table of an axis with LuGre friction, at
first without a friction feedforward, for two PD controllers: Kd = 600 N s/m, Kp = 90 kN/m, and Kd = 20 N s/m, Kp = 100
N/m. The axis starts at rest, behind a reference that moves from the start on, by 1.5 times the distance at which its
controller breaks it away. Means are taken from 6 s to 10 s, with the second controller from 30 s to 60 s, in samples
of 0.5 ms. Points with stick-slip are recognised by their ripple of velocity. The true friction is the Stribeck curve
of the plant, Fc + (Fs - Fc) exp(-(v/vs)^2) + sigma2 v.

Source: Johnson, Lorenz, IEEE Transactions on Industry Applications 28(6), 1992.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from _effect import Check, Effect, command_line, near, small
from _loop import BLACK, BLUE, FC, FS, GREY, RED, TS, VS, Array, panels, save
from friction_fmus import build
from friction_fmus.conditions import steepest_fall
from harness import FmuPart, SeriesPart, System

FIRM, SOFT = {"Kp": 9e4, "Kd": 600.0}, {"Kp": 100.0, "Kd": 20.0}  # [N/m], [N s/m]
VISCOUS = 0.4  # [N s/m]


def level(v: Array) -> Array:
    """The friction of the plant in steady motion [N]."""
    return np.asarray(FC + (FS - FC) * np.exp(-((v / VS) ** 2)) + VISCOUS * v)


def axis(folder: Path, gains: dict[str, float], stop: float) -> Callable[[float, float], System]:
    """The axis with a controller, for a speed and a force that is added."""

    def system(speed: float, force: float) -> System:
        ends = np.array([0.0, stop])
        series = {"r": speed * ends + 1.5 * FS / gains["Kp"] * np.sign(speed), "rd": np.full(2, speed)}
        reference = SeriesPart("reference", ends, series, {"r": "m", "rd": "m/s"}, beyond="hold")
        models = {"pid": "PID", "mass": "Mass", "friction": "LuGre"}
        parts = [FmuPart(name, build(model, folder)) for name, model in models.items()]
        wires = ["reference.r -> pid.r", "reference.rd -> pid.rd", "mass.x -> pid.x", "mass.v -> pid.v"]
        wires += ["pid.u -> mass.F_drive", "mass.v -> friction.v", "friction.F -> mass.F_friction"]
        start = {f"pid.{name}": value for name, value in (gains | {"Ki": 0.0, "m": 0.0, "Ts": TS}).items()}
        return System([reference, *parts], wires, start | {"pid.rdd": 0.0, "pid.f": force})

    return system


@dataclass(frozen=True)
class FrictionTable:
    """Friction over speed, identified from the feedback force."""

    speeds: Array
    levels: Array
    """Feedforward force of each pass [N], shape (passes + 1, speeds); the last row is the result."""
    feedback: Array
    """Mean feedback force of each pass [N], shape (passes, speeds)."""
    ripple: Array
    """Largest relative deviation of the velocity, shape (passes, speeds); 1 or more if the axis stopped."""


def identify(
    system: Callable[[float, float], System], speeds: Array, settled: float, stop: float, passes: int = 2
) -> FrictionTable:
    """Identify the friction at constant speeds: F_next(v) = F(v) + mean feedback force at v from ``settled`` on."""
    levels, feedback, ripple = [np.zeros(speeds.size)], [], []
    for _ in range(passes):
        means, deviations = np.empty(speeds.size), np.empty(speeds.size)
        for i, (speed, force) in enumerate(zip(speeds, levels[-1], strict=True)):
            with system(float(speed), float(force)) as made:
                result = made.run(stop=stop, step=TS, record=["pid.u", "mass.v"], master="newton")
            late = result["time"].to_numpy() >= settled
            means[i] = result["pid.u"].to_numpy()[late].mean() - force
            deviations[i] = np.abs(result["mass.v"].to_numpy()[late] / speed - 1.0).max()
        feedback.append(means)
        ripple.append(deviations)
        levels.append(levels[-1] + means)
    return FrictionTable(speeds, np.array(levels), np.array(feedback), np.array(ripple))


def main(folder: Path, full: bool = False) -> Effect:
    """Draw both tables, check that the firm one is right after two passes."""
    slow = (3e-4, 1e-3, 2e-3, 1e-2, 0.1)
    speeds = np.array([1e-4, *slow, *(-v for v in slow), 0.5] if full else slow)
    with TemporaryDirectory() as fmus:
        firm, soft = (
            identify(axis(Path(fmus), gains, stop), v, settled, stop)
            for gains, v, settled, stop in ((FIRM, speeds, 6.0, 10.0), (SOFT, np.array(slow), 30.0, 60.0))
        )

    figure, (table, passes) = panels("The feedback force is the error of the friction feedforward", 1, 2, (9.0, 3.8))
    line = np.geomspace(1e-4, 0.2)
    table.semilogx(1e3 * line, level(line), color=GREY, lw=1.4, label="of the plant")
    forward = speeds > 0.0
    table.plot(1e3 * speeds[forward], firm.levels[-1][forward], "o", color=BLUE, label="Kd = 600 N s/m")
    table.plot(1e3 * np.array(slow), soft.levels[-1], "x", color=RED, label="Kd = 20 N s/m")
    table.set(xlabel="speed [mm/s]", ylabel="identified friction [N]", ylim=(0.9, 1.6))
    table.legend(fontsize=9)
    for found, colour in ((firm, BLUE), (soft, RED)):
        for column in range(len(slow)):
            errors = np.abs(found.levels[:, column] - level(np.abs(found.speeds[column])))
            passes.semilogy(range(len(errors)), np.maximum(errors, 1e-12), "o-", color=colour, lw=1.0, ms=4)
    passes.set(xlabel="passes", ylabel="error of the table [N]", xticks=range(3))
    passes.axhline(1e-3, color=BLACK, lw=0.6, ls=":")
    save(figure, __file__, folder)

    checks = [
        Check("steepest fall of the curve over Kd = 600 N s/m", steepest_fall(FC, FS, VS) / FIRM["Kd"], "", 0.0, 1.0),
        Check("steepest fall of the curve over Kd = 20 N s/m", steepest_fall(FC, FS, VS) / SOFT["Kd"], "", 1.0),
    ]
    for speed, value, left in zip(speeds, firm.levels[-1], firm.feedback[-1], strict=True):
        name = f"Kd = 600 N s/m, {1e3 * speed:g} mm/s"
        checks.append(
            near(f"{name}: friction after two passes", value, float(np.sign(speed) * level(abs(speed))), 1e-3, "N")
        )
        checks.append(small(f"{name}: correction in the second pass", abs(1e3 * left), 1.0, "mN"))
    sticks = soft.ripple[-1] >= 1.0
    checks.append(Check("Kd = 20 N s/m: speeds at which the axis sticks", float(sticks.sum()), "", 1.0))
    wrong = np.abs(soft.levels[-1] - level(np.array(slow)))[sticks].max()
    checks.append(Check("Kd = 20 N s/m: largest error of a mean force there", wrong, "N", 0.02))
    assert np.abs(np.abs(firm.levels[-1]) - level(np.abs(speeds))).max() < 1e-6  # N
    return Effect(
        "With Kd = 600 N s/m, two passes identify the friction at all speeds to 1 µN. With Kd = 20 N s/m the axis "
        f"sticks at {int(sticks.sum())} of {len(slow)} speeds, where the mean force is up to {wrong:.2f} N off.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
