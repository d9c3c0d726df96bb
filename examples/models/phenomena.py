"""Which model shows which phenomenon

Each of seven phenomena is one measurement, the same for all models, and counts as present above 1 % (coloured). The
asperities show all of them. GMS lacks dwell, the growth of static friction at rest. LuGre also lacks nonlocal memory
and drifts.

- Stribeck effect: how much lower friction is at 3 mm/s than at 10 µm/s;
- presliding: the force after 1 µm from rest; less than half of the force at 10 µm/s counts as elastic;
- hysteresis: the work in a loop of 12 µm in presliding relative to that of a rigid contact;
- lag: how much higher friction is while the speed rises through 2 mm/s than while it falls, at 20 Hz, without sigma1;
- dwell: growth of the break-away force from 0.1 s to 30 s at rest;
- memory: how much of the force is missing after an inner loop from 15 µm to 0 and back; less than 1 % counts as memory;
- no drift: the drift per cycle under 0.6 N with a vibration of 0.3 N at 1 Hz; less than 1 % of that of LuGre counts.

The exponent n of the two Leuven models is 100 for memory and drift, because their loops close in the position for
large n only, and 2 for the rest. The break-away deflection of ElastoPlastic is 9.5 µm. The last two columns need an
elastic contact; the memory of the seven-parameter model is that of a plain spring.

Source: Al-Bender, Lampaert, Swevers, IEEE TAC 50(11), 2005 (properties to compare models by).
"""

from collections.abc import Mapping
from math import nan, pi, sin
from pathlib import Path

import numpy as np

from _common import BLACK, GREY, Array, along, command_line, panels, polyline, save, with_mass

MODELS: dict[str, Mapping[str, float]] = {
    "Stribeck": {"F_ext": 0.0},
    "SevenParameter": {},
    "Dahl": {},
    "BlimanSorine": {"eps": 1e-4},
    "RateAndState": {},
    "LuGre": {},
    "ElastoPlastic": {"z_ba": 9.5e-6},
    "Leuven": {},
    "ModifiedLeuven": {},
    "GMS": {},
    "GenericAsperity": {},
}
SHARP = {"Leuven": {"n": 100.0}, "ModifiedLeuven": {"n": 100.0}}
UNDAMPED = {name: {"sigma1": 0.0} for name in ("LuGre", "ElastoPlastic", "Leuven", "ModifiedLeuven")}
RIGID = ("Stribeck", "RateAndState")
LOOP = 12e-6  # [m]
PHENOMENA = ("Stribeck effect", "presliding", "hysteresis", "lag", "dwell", "memory", "no drift")
EXPECTED = {  # in the order of PHENOMENA, from the equations of the models
    "Stribeck": "1000000",
    "SevenParameter": "1101111",
    "Dahl": "0110000",
    "BlimanSorine": "0110000",
    "RateAndState": "1001100",
    "LuGre": "1111000",
    "ElastoPlastic": "1111001",
    "Leuven": "1111011",
    "ModifiedLeuven": "1111011",
    "GMS": "1111011",
    "GenericAsperity": "1111111",
}


def force(model: str, path: Array, step: float, more: Mapping[str, float] | None = None) -> Array:
    """Friction [N] along a path."""
    return np.asarray(along(model, path, step, {**MODELS[model], **(more or {})})["friction.F"].to_numpy())


def lag(model: str, level: float) -> float:
    """Friction while the speed rises through 2 mm/s less that while it falls, over a level, after 19 cycles."""
    step = 1e-4
    v = 2e-3 - 1.5e-3 * np.cos(2.0 * pi * 20.0 * np.arange(0.0, 1.0, step))
    F = force(model, np.concatenate([[0.0], np.cumsum(v) * step]), step, UNDAMPED.get(model))[-500:]
    return float(F[115:135].mean() - F[365:385].mean()) / level  # a quarter and three quarters of the period


def dwell(model: str) -> float:
    """Growth of the peak of a slow pull from 0.1 s to 30 s at rest after sliding."""
    step = 0.1
    slid, pulled = 2e-4 * np.arange(21), 1e-7 * np.arange(1, 601)
    peaks = []
    for rest in (1, 300):
        F = force(model, np.concatenate([slid, np.full(rest, slid[-1]), slid[-1] + pulled]), step)
        peaks.append(F[slid.size + rest :].max())
    return float(peaks[1] / peaks[0] - 1.0)


def drift(model: str, parameters: Mapping[str, float]) -> float:
    """Way per cycle of a vibration about a bias [m]."""
    run = with_mass(
        model,
        7.0,
        1e-3,
        parameters,
        push=lambda t: 0.6 * t if t < 1.0 else 0.6 + 0.3 * sin(2.0 * pi * t),
        mass={"d": 10.0},  # so that contacts without damping do not ring
    )
    return abs(float(run["mass.x"][7000] - run["mass.x"][4000])) / 3.0


