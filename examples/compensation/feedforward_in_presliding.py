"""In presliding, feedforward needs a model with memory

The plant has GMS friction. On a multisine within the presliding range, reversals follow inside reversals, and friction
depends on all of them. Only GMS, the exact model, remembers: it leaves less than 1 % of the error. LuGre and Dahl
forget and leave a third or more; static friction does harm there but helps in sliding.

The multisine has 8, 6, 4 and 4 µm at 1, 3, 5 and 7 Hz; the sliding motion is a cosine of 5 mm at 1 Hz. All models have
the static friction curve of the plant (Dahl's its Coulomb level) and its stiffness at rest, 85.5 kN/m; LuGre has no
bristle damping, because the plant has none. With stiffnesses and levels 10 % too high or too low GMS still leaves 6 to
13 %. Stiffness and level of LuGre can be fitted to one motion: on a single cosine of 20 µm the fit leaves 2 %, hardly
more than GMS; on a multisine of the same size it leaves 19 %.

The ratios and the fits were computed independently, with a fixed-step solver of 1 µs and independent code for the
laws.

Source: Lampaert, Swevers, Al-Bender, American Control Conference, 2004 (the comparison).
"""

from collections.abc import Mapping
from math import pi
from pathlib import Path

import numpy as np

from _effect import Check, Effect, command_line, near
from _loop import BLACK, BLUE, FC, FS, GREEN, RED, Array, panels, rms, run, save

Sines = tuple[tuple[float, float, float], ...]  # amplitude [m], frequency [Hz], sign of the cosine

STIFFNESS, VISCOUS = 85.5e3, 0.4  # of the plant at rest [N/m], [N s/m]
SMALL: Sines = ((8e-6, 1.0, 1.0), (6e-6, 3.0, -1.0), (4e-6, 5.0, 1.0), (4e-6, 7.0, 1.0))
LARGE: Sines = ((5e-3, 1.0, 1.0),)
SINGLE: Sines = ((21.6e-6, 1.0, 1.0),)
WIDE: Sines = tuple((2.0 * amplitude, frequency, sign) for amplitude, frequency, sign in SMALL)
MODELS = {
    "static": ("StaticFeedforward", {"Fc": FC, "Fs": FS, "Fv": VISCOUS}),
    "Dahl": ("DahlFeedforward", {"sigma": STIFFNESS, "Fc": FC, "Fv": VISCOUS}),
    "LuGre": ("LuGreFeedforward", {"sigma0": STIFFNESS, "sigma1": 0.0, "sigma2": VISCOUS, "Fc": FC, "Fs": FS}),
    "GMS": ("GMSFeedforward", {}),
}
RATIOS = {"static": 7.635, "Dahl": 0.3986, "LuGre": 0.3175}  # on the small multisine
FITS = {"cosine": (SINGLE, 61880.0, 1.835, 0.0218), "multisine": (WIDE, 60410.0, 2.025, 0.1868)}  # [N/m], [N], ratio
STIFFNESSES = (28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3, 2.1e3)  # of the elements [N/m]
OFF = {(0.9, 0.9): 0.1146, (1.1, 1.1): 0.1250, (0.9, 1.1): 0.0610, (1.1, 0.9): 0.0590}  # stiffness, levels


def follow(sines: Sines, law: str | None, tuned: Mapping[str, float]) -> tuple[Array, Array]:
    """Times [s] and error [m] on a sum of cosines, of the second of two seconds."""
    start = {"mass_x.x0": sum(sign * amplitude for amplitude, _, sign in sines)}
    for k, (amplitude, frequency, sign) in enumerate(sines, 1):
        start |= {f"reference.amplitude[{k}]": amplitude, f"reference.frequency[{k}]": frequency}
        start |= {f"reference.phase[{k}]": sign * pi / 2.0}
    values = {"m": 0.0, **tuned} if law else {}
    result = run("Sine", {"x": ("r", "rd", "rdd")}, 2.0, start, friction="GMS", compensator=law, tuned=values)
    t = result["time"].to_numpy()
    return t[t >= 1.0], (result["reference.r"] - result["mass_x.x"]).to_numpy()[t >= 1.0]


