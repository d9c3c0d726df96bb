"""Static friction in feedback helps near rest, but can oscillate

StaticFeedforward takes the sign of the reference velocity, StaticFeedback of the measured one, as a straight line up to
vt. In sliding (5 mm) both are good. At 50 µm feedback with vt = 2 mm/s leaves a third of the error and feedforward
nearly all, but this steep line makes the axis oscillate at rest. With vt = 5 mm/s it is stable and helps little.
Karnopp's model in feedback behaves alike: a band of 0.1 mm/s helps and oscillates, one of 1 mm/s is stable.

Both have the static curve of the plant, an axis with LuGre friction under a PID controller with three poles at 15 Hz,
on cosines of 1 Hz. The line, Fs/vt = 750 N s/m at vt = 2 mm/s, is steeper than the damping of the axis on its
bristles, Kd + sigma1 = 599 N s/m. Only feedback passes on the noise of a sensor. If friction is computed from the
velocity of an encoder of 1 µm at 2 kHz, in steps of 2 mm/s, the variation of its force (the sum of its changes) on a
sine of 0.5 mm is many times that from the true velocity; the force of feedforward does not change at all.

Karnopp's model is the block KarnoppFeedforward, for feedback with its input rd connected to the measured velocity. The
errors with it were computed independently, with a Runge-Kutta method at 12.5 µs from sample to sample.

Source: Johnson, Lorenz, IEEE Transactions on Industry Applications 28(6), 1992 (the comparison).
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from _axis import Block, Settings, cosine, error, follow
from _effect import Check, Effect, command_line, near, small
from _loop import BLUE, FS, GAINS, GREEN, GREY, RED, TS, Array, panels, rms, save
from harness import Result

AMPLITUDES = (5e-3, 5e-4, 5e-5)  # [m]
SIGMA1, STEEP, FLAT = 316.22776601683796, 2e-3, 5e-3  # bristle damping [N s/m], vt [m/s]
NARROW, WIDE = 1e-4, 1e-3  # DV of Karnopp [m/s]
CASES: dict[str, tuple[str, Mapping[str, float]]] = {
    "feedforward": ("StaticFeedforward", {"m": 0.0}),
    "feedback, vt = 2 mm/s": ("StaticFeedback", {"vt": STEEP}),
    "feedback, vt = 5 mm/s": ("StaticFeedback", {"vt": FLAT}),
    "Karnopp, feedforward": ("KarnoppFeedforward", {"DV": NARROW}),
    "Karnopp in feedback, DV = 0.1 mm/s": ("KarnoppFeedforward", {"DV": NARROW}),
    "Karnopp in feedback, DV = 1 mm/s": ("KarnoppFeedforward", {"DV": WIDE}),
}
KARNOPP = {  # errors relative to those without compensation, at each amplitude
    "Karnopp, feedforward": (0.1321, 0.4287, 0.6030),
    "Karnopp in feedback, DV = 0.1 mm/s": (0.1501, 0.3312, 0.6707),
    "Karnopp in feedback, DV = 1 mm/s": (0.1970, 0.8991, 1.0008),
}
STYLES = ((RED, "o-"), (BLUE, "o-"), (BLUE, "o--"), (GREY, "x-"), (GREEN, "x-"), (GREEN, "x--"))


def axis(reference: Block, stop: float, case: str | None, start: Settings, encoder: bool = False) -> Result:
    """The axis with a compensation; Karnopp's law contains the feedforward of the inertia."""
    added = {"law": CASES[case]} if case else {}
    velocity = "encoder.v_measured" if encoder else "mass.v"
    others = {"encoder": ("Encoder", {"q": 1e-6, "Ts": TS})} if encoder else {}
    wires = ["mass.x -> encoder.x", "mass.v -> encoder.v"] if encoder else []
    karnopp = case is not None and CASES[case][0] == "KarnoppFeedforward"
    if case and "feedback" in case:
        wires.append(f"{velocity} -> law.{'rd' if karnopp else 'v'}")
    servo = ("PID", {**GAINS, "m": 0.0} if karnopp else GAINS)
    return follow(reference, servo, stop, added=added, mass=start, others=others, wires=wires)


def run(amplitude: float, case: str | None, encoder: bool = False) -> Result:
    """Two periods of a cosine."""
    return axis(cosine(amplitude, 1.0), 2.0, case, {"x0": amplitude}, encoder)


def trembling(case: str) -> float:
    """Return the velocity amplitude at rest [m/s], 2 s after a start at 1 mm/s."""
    v = axis(("Sine", {"amplitude[1]": 0.0}), 3.0, case, {"v0": 1e-3})["mass.v"].to_numpy()
    return float(np.ptp(v[round(2.0 / TS) :])) / 2.0


