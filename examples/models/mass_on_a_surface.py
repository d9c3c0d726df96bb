"""A sliding mass comes to rest only if the model handles zero velocity

Friction stops a mass that slides at 50 mm/s. Shown are the last 4 mm/s in steps of 1 ms. With Coulomb's or Karnopp's
force computed outside the mass, the velocity oscillates or creeps. KarnoppMass and SwitchMass contain the mass and come
to rest, after the distance that the energy balance gives, m v^2/2 = Fc d.

Coulomb's force, computed from the velocity of each step, makes the velocity oscillate by Fc h/m forever; the harness
warns of this. Karnopp's force beside a mass that is integrated elsewhere does not stop it either: under a force of 0.5
N the mass keeps the velocity at which it entered the band of 1 mm/s, and it jumps over a band of 0.1 mm/s. From rest,
0.9 N does not move KarnoppMass and SwitchMass at all, whereas LuGre yields by -(Fs/sigma0) ln(1 - F/Fs).

Source: Karnopp, ASME J. Dynamic Systems, Measurement, and Control 107(1), 1985; Leine, Van Campen, De Kraker, Van den
Steen, Nonlinear Dynamics 16, 1998.
"""

from collections.abc import Mapping
from math import log, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from _common import BLACK, BLUE, GREEN, GREY, RED, Array, command_line, panels, save, with_mass
from friction_fmus import build
from harness import CallablePart, FmuPart, Port, System

V0, STEP, STOP = 0.05037, 1e-3, 0.2  # [m/s], [s], [s]
FC, FS, SIGMA0 = 1.0, 1.5, 1e5  # [N], [N], [N/m]
PUSH = 0.5  # less than Fc [N]
RIGID = {"Fc": FC, "Fs": FS, "Fv": 0.0}


def outside(model: str, parameters: Mapping[str, float], push: float) -> Array:
    """Velocity [m/s] of a mass that reads the friction of a block, which reads its velocity and the other forces."""
    drive = CallablePart("drive", lambda t, u, x: push, outputs=[Port("F", "N")])
    wires = ["drive.F -> mass.F_drive", "mass.v -> friction.v", "mass.F_ext -> friction.F_ext"]
    start = {"mass.v0": V0} | {f"friction.{name}": value for name, value in parameters.items()}
    with TemporaryDirectory() as folder:
        blocks = {"mass": "Mass", "friction": model}
        parts = [drive, *(FmuPart(name, build(block, Path(folder))) for name, block in blocks.items())]
        with System(parts, [*wires, "friction.F -> mass.F_friction"], start) as system:
            run = system.run(stop=STOP, step=STEP, master="gauss-seidel")
    return np.asarray(run["mass.v"].to_numpy())


def inside(model: str, parameters: Mapping[str, float], push: float, v0: float = V0) -> tuple[Array, float]:
    """Velocity [m/s] of a model with the mass inside, and the way that it goes [m]."""
    force = {"KarnoppMass": "F_ext", "SwitchMass": "F_load"}[model]
    drive = CallablePart("drive", lambda t, u, x: push, outputs=[Port("F", "N")])
    start = {"mass.v0": v0} | {f"mass.{name}": value for name, value in parameters.items()}
    with TemporaryDirectory() as folder:
        parts = [drive, FmuPart("mass", build(model, Path(folder)))]
        with System(parts, [f"drive.F -> mass.{force}"], start) as system:
            run = system.run(stop=STOP, step=STEP)
    return run["mass.v"].to_numpy(), float(run["mass.x"][-1])


