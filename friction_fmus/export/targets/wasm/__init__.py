"""A WebAssembly module with a JavaScript class, as an npm package."""

from pathlib import Path

from friction_fmus.export.targets import SourceFmu, Target


def write(source: SourceFmu, path: Path) -> None:
    """Write the package, for its one platform."""
    from friction_fmus.export.targets.wasm.npm_package import wasm_model, write_package

    write_package(wasm_model(source), path)


TARGET = Target("an npm package", "fmu", write, "-wasm", platform="wasm32")