def variation(force: Array) -> float:
    """Sum of the changes of a force in the second period [N]."""
    return float(np.abs(np.diff(force[round(1.0 / TS) :])).sum())


def main(folder: Path, full: bool = False) -> Effect:
    """Draw ratios and forces, check the oscillation at rest and the effect of noise."""
    figure, (ratios, forces) = panels("Static friction in feedback and in feedforward", 1, 2, (9.4, 4.0))
    left: dict[str, list[float]] = {case: [] for case in CASES}
    for amplitude in AMPLITUDES:
        none = rms(error(run(amplitude, None), 1.0))
        for case in CASES:
            left[case].append(rms(error(run(amplitude, case), 1.0)) / none)
    for (case, values), (colour, style) in zip(left.items(), STYLES, strict=True):
        ratios.semilogx([1e6 * A for A in AMPLITUDES], values, style, color=colour, lw=1.5, label=case)
    ratios.set(xlabel="amplitude [µm]", ylabel="error relative to no compensation", ylim=(0.0, 1.7))
    ratios.legend(fontsize=8, loc="upper right")

    noise = {}
    for case, colour in (("feedforward", RED), ("feedback, vt = 5 mm/s", BLUE)):
        clean, noisy = (run(5e-4, case, encoder)["law.u"].to_numpy() for encoder in (False, True))
        noise[case] = variation(noisy) / variation(clean)
        part = slice(round(1.4 / TS), round(1.6 / TS))
        t = TS * np.arange(clean.size)[part]
        forces.plot(t, noisy[part], color=colour, lw=0.7, label=f"{case}, encoder of 1 µm")
    forces.set(xlabel="time [s]", ylabel="force of the compensation [N]", ylim=(-1.7, 2.6))
    forces.legend(fontsize=8.5, loc="upper left")
    save(figure, __file__, folder)

    damping = GAINS["Kd"] + SIGMA1
    karnopp, narrow, wide = KARNOPP
    checks = [
        *(
            Check(f"{1e6 * A:g} µm, {case}: ratio", ratio)
            for case in CASES
            if case not in KARNOPP
            for A, ratio in zip(AMPLITUDES, left[case], strict=True)
        ),
        *(
            near(f"{1e6 * A:g} µm, {case}: ratio", left[case][i], expected[i], 0.01)
            for case, expected in KARNOPP.items()
            for i, A in enumerate(AMPLITUDES)
        ),
        Check(
            "5000 µm, feedback, vt = 2 mm/s over feedforward",
            left[list(CASES)[1]][0] / left["feedforward"][0],
            "",
            0.5,
            2.0,
        ),
        Check(
            "50 µm, feedback, vt = 2 mm/s over feedforward",
            left[list(CASES)[1]][2] / left["feedforward"][2],
            "",
            0.0,
            0.5,
        ),
        Check("vt = 2 mm/s: straight part over the damping at rest", FS / STEEP / damping, "", 1.0),
        Check("vt = 5 mm/s: straight part over the damping at rest", FS / FLAT / damping, "", 0.0, 1.0),
        Check("vt = 2 mm/s: velocity amplitude at rest", 1e3 * trembling(list(CASES)[1]), "mm/s", 0.1),
        small("vt = 5 mm/s: velocity amplitude at rest", 1e3 * trembling(list(CASES)[2]), 1e-3, "mm/s"),
        Check(f"{narrow}: velocity amplitude at rest", 1e3 * trembling(narrow), "mm/s", 0.1),
        small(f"{wide}: velocity amplitude at rest", 1e3 * trembling(wide), 1e-3, "mm/s"),
        Check(
            "encoder of 1 µm, feedback, vt = 5 mm/s: variation of the force relative to that without",
            noise[list(CASES)[2]],
            "",
            50.0,
        ),
        Check(
            "encoder of 1 µm, feedforward: variation of the force relative to that without",
            noise["feedforward"],
            "",
            1.0,
            1.0,
        ),
    ]
    forward, steep = left["feedforward"], left["feedback, vt = 2 mm/s"]
    return Effect(
        f"Feedforward leaves {forward[0]:.2f} of the error at 5 mm and {forward[2]:.2f} at 50 µm, feedback "
        f"{steep[0]:.2f} and {steep[2]:.2f}. An encoder of 1 µm makes the feedback force vary more than 50 times as "
        f"much. Karnopp's model leaves {left[karnopp][0]:.2f} of the error at 5 mm in feedforward and "
        f"{left[narrow][0]:.2f} in feedback, and {left[karnopp][1]:.2f} and {left[narrow][1]:.2f} at 0.5 mm.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
