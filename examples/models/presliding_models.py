"""Before it slides, a contact is a spring with or without hysteresis

Four panels show loops on a sine in presliding. The seven-parameter model is a spring without hysteresis; Dahl, LuGre
and Maxwell slip dissipate energy. The last two panels show the displacement that remains after a force of 0.6 N was
applied and released. Dahl and LuGre do not return to the start; ElastoPlastic does.

The amplitude is 20 µm, 10 µm for the seven-parameter model, which would slide otherwise. That model follows one line,
kt x, at 20 Hz as well; at break-away its force jumps by as much as the Stribeck curve is lower at that speed. Dahl's
loops have the areas 4 Fc (A - Fc/sigma tanh(sigma A/Fc)) for n = 1 and 4 Fc (A - Fc/sigma) for n = 0, Maxwell slip has
sum 4 Wi (A - Wi/ki). With constant g and without its two other terms LuGre is Dahl's model, to rounding.

After a force F, Dahl's model remains displaced by -(Fc/sigma) ln(1 - (F/Fc)^2), and LuGre by the same with Fs and
sigma0, although its bristles are straight again. ElastoPlastic returns up to its break-away deflection.

Source: Dahl, AIAA Journal 14(12), 1976; Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995; Dupont,
Hayward, Armstrong, Altpeter, IEEE TAC 47(5), 2002; the closed forms follow from the equations.
"""

from collections.abc import Mapping
from math import log, tanh
from pathlib import Path

import numpy as np

from _common import BLACK, BLUE, GREEN, GREY, RED, Array, along, command_line, panels, save, with_mass

A, SMALL, F_MAX = 2e-5, 1e-5, 0.6  # [m], [m], [N]
FC, FS, SIGMA = 1.0, 1.5, 1e5  # [N], [N], [N/m]
BARE = {"sigma1": 0.0, "sigma2": 0.0, "Fs": FC}  # what makes LuGre Dahl's model
N = 400  # steps of a period
FAST = 1e-3  # speed at which the seven-parameter model breaks away [m/s]


def loop(model: str, amplitude: float, parameters: Mapping[str, float], frequency: float = 0.01) -> tuple[Array, Array]:
    """Position [m] and force [N] of the third period."""
    x = amplitude * np.sin(2.0 * np.pi * np.arange(3 * N + 1) / N)
    F = along(model, x, 1.0 / (frequency * N), parameters)["friction.F"].to_numpy()
    return x[2 * N :], F[2 * N :]


def area(x: Array, F: Array) -> float:
    """Work of friction in a period [J], by the trapezoidal rule."""
    return float(np.trapezoid(F, x))


def released(model: str, parameters: Mapping[str, float]) -> tuple[Array, Array]:
    """Position [m] and driving force [N] of 1 kg while F_MAX is applied and released in 6 s, and then 1 s of rest."""

    def push(t: float) -> float:
        return max(F_MAX * (1.0 - abs(t / 3.0 - 1.0)), 0.0)

    damped = {"d": 30.0}  # so that an undamped contact does not ring
    result = with_mass(model, 7.0, 1e-3, parameters, push=push, mass=damped)
    return result["mass.x"].to_numpy(), np.array([push(t) for t in result["time"].to_numpy()])


def break_away(step: float) -> float:
    """Largest change of the force of the seven-parameter model in one step [N], at a constant speed."""
    F = along("SevenParameter", np.arange(0.0, 2e-5, FAST * step), step)["friction.F"].to_numpy()
    return float(np.diff(F).min())


