"""A friction observer is as good as its lag is short

Without a friction model, an observer infers friction from the motion and is late. Left: friction grows at the rate c,
and each estimate misses c times its lag. Right: what observers leave of the error on sines from 5 µm to 5 mm.
Observers of the same lag leave the same, 4 to 9 %; a straight line through the last forces has no lag and leaves less.

The lags have closed forms: for the disturbance observer with a low-pass of order 1 or 2, the extended-state observer,
and a polynomial through the last ten mean forces. A straight line (degree 1) has no lag and four times the noise
variance of a mean value. On the left a PD controller holds a mass of 1 kg against a load that grows by 20 N/s; all
observers but the straight line are tuned to a lag near 2.5 ms. On the right they act on LuGre friction, with the PD
controller, at 1 Hz; the straight line leaves 0.3 to 0.7 %. In sliding the error comes from the lag at the reversals of
friction: a lag of 1 ms leaves 2 %; a lag of 10 ms leaves 14 % with the disturbance observer and 30 % with the
extended-state observer, whose poles at 300 rad/s are then hardly faster than the 163 rad/s of the PD controller.

Errors and ratios were computed independently, with a Runge-Kutta method at steps of 2 µs for the axis and independent
code for the laws.

Source: Ohnishi, Shibata, Murakami, IEEE/ASME Trans. Mechatronics 1(1), 1996; Gao, American Control Conference, 2003;
Savitzky, Golay, Analytical Chemistry 36(8), 1964; the closed forms are derived.
"""

from math import cos, exp, pi, sin, sqrt
from pathlib import Path

import numpy as np

from _effect import Check, Effect, command_line, near
from _loop import BLACK, BLUE, GREEN, GREY, OMEGA, RED, TS, panels, save
from _servo import error, follow, sines
from harness import Result, SeriesPart

WC = sqrt(3.0) * OMEGA  # of the PD: Kp = m wc^2, Kd = 2 m wc [rad/s]
PD = {"Kp": WC**2, "Kd": 2.0 * WC, "Ki": 0.0, "m": 1.0}
LAG = 2.5e-3  # that all are tuned to [s]
WINDOW = 10  # intervals of the polynomial, 2 LAG / TS
GROWTH, RAMP_END = 20.0, 0.2  # of the load [N/s], [s]
FREQUENCY, SETTLED, STOP = 1.0, 1.0, 2.0  # of the reference [Hz], start and end of the measurement [s]
INNER = 2  # steps of the axis in a sample
STYLES = {
    "observer, order 1": (RED, "-"),
    "observer, order 2": (RED, "--"),
    "extended state": (GREEN, "-"),
    "mean value": (BLUE, "-"),
    "straight line": (BLACK, "-"),
}
ALONE = {5e-6: 2.7891e-6, 5e-5: 26.763e-6, 5e-4: 37.763e-6, 5e-3: 36.913e-6}  # RMS error of the PD by amplitude [m]
RATIOS = {  # of the observers, in the order above, over it
    5e-6: (0.0801, 0.0799, 0.0907, 0.0799, 0.0071),
    5e-5: (0.0357, 0.0357, 0.0405, 0.0356, 0.0031),
    5e-4: (0.0380, 0.0382, 0.0431, 0.0381, 0.0038),
    5e-3: (0.0455, 0.0467, 0.0521, 0.0462, 0.0062),
}
LAGS = {1e-3: (0.0217, 0.0217), 5e-3: (0.0810, 0.1184), 1e-2: (0.1401, 0.2957)}
"""Ratios at 5 mm by lag [s], of the disturbance observer of order 1 and the extended-state observer."""


def observers(lag: float) -> dict[str, tuple[str, dict[str, float]]]:
    """Block and parameters; the extended-state observer is a whole controller, with the gains of the PD."""
    return {
        "observer, order 1": ("DisturbanceObserver", {"fq": 1.0 / (2.0 * pi * lag)}),
        "observer, order 2": ("DisturbanceObserver", {"fq": sqrt(2.0) / (2.0 * pi * lag), "second_order": 1.0}),
        "extended state": ("ExtendedStateObserver", {"wc": WC, "wo": 3.0 / lag}),
        "mean value": ("LocalFunctionEstimator", {"window": WINDOW, "degree": 0}),
        "straight line": ("LocalFunctionEstimator", {"window": WINDOW, "degree": 1}),
    }


