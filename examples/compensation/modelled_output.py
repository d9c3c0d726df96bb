"""Friction computed from a modelled velocity fails under an unknown load

The sign of friction can come from the reference, from the measured velocity, or from the velocity that a model of the
velocity loop has under the command of the position loop. The last is free of noise and follows corrections. Left:
error over the peak speed of a sine; right: its standard deviation under a constant load, which the model does not
know.

The axis has LuGre friction under a cascade of two proportional loops, KP = 63 / s and CV = 127 N s/m, with feedforward
of velocity, viscous friction and inertia. The friction is Karnopp's with a narrow band, 0.1 mm/s. With the feedforward
the modelled velocity is nearly that of the reference, and the error is within 20 % of that with friction on the
reference at peak speeds of 1.3 and 3.1 mm/s. Elsewhere it differs: at 0.3 and at 31 mm/s it is a seventh of it or
less, at 63 mm/s 66 % larger. With a band of 1 mm/s, which is not small against the slow motions, it is between 0.13
and 1.5 times that on the reference.

The modelled mass matters too. Twice the mass changes the error by less than 2 % up to 3.1 mm/s and makes it 2.7 to 10
times larger at 31 and 63 mm/s: in the lag of the model, m/CV = 8 ms, the reversal at 31 mm/s brings 1.6 mm/s, more
than the Stribeck velocity. With the acceleration into the model (law MultiLoopKarnopp) the model does not lag, and at
31 and 63 mm/s the error is within 3 % of that with friction on the reference. A PI velocity loop in axis and model
leaves a quarter at 1.3 and 3.1 mm/s. Without the command feedforward the mass matters as little at 3.1 mm/s as with
it. A constant load is carried by the position loop, whose command then has an offset of up to load/CV. Where that
exceeds the speed of the motion, as with 1 N at 3.1 mm/s, the compensation fails: with 3 N the error varies as without
it. With friction on the reference nothing changes.

The errors were computed independently, with a Runge-Kutta method of steps of 2.5 µs from sample to sample.

Source: the structure is written as a summary states it, since its paper was not found; Karnopp, ASME J. Dynamic
Systems, Measurement, and Control 107(1), 1985 (the friction).
"""

from functools import cache
from math import inf, pi
from pathlib import Path

from _axis import cosine, error, follow
from _effect import Check, Effect, command_line, near
from _loop import BLACK, BLUE, GREEN, GREY, RED, Array, panels, rms, save

M, KP, CV, VISCOUS = 1.0, 63.0, 127.0, 0.4  # mass [kg], gains [1/s, N s/m], viscous friction [N s/m]
NARROW, WIDE = 1e-4, 1e-3  # half width of the band that counts as rest [m/s]
SINES = ((1e-4, 0.5), (1e-3, 0.2), (1e-3, 0.5), (1e-3, 1.0), (5e-3, 1.0), (1e-2, 1.0))  # amplitude [m], frequency [Hz]
NONE = (89.48, 145.2, 128.7, 119.3, 121.1, 122.1)  # root mean square of the error by sine, not compensated [µm]
RMS = {  # with friction on the reference, on the modelled output, and that with twice the mass [µm], by band and sine
    NARROW: (
        (50.13, 3.721, 3.775),
        (36.24, 32.75, 32.93),
        (21.94, 18.90, 18.85),
        (9.544, 6.001, 5.393),
        (3.303, 0.4363, 4.268),
        (2.025, 3.361, 10.50),
    ),
    WIDE: (
        (89.52, 11.35, 11.56),
        (106.2, 31.69, 31.78),
        (34.57, 18.90, 18.56),
        (8.583, 5.647, 5.958),
        (2.524, 1.471, 4.035),
        (2.082, 3.030, 8.195),
    ),
}
OPTIONS = {  # error of MultiLoopKarnopp with the narrow band by sine [µm]: parameters and values
    "P": ({}, (3.593, 32.84, 18.92, 6.043, 0.4231, 2.935)),
    "P and acceleration": ({"Ka_model": M}, (3.577, 32.83, 18.93, 7.120, 3.224, 2.024)),
    "PI": ({"CV_num[2]": 8e3}, (4.206, 6.949, 4.969, 5.624, 2.789, 1.795)),
}
LOADED = SINES[2]
SWINGS = {  # standard deviation of the error of that sine by load [N]: on the reference, on the modelled output [µm]
    0.0: (21.94, 18.90),
    0.3: (21.94, 18.14),
    1.0: (21.94, 51.86),
    2.0: (21.94, 102.2),
    3.0: (21.94, 128.7),
}
WITHOUT_COMMAND = (41.39, 41.45)  # error of that sine without command feedforward, with the mass and with twice it [µm]
COLOURS = {"reference": BLACK, "modelled output": BLUE, "modelled output, twice the mass": RED}


@cache
def run(
    sine: tuple[float, float],
    kind: str,
    band: float = NARROW,
    load: float = 0.0,
    command: float = 1.0,
    gain: float = 1.0,
) -> Array:
    """Error in the second period [µm]."""
    A, f = sine
    settings = {"KP": KP, "CV": CV, "Kv1": command, "Ka": M * command, "Kv2": VISCOUS * command, "DV": band}
    settings |= {"m": 2.0 * M if "twice" in kind else M, "gain": gain}
    controller = ("ModelledOutputKarnopp", settings)
    added = {}
    if kind == "reference":
        controller = ("CascadePPI", {"kp": KP, "kv": CV, "ki": 0.0, "m": 0.0})
        added = {"karnopp": ("KarnoppFeedforward", {"m": M, "Fv": VISCOUS, "DV": band})}
    result = follow(cosine(A, f), controller, 2.0 / f, added=added, mass={"x0": A, "F_load": -load})
    return 1e6 * error(result, 1.0 / f)


