"""A Kalman filter estimates friction without a friction model

The filter models friction as a random walk, estimates it from the position and the applied force, and feeds it back.
With a position measured to 1 nm it is fast and leaves little of the error. With 0.3 µm, the noise of an encoder of 1
µm, it must be slower and is late at reversals.

The axis has LuGre friction on a cosine of 1 Hz. It is measured without noise here: the numbers show the lag only,
which has a closed form. For friction that grows at the rate c the estimate is c (m |K2/K3| - Ts/2) too small, where K2
and K3 are the steady gains of velocity and force from the algebraic Riccati equation. This is checked where an axis
with viscous friction, 8 N s/m, accelerates at 2.5 m/s2, so that c = 20 N/s, under the same control.

The errors were computed independently, with a fixed-step solver of 1 µs for the plant and a filter in textbook form.

Source: Ray, Ramasubramanian, Townsend, Control Engineering Practice 9(2), 2001; Anderson, Moore: Optimal Filtering,
1979.
"""

from math import pi
from pathlib import Path

import numpy as np
from scipy.linalg import solve_discrete_are

from _effect import Check, Effect, command_line, near
from _loop import BLACK, BLUE, GREY, RED, TS, panels, rms, run, save
from harness import Result

F_STEP = 0.03  # standard deviation of the change of friction in a sample [N]
FINE, COARSE = 1e-9, 3e-7  # standard deviation of the measured position [m]
RATIOS = {  # of RMS errors, by amplitude [m], with the fine and the coarse measurement
    5e-6: (0.0055, 0.0291),
    5e-5: (0.0093, 0.0545),
    5e-4: (0.0265, 0.1351),
    5e-3: (0.0358, 0.1777),
}
DAMPING, ACCELERATION = 8.0, 2.5  # of the axis that speeds up [N s/m], [m/s2]
AXES = {"x": ("r", "rd", "rdd")}


def follow(amplitude: float, x_noise: float | None) -> tuple[Result, float]:
    """Two periods of the cosine, and the RMS error of the second [m]."""
    start = {"reference.amplitude[1]": amplitude, "reference.phase[1]": pi / 2.0, "mass_x.x0": amplitude}
    tuned = {"x_noise": x_noise, "F_step": F_STEP} if x_noise else {}
    result = run("Sine", AXES, 2.0, start, compensator="KalmanFriction" if x_noise else None, tuned=tuned)
    error = (result["reference.r"] - result["mass_x.x"]).to_numpy()
    return result, rms(error[result["time"].to_numpy() >= 1.0])


def lag(x_noise: float) -> float:
    """Of the closed form, for friction that grows by 1 N/s [N]."""
    units = np.array([TS**2, TS, 1.0]) * F_STEP  # make the matrices numbers near 1
    A = np.array([[1.0, 1.0, -0.5], [0.0, 1.0, -1.0], [0.0, 0.0, 1.0]])
    c = np.array([[1.0], [0.0], [0.0]])
    noise = np.array([[(x_noise / units[0]) ** 2]])
    P = solve_discrete_are(A.T, c, np.diag([0.0, 0.0, 1.0]), noise)
    K = units * (P @ c / (P[0, 0] + noise))[:, 0]
    return float(abs(K[1] / K[2]) - TS / 2.0)


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the estimate and the ratios, check them and the lag on a ramp."""
    figure, axes = panels("A Kalman filter estimates friction without a friction model", 1, 2, (9.0, 3.8))
    checks, ratios = [], []
    for amplitude, expected in RATIOS.items():
        without = follow(amplitude, None)[1]
        runs = [follow(amplitude, x_noise) for x_noise in (FINE, COARSE)]
        ratios.append([error / without for _, error in runs])
        name = f"{1e6 * amplitude:g} µm"
        checks.append(Check(f"{name}: ratio with a position to 1 nm", ratios[-1][0], "", 0.0, 0.05))
        for label, found, known in zip(("1 nm", "0.3 µm"), ratios[-1], expected, strict=True):
            checks.append(near(f"{name}, {label}: ratio relative to that of the reference", found / known, 1.0, 0.05))

    t = runs[0][0]["time"].to_numpy()
    near_reversal = np.abs(t - 1.5) < 0.06
    since = 1e3 * (t[near_reversal] - 1.5)
    friction = runs[0][0]["friction_x.F"].to_numpy()[near_reversal]
    axes[0].plot(since, friction, color=BLACK, lw=1.3, label="friction")
    for (result, _), colour, label in zip(runs, (RED, BLUE), ("position to 1 nm", "to 0.3 µm"), strict=True):
        estimate = result["compensator_x.F_hat"].to_numpy()[near_reversal]
        axes[0].plot(since, estimate, color=colour, lw=1.3, label=f"estimate, {label}")
    axes[0].set(xlabel="time after a reversal [ms]", ylabel="force [N]")
    axes[0].set_title("5 mm", fontsize=10)
    axes[0].legend(loc="upper left", fontsize=9)
    for column, colour, label in ((0, RED, "position to 1 nm"), (1, BLUE, "to 0.3 µm")):
        shown = [ratio[column] for ratio in ratios]
        axes[1].loglog([1e3 * each for each in RATIOS], shown, color=colour, marker="o", ms=4, label=label)
    axes[1].axhline(0.05, color=GREY, ls="--", lw=1.0)
    axes[1].set(xlabel="amplitude [mm]", ylabel="error relative to no compensation", ylim=(3e-3, 1.0))
    axes[1].legend(loc="upper left", fontsize=9)
    save(figure, __file__, folder)

    rate = DAMPING * ACCELERATION
    for x_noise, label in ((FINE, "1 nm"), (COARSE, "0.3 µm")):
        start = {"reference.r_end": 4.0, "reference.v_max": 2.5, "reference.a_max": ACCELERATION}
        start |= {"reference.j_max": 500.0, "friction_x.Fv": DAMPING}
        tuned = {"x_noise": x_noise, "F_step": F_STEP}
        ramp = run(
            "Profile",
            {"x": ("r", "rd", "rdd")},
            0.9,
            start,
            friction="Viscous",
            compensator="KalmanFriction",
            tuned=tuned,
        )
        # the value recorded after a step is the estimate of the sample at its beginning
        late = ramp["friction_x.F"].to_numpy()[-2] - ramp["compensator_x.F_hat"].to_numpy()[-1]
        checks.append(
            near(f"ramp of 20 N/s, {label}: lag of the estimate", 1e3 * late, 1e3 * rate * lag(x_noise), 0.01, "mN")
        )
    fine, coarse = zip(*ratios, strict=True)
    return Effect(
        f"From 5 µm to 5 mm, a position to 1 nm leaves {100 * min(fine):.2g} to {100 * max(fine):.2g} % of the error, "
        f"a position to 0.3 µm {100 * min(coarse):.2g} to {100 * max(coarse):.2g} %.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
