"""Compiles the engine of the harness and all FMUs into the wheel, for all platforms; writes the Modelica library.

For a wheel that is built sooner, ``FRICTION_FMUS_PLATFORMS=linux64,win64`` limits the platforms of the FMUs and
``FRICTION_FMUS_WHEEL_BLOCKS=LuGre,PID`` the blocks.
"""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from hatchling.build import (
    build_editable,
    build_sdist,
    build_wheel,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
)
from hatchling.builders.constants import EDITABLES_REQUIREMENT
from hatchling.builders.hooks.plugin.interface import BuildHookInterface

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
]

ROOT = Path(__file__).parent
sys.path.insert(0, str(ROOT))  # the packages that are to be packed


def get_requires_for_build_editable(config_settings: dict[str, Any] | None = None) -> list[str]:
    """Nothing but what links to the checkout: pip would install the runtime dependencies of the wheel's hook twice."""
    return [EDITABLES_REQUIREMENT]


def build_fmus(names: list[str], folder: Path) -> None:
    """FMUs in a process of its own."""
    platforms = os.environ.get("FRICTION_FMUS_PLATFORMS", "all").split(",")
    command = [sys.executable, "-m", "friction_fmus", "build", *names, "--platform", *platforms, "-o", str(folder)]
    subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL, check=True)


class BinariesHook(BuildHookInterface):  # type: ignore[type-arg]
    """Adds ``friction_fmus/fmus``, ``friction_fmus/modelica`` and ``harness/engine/binaries``.

    An editable install compiles on first use instead, and so depends on what that needs; it gets what a study needs.
    """

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile before the files are collected."""
        if version == "editable":
            build_data["dependencies"] += self.metadata.core.optional_dependencies["study"]
            return
        from friction_fmus.blocks.catalogue import OWN_BLOCKS, catalogue
        from friction_fmus.export.targets.modelica import write
        from harness.compiling.engine_library import sources
        from harness.compiling.platforms import PLATFORMS, compiled

        folder = Path(self.directory).resolve()
        added = build_data["force_include"]
        for platform in PLATFORMS.values():
            name = f"{platform.folder}/engine{platform.suffix}"
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(compiled(platform, sources(), "engine", headers=False))
            added[str(folder / name)] = f"harness/engine/binaries/{name}"
        os.environ.pop(OWN_BLOCKS, None)  # blocks of whoever builds the wheel do not belong into it
        names = os.environ.get("FRICTION_FMUS_WHEEL_BLOCKS", ",".join(catalogue())).split(",")
        processes, fmus = os.cpu_count() or 1, folder / "fmus"
        with ThreadPoolExecutor(processes) as pool:
            list(pool.map(build_fmus, [names[k::processes] for k in range(processes)], [fmus] * processes))
        added |= {str(fmus / f"{name}.fmu"): f"friction_fmus/fmus/{name}.fmu" for name in names}
        added[str(write(folder))] = "friction_fmus/modelica"