@cache
def run_option(sine: tuple[float, float], option: str) -> Array:
    """Error of MultiLoopKarnopp in the second period [µm]."""
    A, f = sine
    settings = {"Kv2": VISCOUS, "DV": NARROW} | OPTIONS[option][0]
    return 1e6 * error(follow(cosine(A, f), ("MultiLoopKarnopp", settings), 2.0 / f, mass={"x0": A}), 1.0 / f)


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the errors by speed and by load, check their values and where they agree."""
    checks = []
    none = [rms(run(sine, "modelled output", gain=0.0)) for sine in SINES]
    speeds = [2e3 * pi * A * f for A, f in SINES]
    for speed, value, known in zip(speeds, none, NONE, strict=True):
        checks.append(near(f"{speed:.1f} mm/s, none: error", value, known, 0.02, "µm"))
    found: dict[tuple[float, str], list[float]] = {}
    for band, rows in RMS.items():
        if band == WIDE and not full:
            continue
        for kind in COLOURS:
            found[band, kind] = [rms(run(sine, kind, band)) for sine in SINES]
        for i, (speed, row) in enumerate(zip(speeds, rows, strict=True)):
            of = f"{speed:.1f} mm/s, band {1e3 * band:g} mm/s"
            on, modelled, twice = (found[band, kind][i] for kind in COLOURS)
            for kind, known in zip(COLOURS, row, strict=True):
                checks.append(near(f"{of}, {kind}: error", found[band, kind][i], known, 0.02, "µm"))
            low, high = (0.8, 1.2) if band == NARROW and 1.0 < speed < 5.0 else (-inf, inf)
            checks.append(Check(f"{of}: modelled output over reference", modelled / on, "", low, high))
            low, high = (0.95, 1.05) if speed < 5.0 else (-inf, inf)
            checks.append(Check(f"{of}: twice the mass over the mass", twice / modelled, "", low, high))
    options: dict[str, list[float]] = {}
    for option, (_, errors) in OPTIONS.items():
        options[option] = [rms(run_option(sine, option)) for sine in SINES]
        for speed, value, known in zip(speeds, options[option], errors, strict=True):
            checks.append(near(f"{speed:.1f} mm/s, model by Tustin, {option}: error", value, known, 0.02, "µm"))
    for i in (4, 5):
        ratio = options["P and acceleration"][i] / found[NARROW, "reference"][i]
        checks.append(near(f"{speeds[i]:.1f} mm/s, acceleration into the model: over reference", ratio, 1.0, 0.03))
    for i in (1, 2):
        ratio = options["PI"][i] / options["P"][i]
        checks.append(Check(f"{speeds[i]:.1f} mm/s, PI velocity loop over P", ratio, "", 0.15, 0.3))
    loads = [load for load in SWINGS if full or load != 2.0]
    swings: dict[str, list[float]] = {"reference": [], "modelled output": []}
    for load in loads:
        for kind, known in zip(swings, SWINGS[load], strict=True):
            if kind == "reference" and load not in (0.0, 3.0):
                continue
            swings[kind].append(float(run(LOADED, kind, load=load).std()))
            checks.append(near(f"3.1 mm/s, {load:g} N, {kind}: swings", swings[kind][-1], known, 0.02, "µm"))
    lost = swings["modelled output"][-1] / none[2]
    checks.append(near("3.1 mm/s, 3 N: variation relative to that without compensation", lost, 1.0, 0.01))
    if full:
        for kind, known in zip(list(COLOURS)[1:], WITHOUT_COMMAND, strict=True):
            text = f"3.1 mm/s without command feedforward, {kind}: error"
            checks.append(near(text, rms(run(LOADED, kind, command=0.0)), known, 0.02, "µm"))

    figure, axes = panels("Friction computed from a modelled velocity fails under a load", 1, 2, (9.4, 4.0))
    axes[0].loglog(speeds, none, "o-", color=GREY, lw=1.5, ms=5, label="not compensated")
    for kind, colour in COLOURS.items():
        style = "o--" if "twice" in kind else "o-"
        axes[0].loglog(speeds, found[NARROW, kind], style, color=colour, lw=1.5, ms=5, label=kind)
    for option, style, colour in (("P and acceleration", "s:", BLUE), ("PI", "^-", GREEN)):
        axes[0].loglog(speeds, options[option], style, color=colour, lw=1.5, ms=5, label=f"Tustin, {option}")
    axes[0].set(xlabel="peak speed [mm/s]", ylabel="error, rms [µm]", ylim=(0.2, 3e4))
    axes[0].set_xticks([0.3, 1.0, 3.0, 10.0, 30.0], ["0.3", "1", "3", "10", "30"])
    axes[0].set_xticks([], minor=True)
    axes[0].legend(loc="upper left", fontsize=8.5)
    axes[1].axhline(none[2], color=GREY, lw=1.5)
    for kind, values in swings.items():
        axes[1].plot(loads if len(values) > 2 else [0.0, 3.0], values, "o-", color=COLOURS[kind], lw=1.5, ms=5)
    axes[1].set(xlabel="load [N], sine of 3.1 mm/s", ylabel="standard deviation of the error [µm]", ylim=(0.0, 145.0))
    save(figure, __file__, folder)
    ratios = [b / a for a, b in zip(found[NARROW, "reference"], found[NARROW, "modelled output"], strict=True)]
    return Effect(
        "The error is "
        + ", ".join(f"{ratio:.2f}" for ratio in ratios)
        + " times that with friction of the reference, at peak speeds of "
        + ", ".join(f"{speed:.1f}" for speed in speeds)
        + f" mm/s. A load of 3 N raises its standard deviation from {swings['modelled output'][0]:.0f} to "
        f"{swings['modelled output'][-1]:.0f} µm.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
