"""Four misprinted or incomplete equations, and what they lead to

Four equations of the [report](literature.md) leave out a sign or a rule. Red: read literally; blue: the models.

(1.22) and (1.23), a GMS element: dz/dt = v "until z = s(v)", then dz/dt = sgn(v) C (1 - z/s(v)). Both hold if s carries
the sign of v, as S(v) of (1.15) does (dashed). The report does not say so, and s is usually a positive level. With a
positive s, an element that moves backward never slips and is a spring without end; if it slips, its rest is at z = s,
on the wrong side, and unstable: from z = -s it runs away as z = s (1 - 2 exp(C t/s)). Written for a positive s, the
test is sgn(v) z >= s(v) and the rate C (sgn(v) - z/s); then z goes to sgn(v) s at the rate C/s.

(1.19) and (1.20), a Maxwell slip element with the position zeta, do not say how zeta moves. If zeta stays, the force
returns on the line on which it rose. In slip it must be dragged along, zeta = z - sgn(z - zeta) W/k, for a loop of the
area 4 W (A - W/k).

(1.14), Leuven's state, with r = Fd/(S(v) - Fb): after a reversal at a force Fb above the level S of a faster motion, S
- Fb is negative, and so is r from then on. Then dz/dt >= v, and the force grows along the hysteresis curve instead of
falling to S. The FMU treats this case as sliding.

Source: Al-Bender, Lampaert, Swevers, IEEE TAC 50(11), 2005 (GMS); Swevers, Al-Bender, Ganseman, Prajogo, IEEE TAC
45(4), 2000 (Leuven).
"""

from pathlib import Path

import numpy as np

from _common import BLACK, BLUE, GREY, RED, along, command_line, panels, polyline, save

ONE = {"N": 1.0, "k[1]": 1e5}  # one element [N/m]
LEVEL, C = 1.0, 100.0  # of the element [N], [N/s]
GMS = ONE | {"alpha[1]": 1.0, "C": C, "Fc": LEVEL, "Fs": LEVEL, "sigma2": 0.0}
BACK, STEP = -0.01, 1e-4  # [m/s], [s]
A, W = 2e-5, 0.5  # [m], [N]
FAST = 0.02  # much faster than the Stribeck velocity [m/s]


def main(folder: Path) -> str:
    """Draw the equations as printed and the FMUs, check what goes wrong."""
    title = "Equations read literally (red) and the FMUs (blue)"
    figure, (slip, stick, element, leuven) = panels(title, 2, 2, (9.0, 6.4))
    t = STEP * np.arange(301)
    backward = along("GMS", BACK * t, STEP, GMS)["friction.F"].to_numpy()
    run_away = LEVEL * (1.0 - 2.0 * np.exp(C * t / LEVEL))  # from -s
    slip.plot(1e3 * t, run_away, color=RED, lw=1.5, label="literally, s > 0")
    slip.plot(1e3 * t, backward, color=BLUE, lw=1.5, label="GMS")
    slip.set(xlabel="time at -10 mm/s [ms]", ylabel="force of the element [N]", ylim=(-12.0, 1.0))
    spring = 1e5 * BACK * t
    stick.plot(1e3 * t, spring, color=RED, lw=1.5, label="literally, s > 0")
    stick.plot(1e3 * t, backward, color=BLUE, lw=1.5, label="GMS")
    signed = np.where(spring <= -LEVEL, -LEVEL, spring)  # with s = -LEVEL, (1.23) keeps z where it reaches s
    for axis in (slip, stick):
        axis.plot(1e3 * t, signed, color=BLACK, lw=1.0, ls="--", label="s < 0, as v")
    stick.set(xlabel="time at -10 mm/s, from rest [ms]", ylabel="force of the element [N]", ylim=(-12.0, 1.0))

    x = polyline([0.0, A, -A, A], 1e-5, 5e-3)
    held = np.clip(1e5 * x, -W, W)
    dragged = along("MaxwellSlip", x, 5e-3, ONE | {"W[1]": W})["friction.F"].to_numpy()
    element.plot(1e6 * x, held, color=RED, lw=2.5, label="literally")
    element.plot(1e6 * x, dragged, color=BLUE, lw=1.5, label="MaxwellSlip")
    element.set(xlabel="position [µm]", ylabel="force of the element [N]")

    slow = polyline([0.0, 4e-5, 3.9e-5], 1e-5, 1e-3)
    jump = slow[-1] + FAST * 1e-3 * np.arange(1, 11)  # 0.2 mm forward in 10 ms
    result = along("Leuven", np.concatenate([slow, jump]), 1e-3, record=["Fh"])
    Fh = result["friction.Fh"].to_numpy()
    Fb = float(Fh[slow.size - 1])
    least = Fb + 4.0 * (1.0 - np.exp(-(jump - slow[-1]) / 4e-5))  # with dz/dt = v, the start values of A and zc
    leuven.plot(1e6 * (jump - slow[-1]), least, color=RED, lw=1.5, label="literally, at least")
    leuven.plot(1e6 * (jump - slow[-1]), Fh[slow.size :], color=BLUE, lw=1.5, label="Leuven")
    leuven.axhline(LEVEL, color=GREY, ls="--", lw=1.2, label="S")
    leuven.set(xlabel="path at 20 mm/s [µm]", ylabel="hysteresis force [N]", ylim=(0.0, 6.0))
    for axis in (slip, stick, element, leuven):
        axis.legend(fontsize=8.5)
    save(figure, __file__, folder)

    assert np.abs(backward - signed)[1:].max() < 1e-12
    forward = along("GMS", -BACK * t, STEP, GMS)["friction.F"].to_numpy()
    assert np.array_equal(forward, -backward)
    assert run_away[-1] < -30.0
    # the drawn curve solves (1.23)
    rate = np.gradient(run_away, STEP)[1:-1]
    assert np.allclose(rate, -C * (1.0 - run_away[1:-1] / LEVEL), rtol=1e-4)
    # an element above the level goes to it at the rate C/s, in either direction: (1.23) with s = -LEVEL
    above = along("GMS", BACK * t, STEP, GMS | {"Fi[1]": -1.5})["friction.F"].to_numpy()
    attracted = float(np.abs(above + LEVEL + 0.5 * np.exp(-C * t / LEVEL))[1:].max())
    assert attracted < 1e-9
    area = float(np.trapezoid(dragged[400:], x[400:]))  # from A back to A
    assert abs(area / (4.0 * W * (A - W / 1e5)) - 1.0) < 1e-9 and abs(float(np.trapezoid(held[400:], x[400:]))) < 1e-18
    assert Fb > LEVEL and abs(Fh[-1] - LEVEL) < 1e-9
    return (
        f"At -10 mm/s, the slip of GMS with a positive s reaches {run_away[-1]:.0f} N after 30 ms; with a negative s "
        f"it is the FMU, which goes to {backward[-1]:.0f} N at the rate C/s = {C / LEVEL:g} 1/s. The literal Maxwell "
        f"slip dissipates nothing, the loop of MaxwellSlip {1e6 * area:.0f} µJ. From {Fb:.2f} N, the literal Leuven "
        f"rises to at least {least[-1]:.1f} N, where Leuven falls to {Fh[-1]:.1f} N."
    )


if __name__ == "__main__":
    command_line(main)
