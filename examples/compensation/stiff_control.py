"""High gains end stick-slip but cost stability and force

On LuGre friction at 0.7 mm/s, where the Stribeck curve falls by 429 N s/m, the axis sticks and slips with Kd = 300 N
s/m and moves evenly with 500 (Kp = 1 kN/m). A high Kp alone makes the motion smaller but does not end it. Left:
velocity; middle: its ripple over Kd; right: oscillation of the error over Kp.

The steepest fall is sqrt(2/e) (Fs - Fc)/vs. On a rigid contact sliding is stable if Kd + sigma2 exceeds it. With Kd =
20 N s/m the motion falls about as 1/Kp; Kd = 300 N s/m and Kp = 10 kN/m together end it. In even motion the PD
controller is F(v)/Kp behind, and an integral removes that. The price: sampled with Ts the velocity loop is unstable
from Kd = 2 m/Ts on (with a small Kp), so 429 N s/m need a Ts below 4.7 ms; and a step of the reference asks for Kp
times the step.

Source: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994 (stiff control).
"""

from functools import cache
from math import exp, pi, sqrt
from pathlib import Path

import numpy as np

from _axis import follow
from _effect import Check, Effect, command_line, near, small
from _loop import BLACK, BLUE, FC, FS, GREEN, GREY, RED, TS, VS, Array, panels, save

SPEED = 0.7e-3  # [m/s]
FALL = sqrt(2.0 / exp(1.0)) * (FS - FC) / VS  # steepest fall of the Stribeck curve [N s/m]
KP, HIGH = 1e3, 1e4  # [N/m]
GAINS = (20.0, 100.0, 300.0, 500.0, 600.0)  # Kd at KP [N s/m]
STIFF = (1e3, 1e4, 1e5)  # Kp at Kd = 20 N s/m [N/m]


@cache
def at_constant_speed(Kp: float, Kd: float, Ki: float = 0.0, stop: float = 6.0) -> tuple[Array, Array]:
    """Velocity [m/s] and error [m] in the second half of a run."""
    slow = ("Sine", {"amplitude[1]": 1.0, "frequency[1]": SPEED / (2.0 * pi)})  # changes by 1e-5 of it in 6 s
    result = follow(slow, ("PID", {"Kp": Kp, "Kd": Kd, "Ki": Ki, "m": 1.0}), stop)
    late = result["time"].to_numpy() > stop / 2.0
    error = (result["reference.r"] - result["mass.x"]).to_numpy()
    return result["mass.v"].to_numpy()[late], error[late]


def ripple(Kp: float, Kd: float) -> float:
    """Standard deviation of the velocity over its mean."""
    return float(at_constant_speed(Kp, Kd)[0].std()) / SPEED


def growth(Kd: float, Ts: float) -> float:
    """Velocity of a free mass under Kd alone, after 10 samples relative to that at the start."""
    controller = ("PID", {"Kp": 0.0, "Kd": Kd, "Ki": 0.0, "m": 0.0})
    still = ("Sine", {"amplitude[1]": 0.0})
    result = follow(still, controller, 10 * Ts, friction=None, mass={"v0": 1e-3}, Ts=Ts)
    return float(abs(result["mass.v"][-1])) / 1e-3


def first_force(Kp: float) -> float:
    """Largest force on a step of the reference of 1 mm [N]."""
    controller = ("PID", {"Kp": Kp, "Kd": 600.0, "Ki": 0.0, "m": 0.0})
    result = follow(("Sine", {"amplitude[1]": 1e-3, "frequency[1]": 1e-6, "phase[1]": pi / 2.0}), controller, 0.05)
    return float(np.abs(result["servo.u"].to_numpy()).max())


