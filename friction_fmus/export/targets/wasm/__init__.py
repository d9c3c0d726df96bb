"""A WebAssembly module with a JavaScript class, as an npm package."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from friction_fmus.export.targets import Target

if TYPE_CHECKING:
    from friction_fmus.export.source_fmu import Compiling, SourceFmu
    from harness.compiling.platforms import Platform


def write(source: SourceFmu, path: Path, platforms: Sequence[Platform], compiling: Compiling | None = None) -> None:
    """Write the package, for its one platform."""
    from friction_fmus.export.targets.wasm.npm_package import wasm_model, write_package

    if compiling:
        compiling(platforms[0].folder, 0)
    write_package(wasm_model(source), path)


TARGET = Target("an npm package", "fmu", write, "-wasm", platform="wasm32")
