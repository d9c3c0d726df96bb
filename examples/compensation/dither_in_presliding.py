"""Dither with a short stroke does not smooth friction

A contact that is elastic before it slides follows a small vibration without slipping. Dither must move it by much more
than its presliding displacement, here Fc/sigma0 = 10 µm. Left: mean friction over the stroke of the dither. Right: an
axis that friction would hold 150 mm from its target; dither with a long stroke brings it there, with a short stroke
hardly.

On the left LuGre and ElastoPlastic are moved at v0 + A sin(2 pi f t) with A = 40 mm/s and v0 = A/10. Without its
viscous part, the mean friction is (2 Fc/pi) asin(v0/A) = 0.06 Fc for a long stroke A/(2 pi f). For a short one LuGre's
bristles stay bent where slip forward and backward balance, and the mean is Fc v0 over the mean of |v|, 0.16 Fc:
(pi/2)^2 = 2.5 times the slope. ElastoPlastic does not slip backward while it is bent forward (this is why it does not
drift), and nearly all of the friction is back.

On the right the axis is under a PD controller, Kp = 3 and Kd = 6, 0.3 Fs/Kp away from its target. Dither of 50 N at 80
Hz, a stroke of 200 µm, moves it as the mean of Coulomb friction predicts. At 600 Hz, with a stroke of 3.5 µm, it
creeps on LuGre at about half of that velocity, and on ElastoPlastic it hardly moves.

The errors and means on LuGre were computed independently, with a Runge-Kutta method at 5 µs from sample to sample and
as the periodic solution of the bristle equation. The other limits are closed forms.

Source: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994; Dupont, Hayward, Armstrong, Altpeter, IEEE
TAC 47(5), 2002 (drift).
"""

from collections.abc import Mapping
from math import asin, pi, sin, sqrt
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from _effect import Check, Effect, command_line, near
from _loop import BLACK, BLUE, FC, GREEN, GREY, RED, Array, panels, save, simulate
from _shaker import mean_forces

SIGMA2 = 0.4  # viscous friction of both contacts [N s/m]
Q_BA = 0.7  # share of Fc up to which ElastoPlastic is elastic
A, RATIO = 0.04, 0.1  # amplitude of the velocity [m/s], v0/A
MEANS: Mapping[float, float] = {  # friction of LuGre without its viscous part [N], by stroke [m]
    1e-3: 0.06399,
    1e-4: 0.06612,
    30e-6: 0.07580,
    10e-6: 0.12235,
    3e-6: 0.15203,
    1e-6: 0.15582,
}
LONG = 2.0 * FC / pi * asin(RATIO)  # the mean for a long stroke [N]
SHORT = FC * RATIO / (2.0 / pi * (RATIO * asin(RATIO) + sqrt(1.0 - RATIO**2)))  # and for a short one on LuGre [N]

KP, KD, GOAL = 3.0, 6.0, 0.15  # [N/m], [N s/m], [m]
AD, TS, STOP = 50.0, 5e-5, 6.0  # amplitude [N], sample time of dither and PD [s], [s]
LEFT = {80.0: 37.561e-3, 200.0: 77.104e-3, 600.0: 128.745e-3}  # error at STOP on LuGre [m], by frequency [Hz]


def held() -> float:
    """Mean force of ElastoPlastic for a short stroke [N].

    Bristles bent to q Fc/sigma0 slip on the way forward only, by alpha(q) q of it, which must be v0.
    """
    forward = 0.5 * (FC * RATIO / SHORT + RATIO)  # mean of v where it is positive, over A

    def beyond(q: float) -> float:
        return q * 0.5 * (1.0 + sin(pi * (q - 0.5 * (1.0 + Q_BA)) / (1.0 - Q_BA))) - RATIO / forward

    return FC * float(brentq(beyond, Q_BA, 1.0))


def settle(friction: str, frequency: float) -> tuple[Array, Array]:
    """Time and error of an axis under PD control and dither."""
    models = {"pd": "PID", "dither": "Dither", "mass": "Mass", "friction": friction}
    wires = ["mass.x -> pd.x", "mass.v -> pd.v", "pd.u -> dither.f", "dither.u -> mass.F_drive"]
    wires += ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    start = {"pd.r": GOAL, "pd.rd": 0.0, "pd.rdd": 0.0, "pd.Kp": KP, "pd.Kd": KD, "pd.Ki": 0.0, "pd.Ts": TS}
    start |= {"dither.Ad": AD, "dither.frequency": frequency, "dither.Ts": TS}
    # the velocity that the sine alone has at its start
    start["mass.v0"] = -AD / (2.0 * pi * frequency)
    result = simulate(models, wires, start, STOP, step=TS, record=["mass.x"])
    return result["time"].to_numpy()[::200], GOAL - result["mass.x"].to_numpy()[::200]


def on_coulomb(frequency: float, t: Array) -> Array:
    """Error at the times t if friction were the mean of Coulomb's and the viscous part [m]."""
    amplitude = AD / (2.0 * pi * frequency)

    def rate(_: float, y: Array) -> list[float]:
        ratio = min(max(y[1] / amplitude, -1.0), 1.0)
        return [y[1], KP * (GOAL - y[0]) - (KD + SIGMA2) * y[1] - 2.0 * FC / pi * asin(ratio)]

    return GOAL - np.asarray(solve_ivp(rate, (0.0, t[-1]), [0.0, 0.0], t_eval=t, rtol=1e-8, atol=1e-10).y[0])


