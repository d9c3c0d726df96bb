"""Selections of blocks, and the composite FMUs that stand beside them in lists."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from friction_fmus import build, catalogue
from friction_fmus.blocks.customise import Start
from friction_fmus.cli.systems import open_system

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

SAMPLED_BLOCKS = tuple(
    name for name, block in catalogue().items() if re.search(r"^#define\s+SAMPLED\b", block.code, re.M)
)
CONTINUOUS_BLOCKS = tuple(name for name in catalogue() if name not in SAMPLED_BLOCKS)

COMPOSITES = ("stick_slip", "compensated_axis")
"""Systems of examples/ that are tested as one FMU each: a stiff loop, and a servo with sampled laws."""


def built(
    name: str, folder: str | Path, start: Start | None = None, fmi: Literal[2, 3] = 2, *, full: bool = False
) -> Path:
    """The FMU of a block, or of a system of examples/, in this folder; with arrays and clocks if it is `full`."""
    example = Path(__file__).parents[2] / "examples" / f"{name}.toml"
    if not example.exists():
        return build(name, folder, start, fmi=fmi, arrays=full, clocks=full)
    path = Path(folder) / f"{name}.fmu"
    path.parent.mkdir(parents=True, exist_ok=True)
    with open_system(example) as system:
        system.to_fmu(path, fmi=fmi)
    return path
