"""The benefit of a compensator depends on the amplitude

The tracking error with a compensator over the error without it, on a cosine of 1 Hz, from 5 µm (presliding) to 5 mm
(sliding). Above 1 the compensator does harm: friction computed from the sign of the reference velocity does so in
presliding. The exact model leaves less than 0.5 %. Forces 10 % off leave 10 to 12 %, at every amplitude.

Static friction changes sign at once where the real friction changes gradually: in presliding it is many times worse
than nothing, in sliding it removes nine tenths of the error. Karnopp's band of 1 mm/s covers all of the two small
motions, so it does nothing there. Dahl's model has presliding but no Stribeck curve. GMS, with elements for another
contact of the same levels, leaves a fifth to a third. The exact model as an observer, on the measured velocity, leaves
three to six times as much as on the reference. Observers without a model, a disturbance observer of 50 Hz or a Kalman
filter for a position to 0.3 µm, come close to a model that is 10 % off, and are better where friction changes slowly.
Static friction of the measured velocity does little, because its sign is a straight line up to 10 mm/s.

The ratios were computed independently, with a Runge-Kutta method at steps of 2 µs for the axis and independent code
for all laws.

Source: Swevers, Al-Bender, Ganseman, Prajogo, IEEE TAC 45(4), 2000, and Lampaert, Swevers, Al-Bender, American Control
Conference, 2004 (comparisons in feedforward); Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995 (the
plant).
"""

from collections.abc import Mapping
from math import pi
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from _effect import Check, Effect, command_line, near
from _loop import BLACK, BLUE, FC, FS, GAINS, GREEN, GREY, RED, panels, save
from _servo import error, follow, sines

AMPLITUDES = (5e-6, 5e-5, 5e-4, 5e-3)  # [m]
FREQUENCY, SETTLED, STOP = 1.0, 1.0, 2.0  # of the reference [Hz], start and end of the measurement [s]
INNER = 5  # steps of the axis in a sample
STIFFNESS, DAMPING, VISCOUS = 1e5, 1e5**0.5, 0.4  # of LuGre [N/m], [N s/m], [N s/m]


def lugre(share: float) -> dict[str, float]:
    """Parameters of LuGre's model with all forces scaled."""
    forces = {"sigma0": STIFFNESS, "sigma1": DAMPING, "sigma2": VISCOUS, "Fc": FC, "Fs": FS}
    return {name: share * value for name, value in forces.items()} | {"m": 0.0}


COMPENSATORS: Mapping[str, tuple[str, Mapping[str, float]]] = {  # the mass is in the feedforward of the PID
    "static": ("StaticFeedforward", {"Fc": FC, "Fs": FS, "Fv": VISCOUS, "m": 0.0}),
    "Karnopp": ("KarnoppFeedforward", {"Fc": FC, "Fs": FS, "Fv": VISCOUS, "DV": 1e-3, "m": 1.0}),
    "Dahl": ("DahlFeedforward", {"sigma": STIFFNESS, "Fc": FC, "Fv": VISCOUS, "m": 0.0}),
    "GMS": ("GMSFeedforward", {"Fc": FC, "Fs": FS, "sigma2": VISCOUS, "m": 0.0}),
    "LuGre": ("LuGreFeedforward", lugre(1.0)),
    "LuGre, forces 10 % high": ("LuGreFeedforward", lugre(1.1)),
    "LuGre observer": ("LuGreObserver", {"k": 0.0, "sigma0": STIFFNESS, "sigma1": DAMPING, "sigma2": VISCOUS}),
    "disturbance observer": ("DisturbanceObserver", {"fq": 50.0}),
    "static, feedback": ("StaticFeedback", {"vt": 1e-2, "Fc": FC, "Fs": FS, "Fv": VISCOUS}),
    "Coulomb": ("CoulombFeedforward", {"Fc": FC, "m": 0.0}),
    "elasto-plastic": ("ElastoPlasticFeedforward", {"z_ba": 7e-6, **lugre(1.0)}),
    "modified Leuven": ("ModifiedLeuvenFeedforward", {"Fc": FC, "Fs": FS, "sigma2": VISCOUS, "mass": 0.0}),
    "LuGre, forces 10 % low": ("LuGreFeedforward", lugre(0.9)),
    "Kalman filter": ("KalmanFriction", {"x_noise": 3e-7, "F_step": 0.03}),
}
RATIOS = {  # of RMS errors, at the amplitudes
    "static": (13.86, 0.9252, 0.4333, 0.1137),
    "Karnopp": (1.000, 1.001, 0.7407, 0.1292),
    "Dahl": (0.06983, 0.3321, 0.2449, 0.06882),
    "GMS": (0.1899, 0.3128, 0.3120, 0.2094),
    "LuGre": (0.001613, 0.001508, 0.003755, 0.004483),
    "LuGre, forces 10 % high": (0.1032, 0.1058, 0.1164, 0.1039),
    "LuGre observer": (0.005438, 0.008693, 0.01982, 0.02049),
    "disturbance observer": (0.0290, 0.05358, 0.1314, 0.1688),
    "static, feedback": (0.9949, 0.9818, 0.9174, 0.6516),
    "Coulomb": (9.355, 0.6411, 0.4161, 0.1274),
    "elasto-plastic": (0.1550, 0.1989, 0.1285, 0.04122),
    "modified Leuven": (0.1425, 0.2123, 0.08385, 0.05486),
    "LuGre, forces 10 % low": (0.1022, 0.1043, 0.1109, 0.1026),
    "Kalman filter": (0.02907, 0.05449, 0.1351, 0.1777),
}
STYLES = {
    "static": (RED, "-"),
    "static, feedback": (RED, "--"),
    "Karnopp": (GREEN, "-"),
    "Dahl": (GREEN, "--"),
    "GMS": (BLUE, "-"),
    "disturbance observer": (GREY, "-"),
    "LuGre, forces 10 % high": (BLUE, "--"),
    "LuGre observer": (BLACK, "--"),
    "LuGre": (BLACK, "-"),
}
"""The cases of the figure and of the short run."""
OFF = ("LuGre, forces 10 % high", "LuGre, forces 10 % low")


