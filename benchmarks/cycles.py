"""Write the cost of all laws on a Cortex-M4F, by which a study ranks them: ``friction_fmus/study/cycles.toml``.

    python benchmarks/cycles.py

It needs the cross compiler and qemu-arm that tests/debian-packages.sh installs.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).parents[1])  # in this folder harness.py would hide the package

from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.codegen import measure
from friction_fmus.codegen.emulation import EMULATOR, M4F, PACKAGES
from friction_fmus.codegen.law_export import make_export
from friction_fmus.study.comparison import COST_TABLE
from harness.storage.files import atomic_path

HEADING = "# Cost of the laws in single precision on a Cortex-M4F; written by benchmarks/cycles.py.\n\n"


def row(law: str) -> str:
    """Return the line of a law: mean cycles of a sample, rounded to two digits as they are estimates, and flash."""
    cost = measure(make_export(law, real="float"), M4F)
    if cost.cycles is None:
        raise SystemExit(f"{EMULATOR} is missing; install it with apt-get install {PACKAGES[EMULATOR]}")
    return f"{law} = {{ cycles = {int(float(f'{cost.cycles.mean:.2g}'))}, flash = {cost.flash} }}\n"


def main() -> None:
    """Write the table."""
    rows = "".join(row(name) for name, block in catalogue().items() if block.is_law)
    with atomic_path(COST_TABLE) as temporary:
        temporary.write_text(HEADING + rows, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