def lags() -> dict[str, float]:
    """How late each observer is on a force that grows at a constant rate [s]."""
    a = 1.0 - exp(-TS / LAG)
    q = TS / LAG  # sqrt(2)/LAG Ts/sqrt(2)
    E, C, S = exp(-q), cos(q), sin(q)
    p = exp(-3.0 * TS / LAG)
    return {
        "observer, order 1": TS * (1.0 / a - 0.5),
        "observer, order 2": TS * ((1.0 - E * (C - S)) / (1.0 - 2.0 * E * C + E**2) - 0.5),
        "extended state": TS * (1.5 * (1.0 + p) / (1.0 - p) - 0.5),
        "mean value": WINDOW * TS / 2.0,
        "straight line": 0.0,
    }


def run(observer: str | None, A: float, lag: float = LAG, gain: float = 1.0, growth: float = 0.0) -> Result:
    """The axis on a sine of the amplitude A [m] and LuGre friction, or without friction against a growing load."""
    controller, settings, addition = "PID", PD, None
    if observer:
        block, tuned = observers(lag)[observer]
        tuned = {"m": 1.0, "gain": gain, **tuned}
        if block == "ExtendedStateObserver":
            controller, settings = block, tuned
        else:
            addition = block, tuned
    times = np.array([0.0, 10.0])
    load = SeriesPart("load", times, {"F": -growth * times}, {"F": "N"})
    return follow(
        controller,
        settings,
        sines((A, FREQUENCY, 0.0)),
        RAMP_END if growth else STOP,
        addition=addition,
        friction=None if growth else "LuGre",
        start={"mass.v0": 2.0 * pi * FREQUENCY * A},
        others=[load],
        wires=["load.F -> mass.F_load"],
        inner=INNER,
        record=("*", "servo.F_est") if controller != "PID" else ("*",),
    )


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the error on a ramp and the ratios over the amplitude, check both."""
    figure, (ramp, ratio) = panels("A friction observer is as good as its lag is short", 1, 2, (9.5, 4.2))
    checks: list[Check] = []
    for name, lag in lags().items():
        colour, dashes = STYLES[name]
        result = run(name, 0.0, gain=0.0, growth=GROWTH)
        at = result["time"].to_numpy()[:-1]  # the first value that is recorded is that before the first sample
        estimate = result["servo.F_est" if name == "extended state" else "addition.F_hat"].to_numpy()[1:]
        missed = GROWTH * at - estimate
        ramp.plot(1e3 * at[:80], 1e3 * missed[:80], color=colour, ls=dashes, lw=1.4, label=name)
        ramp.axhline(1e3 * GROWTH * lag, color=GREY, ls=":", lw=0.9)
        found = 1e3 * missed[-1] / GROWTH
        # the first order comes within exp(-80) of it
        checks.append(Check(f"{name}: lag on the ramp", found, "ms", 1e3 * lag - 1e-6, 1e3 * lag + 1e-6))

    ratios: dict[str, list[float]] = {name: [] for name in STYLES}
    amplitudes = [A for A in ALONE if full or A != 5e-4]
    for A in amplitudes:
        size = f"{1e6 * A:g} µm" if A < 1e-4 else f"{1e3 * A:g} mm"
        without = error(run(None, A), SETTLED)
        checks.append(near(f"{size}, PD: RMS error", 1e6 * without, 1e6 * ALONE[A], 0.02, "µm"))
        for name, expected in zip(STYLES, RATIOS[A], strict=True):
            ratios[name].append(error(run(name, A), SETTLED) / without)
            checks.append(near(f"{size}, {name}: ratio", ratios[name][-1], expected, 0.05))
    for name, (colour, dashes) in STYLES.items():
        ratio.loglog([1e6 * A for A in amplitudes], ratios[name], color=colour, ls=dashes, marker="o", ms=4, label=name)
    ramp.set(xlabel="time [ms]", ylabel="force missed on the ramp [mN]")
    ratio.set(xlabel="amplitude [µm]", ylabel="error relative to that of the PD", ylim=(1e-3, 0.3))
    ramp.legend(fontsize=8, loc="center right")
    save(figure, __file__, folder)

    if full:
        without = error(run(None, 5e-3), SETTLED)
        for lag, both in LAGS.items():
            for name, each in zip(("observer, order 1", "extended state"), both, strict=True):
                value = error(run(name, 5e-3, lag), SETTLED) / without
                checks.append(near(f"5 mm, {name}, lag of {1e3 * lag:g} ms: ratio", value, each, 0.05))
    *late, straight = (each[-1] for each in ratios.values())
    return Effect(
        f"On a sine of 5 mm, observers of the same lag leave {100.0 * min(late):.1f} to {100.0 * max(late):.1f} % of "
        f"the error, the straight line {100.0 * straight:.1f} %.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
