"""Selections of blocks, and the composite FMUs that stand beside them in lists."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Literal

import pytest
from quick import builds_for_users, builds_of
from thorough import some

from friction_fmus import build, catalogue
from friction_fmus.blocks.customise import Start
from friction_fmus.cli.inputs import open_system

SHELL_BLOCKS = (
    "Karnopp",  # no state
    "LuGre",  # a state, stepped by the block, and a Boolean parameter
    "GMS",  # a memory, vectors and an Integer parameter
    "SevenParameter",  # a memory that is large and little used, and a warning
    "Mass",  # states that are outputs
    "PID",  # sampled and guarded, with Boolean inputs
    "ImpulsiveControl",  # a memory that goes on while samples are skipped, an Integer result
    "ModifiedLeuvenFeedforward",  # sampled vectors
    "Encoder",  # sampled and not guarded
    "Record",  # neither input nor parameter
)
"""The blocks on which the tests of the FMI shell run: together they compile all of it.

`test_selection.py` fails if a branch of the shell or a kind of variable is missing here.
"""

BRANCHES = {
    "a formula of the velocity": ("Stribeck", "Tustin", "Coulomb"),
    "a state": ("LuGre", "RateAndState", "LoadDependentDahl"),
    "a memory, decisions and events": ("Karnopp", "GMS", "ElastoPlastic"),
    "states that an event changes": ("KarnoppMass", "Leuven"),
    "co-simulation only": ("SevenParameter", "Bristle", "PrandtlTomlinson"),
    "a plant": ("Mass", "TwoMass", "Actuator"),
    "a law": ("PID", "KalmanFriction", "ImplicitSuperTwisting"),
    "a law with vectors": ("GMSObserver", "DiscreteInverse", "TustinFeedback"),
    "a sampled block in C": ("ImpulsiveControl", "IterativeLearning", "ModifiedLeuvenFeedforward"),
    "sampled and not guarded": ("Encoder", "Differentiator", "SampledSum"),
    "a signal": ("Record", "Multisine", "Quantiser"),
}
"""Three blocks of each class of branches in the code of a block; all blocks run each night."""
EACH_BRANCH = tuple(name for names in BRANCHES.values() for name in names)
ONE_OF_EACH = tuple(names[0] for names in BRANCHES.values())
"""One block of each class, for tests that are long or of what all blocks share."""
EACH_FEATURE = (
    "PID",  # limits, an integral that they stop, Booleans
    "LuGreFeedforward",  # a state that is stepped implicitly
    "GMSFeedforward",  # vectors of states and decisions between elements
    "KalmanFriction",  # matrices
    "ImplicitSuperTwisting",  # roots and an algebraic equation
    "DiscreteInverse",  # a long memory
    "ResetPID",  # an integral that is reset
)
"""Laws that together have all that the generator of C treats in its own way; all laws run each night."""

SAMPLED_BLOCKS = tuple(
    name for name, block in catalogue().items() if re.search(r"^#define\s+SAMPLED\b", block.code, re.M)
)
CONTINUOUS_BLOCKS = tuple(name for name in catalogue() if name not in SAMPLED_BLOCKS)


def of_each_branch(names: Sequence[str]) -> Sequence[str]:
    """Return all of these blocks each night, and those of `EACH_BRANCH` before a landing."""
    return some(names, [name for name in names if name in EACH_BRANCH])


one_of_each = pytest.mark.one_of_each
"""Marks tests that run on all blocks each night, and on those of `ONE_OF_EACH` before a landing (`conftest.py`)."""

COMPOSITES = ("stick_slip", "compensated_axis")
"""Systems of examples/ that are tested as one FMU each: a stiff loop, and a servo with sampled laws."""


def built(
    name: str, folder: str | Path, start: Start | None = None, fmi: Literal[2, 3] = 2, *, full: bool = False
) -> Path:
    """The FMU of a block, or of a system of examples/, in this folder; with arrays and clocks if it is `full`."""
    example = Path(__file__).parents[2] / "examples" / f"{name}.toml"
    if not example.exists():
        with builds_of(name):
            return build(name, folder, start, fmi=fmi, arrays=full, clocks=full)
    path = Path(folder) / f"{name}.fmu"
    path.parent.mkdir(parents=True, exist_ok=True)
    with builds_for_users() if name == COMPOSITES[0] else nullcontext(), open_system(example) as system:
        system.to_fmu(path, fmi=fmi)
    return path
