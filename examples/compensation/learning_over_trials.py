"""Iterative learning removes friction errors from a repeated motion

Iterative learning control stores the error of a trial and corrects the force of the next trial. It needs no friction
model, only the same motion from the same state. A trial is one period of a cosine of 1 Hz. The learned force, here at 5
mm, is the friction along the motion.

The motion starts and ends at rest. The learning filter L inverts the loop without friction. Where the axis slides, at
5 mm, that is right for all but the reversals, and the first trials leave 1 - gamma of the error, where gamma is the
learning rate. At 5 µm the axis stays in the presliding range, where the contact is a spring of 1e5 N/m that L does not
contain, and each trial removes less. At 50 µm and 0.5 mm it does both, and learning ends up slowest: the force has a
steep edge at each reversal, which moves from trial to trial. With the stiffness of the contact in L, learning in
presliding is as fast as L is exact.

The errors of the first trials were computed independently, with a fixed-step solver of 1 µs for the plant and other
filters.

Source: Arimoto, Kawamura, Miyazaki, Journal of Robotic Systems 1(2), 1984; Bristow, Tharayil, Alleyne, IEEE Control
Systems Magazine 26(3), 2006.
"""

from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from _effect import Check, Effect, command_line, near
from _learning import Training, train
from _loop import BLACK, BLUE, GAINS, GREY, RED, TS, Array, panels, rms, save
from friction_fmus import build
from harness import CallablePart, FmuPart, Part, Port, System

TRIALS, SAMPLES, FQ = 15, 2000, 200.0  # learning steps, samples of a trial (1 s), corner of the filter Q [Hz]
STIFFNESS = 1e5  # of the contact at rest [N/m]
FIRST = {5e-6: 2.02059e-6, 5e-5: 7.96891e-6, 5e-4: 10.21984e-6, 5e-3: 10.77997e-6}  # RMS error of the first trial [m]
RATIO = {  # of the second trial's error over the first one's, by amplitude [m] and gamma
    (5e-6, 0.25): 0.8274,
    (5e-6, 0.5): 0.6672,
    (5e-6, 0.8): 0.5138,
    (5e-5, 0.5): 0.5718,
    (5e-4, 0.5): 0.5571,
    (5e-3, 0.25): 0.7583,
    (5e-3, 0.5): 0.5206,
    (5e-3, 0.8): 0.2657,
}
KNOWN = 0.46527  # the same with the stiffness in L, 5 µm and gamma = 0.5
LOSS = {5e-6: 20.0, 5e-5: 20.0, 5e-4: 20.0, 5e-3: 100.0}  # first error over the last one, at least, with gamma = 0.5


def axis(learner: Part, amplitude: float, folder: Path) -> System:
    """The axis on a cosine, with a part whose output ``F`` is added to the force of its controller."""
    models = {"reference": "Sine", "pid": "PID", "mass": "Mass", "friction": "LuGre"}
    wires = [f"reference.{name} -> pid.{name}" for name in ("r", "rd", "rdd")]
    wires += ["mass.x -> pid.x", "mass.v -> pid.v", "pid.u -> mass.F_drive", f"{learner.name}.F -> pid.f"]
    wires += ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    start = {f"pid.{name}": value for name, value in GAINS.items()} | {"pid.Ts": TS, "mass.x0": amplitude}
    start |= {"reference.amplitude[1]": amplitude, "reference.frequency[1]": 1.0, "reference.phase[1]": pi / 2.0}
    return System([learner, *(FmuPart(name, build(model, folder)) for name, model in models.items())], wires, start)


def learn(amplitude: float, gamma: float, stiffness: float = 0.0) -> Training:
    """All trials, with a stiffness [N/m] that L knows of."""
    gains = {**GAINS, "Kp": GAINS["Kp"] + stiffness}
    with TemporaryDirectory() as folder:
        return train(lambda learned: axis(learned, amplitude, Path(folder)), gains, SAMPLES, TRIALS, gamma, FQ)


def by_the_fmu(amplitude: float, gamma: float) -> Array:
    """RMS errors of the trials of one long run, in which the FMU IterativeLearning learns [m]."""
    ends = CallablePart(
        "ends", lambda t, u, x: float(round(t / TS) % SAMPLES == 0), outputs=[Port("trial_end", type="Boolean")]
    )
    with TemporaryDirectory() as name:
        folder = Path(name)
        models = {"reference": "Sine", "ilc": "IterativeLearning", "pid": "PID", "mass": "Mass", "friction": "LuGre"}
        wires = [f"reference.{port} -> pid.{port}" for port in ("r", "rd", "rdd")]
        wires += ["mass.x -> pid.x", "mass.v -> pid.v", "pid.u -> mass.F_drive", "ilc.u -> pid.f"]
        wires += ["reference.r -> ilc.r", "mass.x -> ilc.x", "ends.trial_end -> ilc.trial_end"]
        wires += ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
        start = {f"{part}.{name}": value for part in ("pid", "ilc") for name, value in GAINS.items()}
        start |= {"pid.Ts": TS, "ilc.Ts": TS, "ilc.N": SAMPLES, "ilc.rate": gamma, "ilc.fq": FQ, "mass.x0": amplitude}
        start |= {"reference.amplitude[1]": amplitude, "reference.phase[1]": pi / 2.0}
        parts = [ends, *(FmuPart(part, build(model, folder)) for part, model in models.items())]
        with System(parts, wires, start) as system:
            signals = ["reference.r", "mass.x"]
            result = system.run(stop=(TRIALS + 1) * SAMPLES * TS, step=TS, master="newton", record=signals)
    error = (result["reference.r"] - result["mass.x"]).to_numpy()[:-1]
    return np.array([rms(trial) for trial in error.reshape(TRIALS + 1, SAMPLES)])


