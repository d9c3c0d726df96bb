"""Dynamic models cost more parameters and more operations, asperities cost far more

The study: dynamic models "require a more complex model with more parameters" and raise the computational cost; GMS is
comparable with the others in cost; it has six parameters per element, which other techniques reduce to two per element
and five in all; physics-based models are "much too complicated for online control".

Asperities have to be many: on the right is the ripple of the friction of N of them in steady sliding, which falls as
that of independent ones, by 1/sqrt(N). On the left are the parameters of the friction blocks that describe the contact,
without options (exponents, the normal force, other values for v < 0). GMS here is the reduced form: the stiffness and
the share of each of its ten elements, and Fc, Fs, vs, C and sigma2. In the middle are the operations of a sample of the
feedforward laws, as casadi counts them, with the reference and the limits: an exponential counts as one. A population
of 1000 asperities takes more than ten times the time of LuGre in the same run, most of which is not spent in LuGre at
all; which is asserted, and not shown, as it depends on the machine.

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
from friction_fmus.lawkit.files import discover_laws

BLOCKS = ("Coulomb", "Stribeck", "Dahl", "LuGre", "ElastoPlastic", "Leuven", "GMS")
LAWS = ("CoulombFeedforward", "StaticFeedforward", "DahlFeedforward", "LuGreFeedforward", "GMSFeedforward")
OPTIONS = {"Fn0", "N", "offset", "shape", "delta", "n", "v_d", "dead_band", "asymmetric"}  # of the blocks
ELEMENTS = 10
STEPS = 4000
COUNTS = (10, 100, 1000)  # asperities


def parameters(block: str) -> list[str]:
    """Names of the parameters that describe the contact."""
    with TemporaryDirectory() as folder:
        variables = read_model_description(build(block, Path(folder))).modelVariables
    names = [variable.name for variable in variables if variable.causality == "parameter"]
    left_out = OPTIONS | ({"sigma"} if block == "GMS" else set())  # its optional damping
    return [name for name in names if name not in left_out and not name.endswith("_neg")]


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
    figure, (left, right, population) = panels("What dynamic models cost", 1, 3, (11.0, 3.8))
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
    assert len(per_element) == 3 * ELEMENTS and shared == {"Fc", "Fs", "vs", "C", "sigma2"}
    assert len(of_block["Coulomb"]) < len(of_block["Stribeck"]) < len(of_block["LuGre"]) < len(of_block["GMS"])
    cheap, static, dahl, lugre, gms = (of_law[law] for law in LAWS)
    assert cheap < static < dahl < lugre < gms
    assert 3.0 < gms / lugre < 6.0
    assert 5.0 < varies[0] / varies[-1] < 20.0  # sqrt(100), as far as one draw of places tells
    slow, quick = seconds("GenericAsperity", {"N": 1000.0}, 1), seconds("LuGre", {}, 2)
    assert slow > 10.0 * quick
    return (
        f"Stribeck's curve has {len(of_block['Stribeck'])} parameters, LuGre {len(of_block['LuGre'])}, GMS "
        f"{len(per_element) // ELEMENTS} per element and {len(shared)}; GMS of {ELEMENTS} elements takes about "
        f"{gms / lugre:.0f} times the operations of LuGre, and LuGre {lugre / static:.0f} times those of static "
        "friction; a run with 1000 asperities takes more than 10 times as long as with LuGre. The friction of "
        f"{COUNTS[0]} asperities varies by {varies[0]:.0f} %, that of {COUNTS[-1]} by {varies[-1]:.0f} %."
    )


if __name__ == "__main__":
    command_line(main)
