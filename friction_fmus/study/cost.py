"""Cost of the laws on a Cortex-M4F, from a table that ``benchmarks/cycles.py`` writes.

The table makes the ranking independent of the machine of the study and of the tools that are installed on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

from friction_fmus.study.compensators import INTEGRAL
from harness.storage.toml_file import read_toml

TABLE: Final = Path(__file__).with_name("cycles.toml")


@dataclass(frozen=True)
class Cost:
    """Cost of one law with its default parameters."""

    cycles: float
    """Estimated cycles of one sample."""
    flash: float
    """Size of the code with the library functions that it calls [bytes]."""


def cost_of(law: str) -> Cost | None:
    """Return the cost of a law; None if the table does not contain it, as for controllers written in C."""
    return Cost(0.0, 0.0) if law == INTEGRAL.name else _table().get(law)


@cache
def _table() -> dict[str, Cost]:
    return {name: Cost(float(row["cycles"]), float(row["flash"])) for name, row in read_toml(TABLE).items()}