def checks_of(amplitude: float, gamma: float, errors: Array) -> list[Check]:
    """Return the checks of the errors over the trials."""
    name = f"{1e6 * amplitude:g} µm, gamma = {gamma:g}"
    ratio = errors[1:] / errors[:-1]
    checks = [near(f"{name}: second error over the first", ratio[0], RATIO[amplitude, gamma], 0.01)]
    if gamma <= 0.5:
        checks.append(Check(f"{name}: largest ratio of an error to the one before", ratio.max(), "", 0.0, 1.0))
    if gamma == 0.5:
        error = 1e6 * errors[0]
        checks.append(
            near(f"{1e6 * amplitude:g} µm: RMS error before learning", error, 1e6 * FIRST[amplitude], 2e-3, "µm")
        )
        checks.append(Check(f"{name}: first error over the last", errors[0] / errors[-1], "", LOSS[amplitude]))
    return checks


def main(folder: Path, full: bool = False) -> Effect:
    """Draw errors over the trials and the learned force; check the contraction and the remaining error."""
    figure, axes = panels("Iterative learning removes friction errors from a repeated motion", 1, 2, (9.0, 3.8))
    trials, checks = np.arange(TRIALS + 1), []
    found = {amplitude: learn(amplitude, 0.5) for amplitude in (5e-6, 5e-3)}
    for (amplitude, each), colour, label in zip(
        found.items(), (BLUE, RED), ("5 µm, presliding", "5 mm, sliding"), strict=True
    ):
        axes[0].semilogy(trials, 1e6 * each.rms, color=colour, marker="o", ms=3.5, lw=1.3, label=label)
        checks += checks_of(amplitude, 0.5, each.rms)
    axes[0].semilogy(trials[:9], 1e6 * found[5e-3].rms[0] * 0.5 ** trials[:9], color=BLACK, ls=":", lw=1.2)
    axes[0].annotate("$(1 - \\gamma)^j$", (8.1, 1e6 * found[5e-3].rms[0] * 0.5**8), fontsize=10)
    axes[0].set(xlabel="trial j", ylabel="RMS error [µm]")
    axes[0].set_title("learning rate $\\gamma$ = 0.5", fontsize=10)
    axes[0].legend(fontsize=9)

    time = TS * np.arange(SAMPLES)
    for j, colour in ((1, GREY), (3, BLUE), (TRIALS, RED)):
        axes[1].plot(time, found[5e-3].forces[j], color=colour, lw=1.3, label=f"trial {j}")
    axes[1].set(xlabel="time [s]", ylabel="learned force [N]", ylim=(-2.0, 2.0))
    axes[1].set_title("5 mm: learned force", fontsize=10)
    axes[1].legend(loc="upper left", fontsize=9)
    save(figure, __file__, folder)

    speed = 5e-3 * 2.0 * pi * np.abs(np.sin(2.0 * pi * time))
    fast = speed > 10e-3  # [m/s], far above the Stribeck velocity: friction is Fc + sigma2 v
    friction = np.where(time < 0.5, -1.0, 1.0) * (1.0 + 0.4 * speed)
    difference = rms((found[5e-3].forces[-1] - friction)[fast]) / rms(friction[fast])
    checks.append(
        Check("5000 µm: learned force minus friction over friction, above 10 mm/s", difference, "", 0.0, 0.01)
    )

    if full:
        for amplitude, gamma in [each for each in RATIO if each not in ((5e-6, 0.5), (5e-3, 0.5))]:
            checks += checks_of(amplitude, gamma, learn(amplitude, gamma).rms)
        known = learn(5e-6, 0.5, STIFFNESS).rms
        checks.append(near("5 µm, stiffness in L: second error over the first", known[1] / known[0], KNOWN, 0.01))
        checks.append(Check("5 µm, stiffness in L: first error over the last", known[0] / known[-1], "", 1000.0))
        for amplitude, least in ((5e-6, 20.0), (5e-3, 100.0)):
            errors = by_the_fmu(amplitude, 0.5)
            loss = errors[0] / errors[-1]
            checks.append(Check(f"{1e6 * amplitude:g} µm, FMU: first error over the last", loss, "", least))
    small, large = (each.rms for each in found.values())
    return Effect(
        f"With gamma = 0.5 the first correction leaves {small[1] / small[0]:.2f} of the error at 5 µm and "
        f"{large[1] / large[0]:.2f} at 5 mm; {TRIALS} trials reduce it by factors of {small[0] / small[-1]:.0f} and "
        f"{large[0] / large[-1]:.0f}.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