def measure(model: str) -> list[float]:
    """All measurements of a model."""
    level = force(model, np.array([0.0, 1e-2, 2e-2]), 1e3)[-1]  # at 10 µm/s
    fast = force(model, np.array([0.0, 1e-2, 2e-2]), 1e-2 / 3e-3)[-1]
    x = polyline([0.0, *(-1) ** np.arange(5) * LOOP], 1e-6, 0.05)
    F = force(model, x, 0.05)
    given = F[20] / level  # after 1 µm
    work = float(np.trapezoid(F[-961:], x[-961:]) / (4.0 * LOOP * np.abs(F).max()))
    detour = force(model, polyline([0.0, 15e-6, 0.0, 15e-6], 1e-6, 0.02), 0.02, SHARP.get(model))
    way = nan if model in RIGID else drift(model, {**MODELS[model], **SHARP.get(model, {})})
    missing = abs(1.0 - detour[-1] / detour[750])
    return [(level - fast) / level, given, work, lag(model, level), dwell(model), missing, way]


def present(values: list[float], per_cycle: float) -> list[bool]:
    """Return which phenomena count as present."""
    elastic = values[1] < 0.5
    large = [value > 0.01 for value in values]
    memory, stays = elastic and not large[5], values[6] < 0.01 * per_cycle
    return [large[0], elastic, elastic and large[2], large[3], large[4], memory, stays]


def main(folder: Path) -> str:
    """Measure all models, draw the table, check it."""
    found = {model: measure(model) for model in MODELS}
    per_cycle = found["LuGre"][6]
    table = {model: present(values, per_cycle) for model, values in found.items()}
    figure, (axis,) = panels("Which model shows which phenomenon", 1, 1, (9.4, 4.6))
    axis.grid(False)
    shade = np.array([[0.0 if there else 1.0 for there in row] for row in table.values()])
    axis.imshow(shade, cmap="Blues_r", vmin=-1.6, vmax=1.0, aspect="auto")
    for i, values in enumerate(found.values()):
        for j, value in enumerate(values):
            shown, unit, least = (1e6 * value, "µm", 1e-3) if j == 6 else (100.0 * value, "%", 1e-2)
            text = f"{shown:.3g} {unit}" if abs(shown) >= least else f"< {least:g} {unit}"
            text = "–" if np.isnan(value) or (j in (2, 5) and values[1] > 0.5) else text
            axis.text(j, i, text, ha="center", va="center", fontsize=8.5, color=BLACK)
    axis.set_xticks(range(len(PHENOMENA)), PHENOMENA)
    axis.set_yticks(range(len(MODELS)), list(MODELS))
    axis.xaxis.tick_top()
    axis.tick_params(length=0, colors=BLACK)
    axis.spines[:].set_visible(False)
    for i in range(1, len(MODELS)):
        axis.axhline(i - 0.5, color=GREY, lw=0.4)
    save(figure, __file__, folder)

    marks = {model: "".join(str(int(there)) for there in row) for model, row in table.items()}
    assert marks == EXPECTED, {m: (marks[m], EXPECTED[m], found[m]) for m in marks if marks[m] != EXPECTED[m]}
    loose = drift("Leuven", {"n": 2.0})
    assert loose > 0.01 * per_cycle
    counts = {model: sum(row) for model, row in table.items()}
    return (
        f"Phenomena shown: Stribeck's curve {counts['Stribeck']} of {len(PHENOMENA)}, Dahl {counts['Dahl']}, Bliman "
        f"and Sorine {counts['BlimanSorine']}, rate-and-state {counts['RateAndState']}, LuGre {counts['LuGre']}, "
        f"Leuven {counts['Leuven']}, GMS {counts['GMS']} and the asperities {counts['GenericAsperity']}. From 10 µm/s "
        f"to 3 mm/s friction falls by {100.0 * found['LuGre'][0]:.0f} % with LuGre and "
        f"{100.0 * abs(found['Dahl'][0]):.0f} % with Dahl. An inner loop costs LuGre {100.0 * found['LuGre'][5]:.0f} "
        f"%, ElastoPlastic {100.0 * found['ElastoPlastic'][5]:.1f} % and "
        f"Leuven {100.0 * found['Leuven'][5]:.1f} % of "
        f"the force. With n = 2 Leuven drifts by {1e6 * loose:.2f} µm per cycle."
    )


if __name__ == "__main__":
    command_line(main)