def main(folder: Path, full: bool = False) -> Effect:
    """Draw velocities and amplitudes, check where the motion is steady."""
    figure, axes = panels("High gains end stick-slip", 1, 3, (10.0, 3.8))
    for Kp, Kd, colour in ((KP, 100.0, RED), (KP, 500.0, BLUE)):
        v = at_constant_speed(Kp, Kd)[0][:4000]
        axes[0].plot(TS * np.arange(v.size), 1e3 * v, color=colour, lw=1.3, label=f"Kd = {Kd:g} N s/m")
    axes[0].set(xlabel="time [s]", ylabel="velocity [mm/s]", title="Kp = 1 kN/m", ylim=(-0.5, 6.0))
    axes[0].legend(fontsize=9)
    axes[1].semilogy(GAINS, [ripple(KP, Kd) for Kd in GAINS], "o-", color=BLACK, lw=1.3, label="Kp = 1 kN/m")
    axes[1].semilogy(300.0, ripple(HIGH, 300.0), "s", color=GREEN, ms=7, label="Kp = 10 kN/m")
    axes[1].axvline(FALL, color=GREY, ls="--", lw=1.3, label="steepest fall")
    axes[1].set(xlabel="Kd [N s/m]", ylabel="ripple of the velocity", ylim=(1e-6, 10.0))
    axes[1].legend(fontsize=8.5, loc="lower left")
    swings = [1e6 * float(np.ptp(at_constant_speed(Kp, 20.0)[1])) for Kp in STIFF]
    axes[2].loglog([1e-3 * Kp for Kp in STIFF], swings, "o-", color=BLACK, lw=1.3)
    axes[2].set(xlabel="Kp [kN/m], Kd = 20 N s/m", ylabel="oscillation of the error [µm]", ylim=(1.0, 1e3))
    save(figure, __file__, folder)

    behind = 1e6 * float(at_constant_speed(KP, 600.0)[1].mean())
    sliding = FC + (FS - FC) * exp(-((SPEED / VS) ** 2)) + 0.4 * SPEED
    left = 1e6 * abs(float(at_constant_speed(HIGH, 600.0, 1e5)[1].mean()))
    forces = {Kp: first_force(Kp) for Kp in (KP, HIGH)}
    checks = [Check(f"Kp = 1 kN/m, Kd = {Kd:g} N s/m: ripple", ripple(KP, Kd), "", 0.5) for Kd in GAINS if Kd < FALL]
    checks += [small(f"Kp = 1 kN/m, Kd = {Kd:g} N s/m: ripple", ripple(KP, Kd), 0.01) for Kd in GAINS if Kd > FALL]
    checks += [
        small("Kp = 10 kN/m, Kd = 300 N s/m: ripple", ripple(HIGH, 300.0), 0.01),
        *(Check(f"Kp = {1e-3 * Kp:g} kN/m, Kd = 20 N s/m: ripple", ripple(Kp, 20.0), "", 0.5) for Kp in STIFF[1:]),
        Check("Kd = 20 N s/m: amplitude at 100 kN/m relative to that at 1 kN/m", swings[-1] / swings[0], "", 0.0, 0.02),
        near("Kp = 1 kN/m: error behind the reference", behind, 1e6 * sliding / KP, 0.001, "µm"),
        small("with an integral: error behind the reference", left, 0.01, "µm"),
        *(
            near(
                f"Kd = 429 N s/m, Ts = {1e3 * Ts:g} ms: growth in 10 samples",
                growth(429.0, Ts),
                (429.0 * Ts - 1) ** 10,
                1e-6,
            )
            for Ts in (4e-3, 5e-3)
        ),
        near("step of 1 mm, Kp = 1 kN/m: largest force", forces[KP], KP * 1e-3, 0.02, "N"),
        near("step of 1 mm, Kp = 10 kN/m: largest force", forces[HIGH], HIGH * 1e-3, 0.02, "N"),
    ]
    return Effect(
        f"At Kp = 1 kN/m the standard deviation of the velocity is {100.0 * ripple(KP, 300.0):.0f} % of its mean with "
        f"Kd = 300 N s/m and below 1 % with 500. The PD controller lags by {1e-3 * behind:.2f} mm, with an integral "
        f"by less than 0.01 µm. With Kd = 20 N s/m, 100 kN/m still leave oscillations of {swings[-1]:.0f} µm.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
