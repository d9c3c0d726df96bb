"""C for a controller, with unit test, example, and cost."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from friction_fmus.export.targets import Option, Target


def write(
    model: str | Path,
    folder: Path,
    *,
    start: dict[str, float | bool],
    prefix: str,
    real: Literal["float", "double"] = "double",
) -> tuple[Path, ...]:
    """Write the files and return their paths."""
    from friction_fmus.codegen.export import export_law

    return export_law(model, folder, real=real, start=start, prefix=prefix)


def _not_measured() -> str:
    from friction_fmus.codegen.emulation import PACKAGES, missing

    if not (lacking := missing()):
        return ""
    packages = " ".join(PACKAGES[tool] for tool in lacking)
    return f"Some costs were not measured without {' and '.join(lacking)}; run apt-get install {packages}"


TARGET = Target(
    "C99 for a controller",
    "law",
    write,
    options=(Option("real", "type of all numbers; default: double", ("float", "double")),),
    remark=_not_measured,
)
