"""C for a controller, with unit test, example, and cost."""

from pathlib import Path
from typing import Any

from friction_fmus.export.targets import Option, Target


def write(model: str | Path, folder: Path, **options: Any) -> tuple[Path, ...]:
    """Write the files and return their paths."""
    from friction_fmus.codegen.law_export import export_law

    return export_law(model, folder, **options)


def _remark() -> str:
    from friction_fmus.codegen.emulation import PACKAGES, missing

    if not (lacking := missing()):
        return ""
    packages = " ".join(PACKAGES[tool] for tool in lacking)
    return f"Some costs were not measured without {' and '.join(lacking)}; run apt-get install {packages}"


REAL = Option("real", "type of all numbers; default: double", ("float", "double"))
TARGET = Target("C99 for a controller", "law", write, options=(REAL,), remark=_remark)
