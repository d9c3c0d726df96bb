"""Friction estimated from displacements does not depend on the sample time

Dry friction is a function of the path. An estimator that advances with the displacement gives the same force at any
sample time; one that advances with velocity times sample time does not. The axis follows a sine of 50 µm at 1 Hz.

The axis has LuGre friction under a PD controller with Kp and Kd of the PID controller of the other effects. Beside it
run the elasto-plastic estimator from displacements and the LuGre observer, which reads the velocity. The first gives
the same force at both sample times except at the reversals, of which a sample can miss a Ts^2/8, with the acceleration
a: a force of sigma0 a Ts^2/4. The force of the second is late by a share of its sample time.

Fed back, the estimate removes 98 % of the error and more on elasto-plastic friction, at both sample times; the part
that grows with the sample time in sliding is the delay of the loop itself. The estimator's model is simple: no
Stribeck effect, and straight up to 0.7 Fc. On LuGre friction it leaves 6 % of the error at 5 mm and 44 % at 50 µm. At
5 µm, where real bristles are softer, it makes the error 4.5 times as large.

The ratios were computed independently, with a Runge-Kutta method at steps of 2 µs for the axis, and the path equation
of the estimator solved in 200 steps a sample.

Source: Hayward, Armstrong, Altpeter, Dupont, IEEE Transactions on Control Systems Technology 17(3), 2009.
"""

from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from _effect import Check, Effect, command_line
from _loop import BLUE, GAINS, GREY, RED, Array, panels, save
from _servo import NOTHING, error, follow, sines
from friction_fmus import build
from harness import FmuPart, Result

PD = {**GAINS, "Ki": 0.0}
FINE, COARSE, EVERY = 1e-4, 1e-3, 10  # sample times [s], and their ratio
ESTIMATOR = {"sigma0": 1e5, "Fc": 1.0, "elastic": 0.7, "Fv": 0.4}
OBSERVER = {"k": 0.0}  # of LuGre; its other start values are those of the friction
FREQUENCY, SETTLED, STOP = 1.0, 1.0, 2.0  # of the reference [Hz], start and end of the measurement [s]
CONTACT = {"friction.Fs": 1.0, "friction.sigma1": 0.0}  # ElastoPlastic as the estimator has it
RATIOS = {  # error relative to that under PD control, by friction and amplitude [m], at both sample times
    ("ElastoPlastic", 5e-6): (0.0015, 0.0142),
    ("ElastoPlastic", 5e-3): (0.0007, 0.0082),
    ("ElastoPlastic", 5e-5): (0.0059, 0.0077),
    ("ElastoPlastic", 5e-4): (0.0018, 0.0065),
    ("LuGre", 5e-6): (4.4503, 4.4505),
    ("LuGre", 5e-5): (0.4435, 0.4433),
    ("LuGre", 5e-4): (0.1155, 0.1172),
    ("LuGre", 5e-3): (0.0620, 0.0701),
}
SHORT = 2  # cases of the short run


def beside(A: float) -> Result:
    """The axis under the PD on a sine of the amplitude A [m], with estimators that are not fed back."""
    values = {"mass.v0": 2.0 * pi * FREQUENCY * A}
    wires, others = [], []
    with TemporaryDirectory() as folder:
        for every, time in ((1, "fine"), (EVERY, "coarse")):
            for block, settings in (("ElastoPlasticEstimator", ESTIMATOR), ("LuGreObserver", OBSERVER)):
                name = f"{block}_{time}"
                others.append(FmuPart(name, build(block, Path(folder)), every=every))
                values |= {f"{name}.{key}": value for key, value in settings.items()} | {f"{name}.Ts": every * FINE}
                wires += [f"mass.x -> {name}.x", f"mass.v -> {name}.v"]
                wires += [f"reference.r -> {name}.r"] if block == "LuGreObserver" else []
        reference = sines((A, FREQUENCY, 0.0))
        return follow("PID", PD, reference, STOP, start=values, others=others, wires=wires, Ts=FINE)