def main(folder: Path, full: bool = False) -> Effect:
    """Draw mean friction over the stroke and the way to the target, check both."""
    figure, (means, errors) = panels("Dither with a short stroke does not smooth friction", 1, 2, (9.0, 4.2))
    viscous = SIGMA2 * RATIO * A
    checks: list[Check] = []
    strokes = list(MEANS)
    found: dict[str, dict[float, float]] = {}
    for friction, settling in (("LuGre", 100e-6), ("ElastoPlastic", 400e-6)):
        # the force of the bristles' damping has no mean
        forces = mean_forces(friction, [RATIO], strokes, A, {"sigma1": 0.0}, settling=settling)
        found[friction] = {stroke: force - viscous for (_, stroke), force in forces.items()}
    lugre, drift_free = found.values()
    for stroke, expected in MEANS.items():
        checks.append(near(f"LuGre, stroke of {1e6 * stroke:g} µm: mean friction", lugre[stroke], expected, 5e-3, "N"))
    longest, shortest = strokes[0], strokes[-1]
    checks += [
        near("LuGre, longest stroke: mean relative to that on Coulomb", lugre[longest] / LONG, 1.0, 0.01),
        near("LuGre, shortest stroke: mean over Fc v0 / (mean of |v|)", lugre[shortest] / SHORT, 1.0, 0.01),
        Check(
            "LuGre: mean of the shortest stroke relative to that of the longest",
            lugre[shortest] / lugre[longest],
            "",
            2.3,
        ),
        near("ElastoPlastic, longest stroke: mean relative to that on Coulomb", drift_free[longest] / LONG, 1.0, 0.01),
        near("ElastoPlastic, shortest stroke: mean over its limit", drift_free[shortest] / held(), 1.0, 0.03),
    ]

    means.axhline(LONG, color=BLACK, lw=1.0, ls=":", label="law of Coulomb friction")
    means.axhline(SHORT, color=BLACK, lw=1.0, ls="--", label="Fc v0 / mean of |v|")
    means.axvspan(1.0, 15.0, color=GREY, alpha=0.25, lw=0.0, label="presliding")
    for (name, curve), colour in zip(found.items(), (RED, BLUE), strict=True):
        micrometres = [1e6 * stroke for stroke in strokes]
        means.semilogx(micrometres, list(curve.values()), color=colour, marker="o", ms=5, lw=1.2, label=name)
    means.set(xlabel="stroke [µm]", ylabel="mean friction [N]", ylim=(0.0, 1.1))
    means.legend(fontsize=9)

    shares = {}
    for frequency, colour in ((80.0, GREEN), (600.0, RED), *(((200.0, BLUE),) if full else ())):
        t, e = settle("LuGre", frequency)
        law = on_coulomb(frequency, t)
        middle = len(t) // 2
        shares[frequency] = float((GOAL - e[middle]) / (GOAL - law[middle]))
        name = f"LuGre, dither of {frequency:g} Hz: error after {STOP:g} s"
        checks.append(near(name, 1e3 * e[-1], 1e3 * LEFT[frequency], 5e-3, "mm"))
        if frequency != 200.0:
            stroke = AD / (2.0 * pi * frequency) ** 2
            errors.plot(t, 1e3 * e, color=colour, lw=1.5, label=f"LuGre, stroke {1e6 * stroke:.3g} µm")
            errors.plot(t, 1e3 * law, color=colour, lw=1.0, ls=":")
    t, e = settle("ElastoPlastic", 600.0)
    errors.plot(t, 1e3 * e, color=BLUE, lw=1.5, label="ElastoPlastic, stroke 3.52 µm")
    errors.plot([], [], color=GREY, lw=1.0, ls=":", label="law of Coulomb friction")
    errors.set(xlabel="time [s]", ylabel="error [mm]", ylim=(0.0, 165.0))
    errors.legend(fontsize=9, loc="lower left")
    checks += [
        near(f"LuGre, 80 Hz: distance moved in {STOP / 2.0:g} s relative to that by the law", shares[80.0], 1.0, 0.03),
        Check(
            f"LuGre, 600 Hz: distance moved in {STOP / 2.0:g} s relative to that by the law",
            shares[600.0],
            "",
            0.0,
            0.6,
        ),
        Check(
            f"ElastoPlastic, 600 Hz: distance moved in {STOP:g} s relative to that to the target",
            1.0 - e[-1] / GOAL,
            "",
            0.0,
            0.01,
        ),
    ]
    save(figure, __file__, folder)
    return Effect(
        f"Mean friction is {lugre[longest]:.3f} Fc with a stroke of 1 mm; with one of 1 µm it is "
        f"{lugre[shortest]:.3f} Fc on LuGre and {drift_free[shortest]:.2f} Fc on ElastoPlastic. On LuGre the axis "
        f"moves {shares[80.0]:.2f} of the predicted distance at 80 Hz and {shares[600.0]:.2f} at 600 Hz.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
