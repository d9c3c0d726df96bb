"""Dynamic models need more parameters and operations; asperities need far more

Stribeck's curve needs few parameters and operations, LuGre more, GMS several times as many. A population of asperities
must be large, because its friction in steady sliding fluctuates like 1/sqrt(N). The operations are those of one sample
of the feedforward laws.

Only parameters that describe the contact are counted: no options such as exponents, the normal force or separate
values for v < 0. GMS is counted in its reduced form: stiffness and share of each of its ten elements, and Fc, Fs, vs,
C and sigma2. Operations are those that casadi counts, with the reference and the limits; an exponential counts as one.
The time of a run with 1000 asperities is asserted but not shown, because it depends on the machine. Most of the time
of the LuGre run is not spent in LuGre itself.

Source: counted and measured here.
"""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
from fmpy import read_model_description

from _common import BLACK, BLUE, along, command_line, panels, save
from friction_fmus import build
from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import discover_laws

BLOCKS = ("Coulomb", "Stribeck", "Dahl", "LuGre", "ElastoPlastic", "Leuven", "GMS")
LAWS = ("CoulombFeedforward", "StaticFeedforward", "DahlFeedforward", "LuGreFeedforward", "GMSFeedforward")
OPTIONS = {"Fn0", "N", "Ci", "offset", "shape", "delta", "n", "v_d", "dead_band", "asymmetric"}  # of the blocks
ELEMENTS = 10
STEPS = 4000
COUNTS = (10, 100, 1000)  # asperities


def parameters(block: str) -> list[str]:
    """Names of the parameters that describe the contact."""
    with TemporaryDirectory() as folder:
        variables = read_model_description(build(block, Path(folder))).modelVariables
    names = [variable.name for variable in variables if variable.causality == "parameter"]
    left_out = OPTIONS | ({"sigma"} if block == "GMS" else set())  # its optional damping
    return [name for name in names if name.partition("[")[0] not in left_out and not name.endswith("_neg")]


def operations() -> dict[str, int]:
    """Of a sample of each law."""
    return {law.name: law.function.n_instructions() for law in discover_laws(laws_folder()) if law.name in LAWS}


def seconds(block: str, values: Mapping[str, float], runs: int) -> float:
    """Time of a run [s], the shortest of some."""
    path = 5e-5 * np.sin(2.0 * np.pi * np.arange(STEPS + 1) / 2000.0)
    times = []
    for _ in range(runs):
        start = perf_counter()
        along(block, path, 1e-3, values)
        times.append(perf_counter() - start)
    return min(times)


def ripple(count: int) -> float:
    """Standard deviation over mean of the friction of asperities in steady sliding."""
    path = 4e-7 * np.arange(3001)  # 1.2 mm, at 2 mm/s
    F = along("GenericAsperity", path, 2e-4, {"N": float(count), "Fn0": float(count)})["friction.F"].to_numpy()[1000:]
    return float(F.std() / F.mean())


def main(folder: Path) -> str:
    """Draw and check the counts."""
    of_block = {block: parameters(block) for block in BLOCKS}
    of_law = operations()
    figure, (left, right, population) = panels("Parameters and operations of models", 1, 3, (11.0, 3.8))
    left.barh(list(of_block), [len(names) for names in of_block.values()], color=BLUE)
    left.set(xlabel="parameters of the block")
    right.barh(list(LAWS), [of_law[law] for law in LAWS], color=BLACK)
    right.set(xlabel="operations of a sample of the law")
    varies = [100.0 * ripple(count) for count in COUNTS]
    population.loglog(COUNTS, varies, "o-", color=BLUE, lw=1.4, label="GenericAsperity")
    law = [varies[0] * (COUNTS[0] / count) ** 0.5 for count in COUNTS]
    population.loglog(COUNTS, law, color=BLACK, ls=":", lw=1.4, label="1/sqrt(N)")
    population.set(xlabel="asperities N", ylabel="ripple of friction [%]")
    population.set_yticks([2.0, 5.0, 10.0, 20.0], ["2", "5", "10", "20"])
    population.set_yticks([], minor=True)
    population.legend(fontsize=9)
    for axis in (left, right):
        axis.invert_yaxis()
        axis.grid(False, axis="y")
    save(figure, __file__, folder)

    per_element = [name for name in of_block["GMS"] if "[" in name]
    shared = set(of_block["GMS"]) - set(per_element)
    assert len(per_element) == 2 * ELEMENTS and shared == {"Fc", "Fs", "vs", "C", "sigma2"}
    assert len(of_block["Coulomb"]) < len(of_block["Stribeck"]) < len(of_block["LuGre"]) < len(of_block["GMS"])
    cheap, static, dahl, lugre, gms = (of_law[law] for law in LAWS)
    assert cheap < static < dahl < lugre < gms
    assert 3.0 < gms / lugre < 6.0
    assert 5.0 < varies[0] / varies[-1] < 20.0  # sqrt(100), as far as one draw of places tells
    slow, quick = seconds("GenericAsperity", {"N": 1000.0}, 1), seconds("LuGre", {}, 2)
    assert slow > 10.0 * quick
    return (
        f"Parameters: Stribeck's curve {len(of_block['Stribeck'])}, LuGre {len(of_block['LuGre'])}, GMS {len(shared)} "
        f"and {len(per_element) // ELEMENTS} per element. GMS with {ELEMENTS} elements takes about {gms / lugre:.0f} "
        f"times the operations of LuGre, and LuGre {lugre / static:.0f} times the operations of static friction. A run "
        f"with 1000 asperities takes more than 10 times as long as with LuGre. Friction fluctuates by {varies[0]:.0f} "
        f"% with {COUNTS[0]} asperities and by {varies[-1]:.0f} % with {COUNTS[-1]}."
    )


if __name__ == "__main__":
    command_line(main)