def ratio(friction: str, A: float, Ts: float) -> float:
    """Return the rms error with the estimate fed back relative to that under PD control."""
    reference, start = sines((A, FREQUENCY, 0.0)), {"mass.v0": 2.0 * pi * FREQUENCY * A}
    start |= CONTACT if friction == "ElastoPlastic" else NOTHING
    errors = [
        error(
            follow(
                "PID",
                PD,
                reference,
                STOP,
                addition=addition,
                friction=friction,
                start=start,
                Ts=Ts,
                inner=round(Ts / FINE),
            ),
            SETTLED,
        )
        for addition in (("ElastoPlasticEstimator", ESTIMATOR), None)
    ]
    return errors[0] / errors[1]


def pair(result: Result, block: str) -> tuple[Array, Array]:
    """The force of an estimator at the samples of the coarse one, at both sample times [N]."""
    fine, coarse = (result[f"{block}_{time}.F_hat"].to_numpy()[1::EVERY] for time in ("fine", "coarse"))
    return fine, coarse


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the forces at two sample times, check that they are one and what the feedback leaves."""
    title = "Friction estimated from displacements does not depend on the sample time"
    figure, (loop, gap) = panels(title, 1, 2, (9.5, 4.2))
    checks: list[Check] = []
    largest: dict[str, float] = {}
    for A in (5e-5, 5e-3, *((5e-6, 5e-4) if full else ())):
        size = f"{1e6 * A:g} µm" if A < 1e-4 else f"{1e3 * A:g} mm"
        result = beside(A)
        v, a = result["mass.v"].to_numpy(), result["mass.a"].to_numpy()
        turns = np.abs(a[1:][v[1:] * v[:-1] < 0.0])
        fine, coarse = pair(result, "ElastoPlasticEstimator")
        same = np.abs(fine - coarse)
        fine_of_observer, coarse_of_observer = pair(result, "LuGreObserver")
        late = np.abs(fine_of_observer - coarse_of_observer)
        slips = A > 1e-5  # else the estimator is elastic, and the two forces differ by rounding only
        missed = ESTIMATOR["sigma0"] * float(turns.max()) * COARSE**2 / 4.0
        checks += [
            Check(
                f"{size}, displacements: force at 1 ms against 0.1 ms",
                1e3 * same.max(),
                "mN",
                0.0,
                1e3 * missed,
                reproducible=slips,
            ),
            Check(f"{size}, LuGre observer: force at 1 ms against 0.1 ms", 1e3 * late.max(), "mN", 1.0),
            Check(f"{size}: observer over displacements", late.max() / same.max(), "", 100.0, reproducible=slips),
        ]
        if A == 5e-5:
            largest = {"same": 1e3 * missed, "late": 1e3 * late.max()}
            x = 1e6 * result["mass.x"].to_numpy()[:-1][::EVERY][: fine.size]
            t = result["time"].to_numpy()[:-1][::EVERY][: fine.size]
            loop.plot(x, fine, color=GREY, lw=1.2, label="0.1 ms")
            loop.plot(x[::8], coarse[::8], color=BLUE, ls="", marker=".", ms=3.5, label="1 ms")
            gap.semilogy(t, np.maximum(1e3 * late, 1e-13), color=RED, lw=1.0, label="LuGre observer")
            gap.semilogy(t, np.maximum(1e3 * same, 1e-13), color=BLUE, lw=1.0, label="displacements")
    loop.set(xlabel="position [µm]", ylabel="friction from displacements [N]")
    gap.set(xlabel="time [s]", ylabel="force at 1 ms against 0.1 ms [mN]", ylim=(1e-13, 1e3))
    loop.legend(fontsize=9, loc="upper left", title="sample time")
    gap.legend(fontsize=9, loc="lower right")
    save(figure, __file__, folder)

    for (friction, A), expected in list(RATIOS.items())[: None if full else SHORT]:
        size = f"{1e6 * A:g} µm" if A < 1e-4 else f"{1e3 * A:g} mm"
        for Ts, each in zip((FINE, COARSE), expected, strict=True):
            name = f"{friction}, {size}, Ts = {1e3 * Ts:g} ms: error relative to that of the PD"
            margin = 0.03 * each + 5e-4
            checks.append(Check(name, ratio(friction, A, Ts), "", each - margin, each + margin))
    return Effect(
        "Between sample times of 0.1 ms and 1 ms, the force from displacements differs by less than "
        f"{largest['same']:.3f} mN, the force of the LuGre observer by {largest['late']:.0f} mN.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