def ratio(sines: Sines, law: str, tuned: Mapping[str, float]) -> float:
    """Error with feedforward relative to that without."""
    return rms(follow(sines, law, tuned)[1]) / rms(follow(sines, None, {})[1])


def main(folder: Path, full: bool = False) -> Effect:
    """Draw errors and ratios, check their order."""
    figure, axes = panels("In presliding, feedforward needs a model with memory", 1, 2, (9.0, 3.8))
    t, error = follow(SMALL, None, {})
    axes[0].plot(t - 1.0, 1e6 * error, color=BLACK, lw=1.0, label="none")
    for name, colour in (("Dahl", GREEN), ("LuGre", BLUE), ("GMS", RED)):
        axes[0].plot(t - 1.0, 1e6 * follow(SMALL, *MODELS[name])[1], color=colour, lw=1.3, label=name)
    axes[0].set(xlabel="time [s]", ylabel="error [µm]", ylim=(-15.0, 20.0))
    axes[0].set_title("multisine in presliding", fontsize=10)
    axes[0].legend(loc="upper center", ncols=4, fontsize=9)

    small = {name: ratio(SMALL, *model) for name, model in MODELS.items()}
    large = {name: ratio(LARGE, *model) for name, model in MODELS.items()}
    place = np.arange(len(MODELS))
    axes[1].bar(place - 0.2, list(small.values()), 0.38, color=BLUE, label="presliding")
    axes[1].bar(place + 0.2, list(large.values()), 0.38, color=RED, label="sliding, 5 mm")
    axes[1].axhline(1.0, color=BLACK, lw=1.0)
    axes[1].set(yscale="log", ylabel="error relative to no compensation", ylim=(1e-3, 30.0))
    axes[1].set_xticks(place, list(MODELS))
    axes[1].legend(fontsize=9)
    save(figure, __file__, folder)

    checks = [near(f"multisine, {name}: ratio", small[name], known, 0.02) for name, known in RATIOS.items()]
    checks += [
        Check("multisine, GMS: ratio", small["GMS"], "", 0.0, 0.01),
        Check("multisine: error with LuGre relative to that with Dahl", small["LuGre"] / small["Dahl"], "", 0.0, 1.0),
        Check("multisine: error with GMS relative to that with LuGre", small["GMS"] / small["LuGre"], "", 0.0, 0.1),
        Check("sliding, static: ratio", large["static"], "", 0.0, 0.5),
        Check("sliding, GMS: ratio", large["GMS"], "", 0.0, 0.01),
    ]
    if full:
        for name, (sines, stiffness, level, known) in FITS.items():
            tuned = {"sigma0": stiffness, "sigma1": 0.0, "sigma2": VISCOUS, "Fc": level / 1.5, "Fs": level}
            checks.append(
                near(f"{name} of 20 µm, LuGre fitted: ratio", ratio(sines, "LuGreFeedforward", tuned), known, 0.05)
            )
            checks.append(Check(f"{name} of 20 µm, GMS: ratio", ratio(sines, "GMSFeedforward", {}), "", 0.0, 0.01))
        for (share, level), known in OFF.items():
            tuned = {f"k[{i}]": share * each for i, each in enumerate(STIFFNESSES, 1)}
            tuned |= {"Fc": level * FC, "Fs": level * FS, "sigma2": level * VISCOUS}
            name = f"multisine, GMS with {share:g} of the stiffness and {level:g} of the levels: ratio"
            found = ratio(SMALL, "GMSFeedforward", tuned)
            checks += [near(name, found, known, 0.05)]
    return Effect(
        "Error relative to no feedforward, in presliding: "
        + ", ".join(f"{name} {value:.2g}" for name, value in small.items())
        + "; in sliding: "
        + ", ".join(f"{name} {value:.2g}" for name, value in large.items())
        + ".",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