def sketch(axis: Axes) -> None:
    """The mass, the surface and the forces."""
    axis.set(xlim=(0.0, 10.0), ylim=(-1.6, 6.4), aspect="equal")
    axis.axis("off")
    axis.plot([0.3, 9.7], [0.0, 0.0], color=BLACK, lw=2.0)
    for x in np.arange(0.5, 9.6, 0.5):
        axis.plot([x, x - 0.4], [0.0, -0.5], color=GREY, lw=1.0)
    axis.add_patch(Rectangle((3.0, 0.0), 4.0, 2.6, facecolor="#dde8f0", edgecolor=BLACK, lw=1.6))
    axis.text(5.0, 1.3, "m", ha="center", va="center", fontsize=14, style="italic")
    for start, end, label, at, colour in (
        ((1.0, 1.6), (2.95, 1.6), "F_ext", (1.0, 2.0), BLACK),
        ((5.0, 0.2), (2.2, 0.2), "F", (1.7, 0.35), RED),
        ((5.0, 4.6), (5.0, 2.65), "Fn", (5.25, 4.0), BLACK),
        ((4.0, 5.4), (6.6, 5.4), "x, v", (6.8, 5.25), BLUE),
    ):
        axis.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.8})
        axis.text(*at, label, color=colour, fontsize=11, style="italic")


def main(folder: Path) -> str:
    """Draw the mass and how it stops, check where it stops and what does not."""
    t = 1e3 * STEP * np.arange(round(STOP / STEP) + 1)
    coulomb = outside("Coulomb", {"Fc": FC}, 0.0)
    creeping = outside("Karnopp", RIGID | {"DV": 1e-3}, PUSH)
    jumping = outside("Karnopp", RIGID | {"DV": 1e-4}, PUSH)
    karnopp, karnopp_way = inside("KarnoppMass", RIGID, 0.0)
    switch, switch_way = inside("SwitchMass", {"Fs": FC, "ratio": 1.0, "k": 1.0, "v_belt": 0.0}, 0.0)

    figure, (drawing, stop) = panels("A mass that friction stops", 1, 2, (9.4, 4.0))
    sketch(drawing)
    for label, v, colour, width in (
        ("Coulomb", coulomb, GREY, 1.0),
        ("Karnopp, band 1 mm/s, 0.5 N act", creeping, RED, 1.8),
        ("Karnopp, band 0.1 mm/s, 0.5 N act", jumping, BLACK, 0.9),
        ("KarnoppMass", karnopp, BLUE, 3.6),
        ("SwitchMass", switch, GREEN, 1.8),
    ):
        stop.plot(t, 1e3 * v, color=colour, lw=width, label=label)
    stop.set(xlabel="time [ms]", ylabel="velocity [mm/s]", xlim=(40.0, 130.0), ylim=(-1.5, 4.0))
    stop.legend(loc="upper right", fontsize=8.5)
    save(figure, __file__, folder)

    swing = float(np.ptp(coulomb[100:]))
    assert abs(swing - FC * STEP) < 1e-12  # for a mass of 1 kg
    assert 0.0 < creeping[-1] < 1e-3 and np.ptp(creeping[150:]) < 1e-15  # forever
    assert np.ptp(jumping[150:]) > 1e-4
    assert karnopp[-1] == 0.0 and abs(switch[-1]) <= 1e-6  # within SwitchMass's own band
    assert abs(karnopp_way - (V0**2 - 1e-6) / (2.0 * FC)) < 1e-9  # to the edge of the band
    assert abs(switch_way - (sqrt(FC**2 + V0**2) - FC)) < 1e-8  # with the spring of 1 N/m
    for model, parameters in (("KarnoppMass", RIGID), ("SwitchMass", {"Fs": FC, "v_belt": 0.0})):
        assert inside(model, parameters, 0.9, 0.0)[1] == 0.0
    slow = with_mass("LuGre", 10.0, 2e-3, push=lambda t: 0.09 * t)  # 0.09 N/s, far below the Stribeck velocity
    given = float(slow["mass.x"][-1])
    assert abs(given + FS / SIGMA0 * log(1.0 - 0.9 / FS)) < 0.02 * given
    return (
        f"With Coulomb's force the velocity oscillates over {1e3 * swing:.2f} mm/s forever. With Karnopp's it creeps "
        f"at {1e3 * creeping[-1]:.2f} mm/s or, with a narrow band, oscillates over "
        f"{1e3 * float(np.ptp(jumping[150:])):.2f} mm/s. KarnoppMass rests after {1e3 * karnopp_way:.3f} mm, "
        f"SwitchMass after {1e3 * switch_way:.3f} mm. At 0.9 N LuGre yields by {1e6 * given:.1f} µm, the rigid models "
        "by 0 µm."
    )


if __name__ == "__main__":
    command_line(main)