def main(folder: Path) -> str:
    """Draw loops and releases, check areas and what stays."""
    figure, axes = panels("Presliding: loops, and the displacement that a released force leaves", 2, 3, (10.0, 6.2))
    cases = [
        ("SevenParameter", "SevenParameter", SMALL, {}, RED),
        ("Dahl, n = 1 (line) and 0", "Dahl", A, {}, BLUE),
        ("Dahl, n = 1 (line) and 0", "Dahl", A, {"n": 0.0}, GREY),
        ("LuGre", "LuGre", A, {}, GREEN),
        ("MaxwellSlip", "MaxwellSlip", A, {}, BLACK),
    ]
    places = {title: axis for title, axis in zip(dict.fromkeys(case[0] for case in cases), axes, strict=False)}
    areas = []
    for title, model, amplitude, parameters, colour in cases:
        x, F = loop(model, amplitude, parameters)
        areas.append(area(x, F))
        places[title].plot(1e6 * x, F, color=colour, lw=1.5, ls="--" if parameters else "-")
        places[title].set(
            title=title, xlabel="position [µm]", ylabel="friction [N]", xlim=(-22, 22), ylim=(-1.45, 1.45)
        )
    stays = {}
    for model, colour in (("Dahl", BLUE), ("LuGre", GREEN), ("ElastoPlastic", RED)):
        x, F = released(model, {})
        stays[model] = float(x[-500:].mean())
        axes[4].plot(1e6 * x, F, color=colour, lw=1.5, label=model)
    axes[4].set(title="0.6 N, applied and released", xlabel="position [µm]", ylabel="force on the mass [N]")
    axes[4].set_xlim(0.0, 14.0)
    axes[4].legend(fontsize=9, loc="upper right")
    share = np.linspace(0.01, 0.99, 99)
    axes[5].plot(share, -np.log(1.0 - share**2), color=BLACK, lw=1.2, label="closed form")
    for model, level, colour in (("Dahl", FC, BLUE), ("LuGre", FS, GREEN)):
        axes[5].plot(F_MAX / level, stays[model] * SIGMA / level, "o", color=colour, ms=6, label=model)
    axes[5].set(
        title="remaining displacement",
        xlabel="force over level",
        ylabel="displacement / (level/stiffness)",
        ylim=(0.0, 2.0),
    )
    axes[5].legend(fontsize=9)
    save(figure, __file__, folder)

    seven, dahl, plastic, _, maxwell = areas
    for frequency in (0.01, 20.0):  # slow, and fast against tau_L
        x, F = loop("SevenParameter", SMALL, {}, frequency)
        assert np.abs(F - SIGMA * x).max() < 1e-9
    assert abs(seven) < 1e-12
    late = 0.3 * 0.012 / 1.012  # growth of stiction in the 12 ms until it breaks away
    jump = (0.2 + late) * (1.0 - 0.5)  # of Fs, with v = vs in the curve
    assert abs(-break_away(1e-5) - jump) < 0.02 * jump and abs(-break_away(5e-6) - jump) < 0.01 * jump
    assert abs(dahl / (4.0 * FC * (A - FC / SIGMA * tanh(SIGMA * A / FC))) - 1.0) < 1e-3
    assert abs(plastic / (4.0 * FC * (A - FC / SIGMA)) - 1.0) < 2e-3  # of the trapezoidal rule
    stiffness = np.array([28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3, 2.1e3])
    assert abs(maxwell / (4.0 * 0.1 * np.maximum(A - 0.1 / stiffness, 0.0).sum()) - 1.0) < 2e-3
    bare = np.abs(loop("LuGre", A, BARE)[1] - loop("Dahl", A, {})[1]).max()
    assert bare < 1e-12
    first = along("LuGre", [0.0, 1e-8], 10.0)["friction.F"].to_numpy()[-1] / 1e-8
    assert abs(first / SIGMA - 1.0) < 1e-3
    for model, level in (("Dahl", FC), ("LuGre", FS)):
        assert abs(stays[model] / (-level / SIGMA * log(1.0 - (F_MAX / level) ** 2)) - 1.0) < 0.01
    assert abs(stays["ElastoPlastic"]) < 1e-9
    return (
        f"Loops of Dahl and Maxwell slip dissipate {1e6 * dahl:.1f} and {1e6 * maxwell:.1f} µJ, the loop of the "
        f"seven-parameter model 0 µJ; its force jumps by {jump:.3f} N at break-away. After 0.6 N the displacement is "
        f"{1e6 * stays['Dahl']:.2f} µm with Dahl, {1e6 * stays['LuGre']:.2f} µm with LuGre and 0.00 µm with "
        f"ElastoPlastic. The initial stiffness of LuGre is {first / SIGMA:.3f} sigma0; with constant g and nothing "
        "added it equals Dahl's model to 1e-12 N."
    )


if __name__ == "__main__":
    command_line(main)