def tracking(amplitude: float, name: str | None) -> float:
    """Root mean square tracking error on a cosine [m]."""
    gains = {**GAINS, "m": 0.0} if name == "Karnopp" else GAINS
    reference = sines((amplitude, FREQUENCY, pi / 2.0))
    addition = COMPENSATORS[name] if name else None
    start = {"mass.x0": amplitude}
    signals = ("reference.r", "mass.x")
    run = follow("PID", gains, reference, STOP, addition=addition, start=start, inner=INNER, record=signals)
    return error(run, SETTLED)


def label_ends(axes: Axes, ends: Mapping[str, float], apart: float) -> None:
    """Write the names of the lines beside their ends, at least a factor apart."""
    place = 0.0
    for name, end in sorted(ends.items(), key=lambda each: each[1]):
        place = max(end, apart * place)
        axes.annotate(
            name,
            (1e3 * AMPLITUDES[-1], end),
            (1.8e3 * AMPLITUDES[-1], place),
            color=STYLES[name][0],
            fontsize=9,
            va="center",
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": STYLES[name][0],
                "lw": 0.6,
                "shrinkA": 0.0,
                "shrinkB": 3.0,
                "relpos": (0.0, 0.5),
            },
        )


def main(folder: Path, full: bool = False) -> Effect:
    """Draw and check the ratios."""
    alone = [tracking(amplitude, None) for amplitude in AMPLITUDES]
    names = list(COMPENSATORS) if full else list(STYLES)
    found = {
        name: [tracking(amplitude, name) / rest for amplitude, rest in zip(AMPLITUDES, alone, strict=True)]
        for name in names
    }

    figure, (axes,) = panels("The benefit of a compensator depends on the amplitude", 1, 1, (7.6, 4.6))
    for name, (colour, dashes) in STYLES.items():
        axes.loglog([1e3 * each for each in AMPLITUDES], found[name], color=colour, ls=dashes, marker="o", ms=4, lw=1.3)
    axes.axhline(1.0, color=BLACK, ls=":", lw=1.0)
    axes.set(xlabel="amplitude [mm]", ylabel="error relative to no compensation", ylim=(8e-4, 30.0))
    axes.set_xticks([1e3 * each for each in AMPLITUDES], [f"{1e3 * each:g}" for each in AMPLITUDES])
    label_ends(axes, {name: found[name][-1] for name in STYLES}, 1.55)
    save(figure, __file__, folder)

    checks = []
    for i, amplitude in enumerate(AMPLITUDES):
        for name in names:
            label = f"{1e6 * amplitude:g} µm, {name}: ratio"
            checks.append(near(label, found[name][i], RATIOS[name][i], 0.03))
    checks.append(Check("LuGre: largest ratio", max(found["LuGre"]), "", 0.0, 0.01))
    for name in names:
        if name in OFF:
            checks.append(Check(f"{name}: least ratio", min(found[name]), "", 0.05))
            checks.append(Check(f"{name}: largest ratio", max(found[name]), "", 0.0, 0.16))
    checks.append(Check("static: ratio at 5 µm", found["static"][0], "", 1.0))
    late = np.divide(found["LuGre observer"], found["LuGre"])
    checks.append(
        Check("least error with the observer relative to that with the reference", float(late.min()), "", 2.0)
    )
    return Effect(
        f"From 5 µm to 5 mm, the exact model leaves {100 * min(found['LuGre']):.2g} to "
        f"{100 * max(found['LuGre']):.2g} % of the error, forces 10 % too high {100 * min(found[OFF[0]]):.2g} to "
        f"{100 * max(found[OFF[0]]):.2g} %. Static friction makes the error {found['static'][0]:.3g} times as large "
        f"at 5 µm and leaves {100 * found['static'][-1]:.2g} % at 5 mm.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
