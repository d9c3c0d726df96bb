"""SevenParameter: friction lags behind the speed, and static friction grows at rest

Left: the speed varies between 0.5 and 3.5 mm/s. Slowly, friction follows the Stribeck curve; at 20 Hz it makes a loop
and is higher while the speed rises. Right: the break-away force grows with the time that the contact has rested.

With the speed of tau_L = 5 ms before, the loop falls on the Stribeck curve. For the break-away force, a contact that
slid at 2 mm/s rests and is then pulled at 10 µm/s. The peak follows Fc + Fs_last + (Fs_inf - Fs_last) t2 / (t2 +
gamma), where Fs_last is the Stribeck part at the end of sliding.

Source: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994.
"""

from pathlib import Path

import numpy as np

from _common import BLACK, BLUE, RED, Array, along, command_line, panels, save

Fc, Fv, vs, Fs_a, Fs_inf, delay, gamma, kt = 1.0, 0.4, 1e-3, 0.2, 0.5, 5e-3, 1.0, 1e5  # start values of the model
STEPS = 50  # in the delay
SLIDE, CREEP, STEP = 2e-3, 1e-5, 1e-3  # [m/s], [m/s], [s]
ONE_STEP = kt * CREEP * STEP  # of the force before break-away [N]
RESTS = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)  # [s]


def stribeck(v: Array | float, Fs: Array | float) -> Array:
    """Stribeck part of the friction [N] at a speed [m/s]."""
    return np.asarray(Fs / (1.0 + (v / vs) ** 2))


def rested(Fs: Array | float, t2: Array | float) -> Array:
    """Static friction over Fc [N] after the dwell time t2 [s], if Fs [N] was the Stribeck part before."""
    return np.asarray(Fs + (Fs_inf - Fs) * t2 / (t2 + gamma))


def modulated(frequency: float) -> tuple[Array, Array, float]:
    """Speed [m/s] and friction [N] over the second period, and the Stribeck part at rest when it broke away [N]."""
    step, turns = delay / STEPS, 2
    n = round(1.0 / (frequency * step))
    v = 2e-3 + 1.5e-3 * np.sin(2.0 * np.pi * np.arange(turns * n + 1) / n)
    result = along("SevenParameter", np.cumsum(v) * step, step, record=["level"])
    return v[-n - STEPS :], result["friction.F"].to_numpy()[-n - STEPS :], float(result["friction.level"][-1]) - Fc


def break_away(rest: float) -> tuple[float, float]:
    """Dwell time t2 [s] and peak of the friction [N] after a rest [s] between sliding and a slow pull."""
    phases = ((SLIDE, 0.1), (0.0, rest), (CREEP, 1.0))
    v = np.concatenate([np.full(round(time / STEP), speed) for speed, time in phases])
    stop = round(0.1 / STEP)
    F = along("SevenParameter", np.cumsum([0.0, *v]) * STEP, STEP)["friction.F"].to_numpy()
    peak = stop + round(rest / STEP) + int(np.argmax(F[stop + round(rest / STEP) :]))
    return (peak - stop) * STEP, float(F[peak])


def main(folder: Path) -> str:
    """Draw the loops and the peaks, compare both with the equations."""
    figure, (lag, dwell) = panels(
        "SevenParameter: frictional lag, and static friction that grows at rest", 1, 2, (9.0, 4.0)
    )
    for frequency, colour in ((1.0, BLUE), (20.0, RED)):
        v, F, Fs = modulated(frequency)
        now, F = v[STEPS:], F[STEPS:]
        before = v[1 : 1 - STEPS]  # a step ends with the speed held during it, the next one begins 5 ms before
        lag.plot(1e3 * now, F, color=colour, lw=1.6, label=f"{frequency:g} Hz")
        assert np.abs(F - Fv * now - Fc - stribeck(before, Fs)).max() < 1e-10  # N, rounding
    speeds = np.linspace(0.5e-3, 3.5e-3, 100)
    lag.plot(1e3 * speeds, Fc + stribeck(speeds, Fs) + Fv * speeds, "--", color=BLACK, lw=1.2, label="Stribeck curve")
    lag.set(xlabel="speed [mm/s]", ylabel="friction force [N]", title="sliding")
    lag.legend(fontsize=9)
    rises = np.gradient(now) > 0.0
    higher = F[rises].mean() - F[~rises].mean()
    assert higher > 0.0  # at 20 Hz, over the same speeds

    t2, peaks = np.array([break_away(rest) for rest in RESTS]).T
    Fs_last = stribeck(SLIDE, rested(Fs_a, Fc / (kt * SLIDE)))
    times = np.geomspace(0.03, 60.0, 100)
    dwell.semilogx(times, Fc + rested(Fs_last, times), "--", color=BLACK, lw=1.2, label="equation of dwell")
    dwell.semilogx(t2, peaks, "o", color=BLUE, label="peak at break-away")
    dwell.set(xlabel="dwell time t₂ [s]", ylabel="friction force [N]", title="break-away after a rest")
    dwell.legend(fontsize=9)
    save(figure, __file__, folder)

    below = Fc + rested(Fs_last, t2) - peaks
    assert np.all((below > -1e-4) & (below < ONE_STEP + 1e-4))  # the last sample before the peak
    return (
        f"At 20 Hz friction is {higher:.3f} N higher while the speed rises. Break-away grows from {peaks[0]:.2f} N "
        f"after {t2[0]:.2f} s to {peaks[-1]:.2f} N after {t2[-1]:.0f} s and agrees with the equation of dwell to "
        f"{1e3 * ONE_STEP:.0f} mN."
    )


if __name__ == "__main__":
    command_line(main)
