"""Learned forces separate friction from cogging

Iterative learning at constant speed finds friction plus every force that depends on the position. Friction changes its
sign with the direction, cogging does not: half the difference of the two learned forces is friction, half their sum is
cogging.

The axis has LuGre friction and cogging of 0.7 N with a pitch of 24 mm. It learns for 15 trials at 50 mm/s in both
directions, at a rate of 0.5 and with the corner of the learning filter at 200 Hz. The motion accelerates in 0.1 s; the
table begins 50 ms later, when the axis has settled, and covers one pitch. The true friction is that of steady sliding,
Fc + sigma2 v, because all speeds are far above the Stribeck velocity.

Source: none could be identified for the scheme; for the learning: Arimoto, Kawamura, Miyazaki, Journal of Robotic
Systems 1(2), 1984.
"""

from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from _effect import Check, Effect, command_line, near
from _learning import train
from _loop import BLACK, BLUE, FC, GAINS, RED, TS, Array, panels, save
from friction_fmus import build
from harness import FmuPart, Part, SeriesPart, System

COGGING, PITCH, VISCOUS = 0.7, 0.024, 0.4  # [N], [m], [N s/m]
RISE, SETTLED, REST = 0.1, 0.15, 0.05  # speeding up, begin of the table, time after its end [s]
X = PITCH / 48.0 * np.arange(48)


def axis(learned: Part, speed: float, times: Array, folder: Path) -> System:
    """The axis from rest to a speed, of any sign, with a part whose ``F`` is added to the force of its controller."""
    rises = times < RISE - 0.5 * TS
    rdd = np.where(rises, speed / RISE, 0.0)
    rd = np.where(rises, speed / RISE * times, speed)
    r = np.where(rises, 0.5 * speed / RISE * times**2, speed * (times - 0.5 * RISE))
    reference = SeriesPart("reference", times, {"r": r, "rd": rd, "rdd": rdd}, {"r": "m", "rd": "m/s", "rdd": "m/s2"})
    models = {"pid": "PID", "mass": "Mass", "friction": "LuGre", "cogging": "Cogging"}
    wires = [f"reference.{name} -> pid.{name}" for name in ("r", "rd", "rdd")]
    wires += ["mass.x -> pid.x", "mass.v -> pid.v", "pid.u -> mass.F_drive", "learned.F -> pid.f"]
    wires += [
        "mass.v -> friction.v",
        "friction.F -> mass.F_friction",
        "mass.x -> cogging.x",
        "cogging.F -> mass.F_load",
    ]
    start = {f"pid.{name}": value for name, value in GAINS.items()}
    start |= {"pid.Ts": TS, "cogging.amplitude[1]": COGGING, "cogging.pitch": PITCH}
    parts = [FmuPart(name, build(model, folder)) for name, model in models.items()]
    return System([reference, learned, *parts], wires, start)


def learned_over_position(speed: float) -> Array:
    """Force at the positions X, in a motion of a speed of any sign [N]."""
    samples = round((SETTLED + PITCH / abs(speed) + REST) / TS)
    times: Array = TS * np.arange(samples + 1, dtype=np.float64)
    with TemporaryDirectory() as folder:
        training = train(lambda part: axis(part, speed, times, Path(folder)), GAINS, samples)
    table = slice(round(SETTLED / TS), samples - round(REST / TS))
    place = np.mod(speed * (times[table] - 0.5 * RISE), PITCH)
    order = np.argsort(place)
    return np.asarray(np.interp(X, place[order], training.forces[-1][table][order], period=PITCH))


def main(folder: Path, full: bool = False) -> Effect:
    """Draw learned forces and tables, check friction and amplitude of the cogging."""
    speeds = (0.05, 0.02, 0.03, 0.1) if full else (0.05,)
    forward, backward = (np.array([learned_over_position(sign * v) for v in speeds]) for sign in (1.0, -1.0))
    friction, cogging = (forward - backward) / 2.0, (forward + backward) / 2.0

    figure, axes = panels("Learned forces separate friction from cogging", 1, 2, (9.0, 3.8))
    axes[0].plot(1e3 * X, forward[0], color=RED, lw=1.3, label="forward")
    axes[0].plot(1e3 * X, backward[0], color=BLUE, lw=1.3, label="backward")
    axes[0].set(xlabel="position [mm]", ylabel="learned force [N]", ylim=(-2.0, 2.8))
    axes[1].plot(1e3 * X, friction[0], color=RED, lw=1.5, label="friction")
    axes[1].plot(1e3 * X, cogging[0], color=BLUE, lw=1.5, label="against cogging")
    truth = -COGGING * np.sin(2.0 * pi * X / PITCH)
    axes[1].plot(1e3 * X, truth, color=BLACK, ls=":", lw=1.3, label="of the plant")
    axes[1].axhline(FC + VISCOUS * speeds[0], color=BLACK, ls=":", lw=1.3)
    axes[1].set(xlabel="position [mm]", ylabel="force [N]", ylim=(-1.2, 2.2))
    for each in axes:
        each.legend(loc="upper center", ncols=3, fontsize=8)
    save(figure, __file__, folder)

    checks: list[Check] = []
    found: list[tuple[float, float]] = []
    for speed, rubs, cogs in zip(speeds, friction, cogging, strict=True):
        amplitude = float(2.0 * abs(np.mean(cogs * np.exp(-2j * pi * X / PITCH))))
        found.append((amplitude, float(rubs.mean())))
        name = f"{1e3 * speed:g} mm/s"
        checks.append(near(f"{name}: amplitude of the cogging", amplitude, COGGING, 5e-3, "N"))
        checks.append(near(f"{name}: friction", found[-1][1], FC + VISCOUS * speed, 3e-3, "N"))
    return Effect(
        f"At 50 mm/s the cogging is estimated as {found[0][0]:.3f} N (true: 0.7 N) and friction as {found[0][1]:.3f} "
        "N (true: 1.02 N).",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
