"""Compiles the engine of the harness into the wheel."""

from __future__ import annotations

import sys
import sysconfig
import types
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ROOT = Path(__file__).parent


class EngineHook(BuildHookInterface):  # type: ignore[type-arg]
    """Adds ``harness/engine/engine.so``; an editable install compiles the engine when it is first used."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile before the files are collected."""
        if version == "editable":
            return
        # the package without its __init__, whose dependencies a build does not have
        package = types.ModuleType("harness")
        package.__path__ = [str(ROOT / "harness")]
        sys.modules["harness"] = package
        from harness.toolchain import compile_library

        name = "engine.dll" if sys.platform == "win32" else "engine.so"
        target = Path(self.directory).resolve() / name
        target.parent.mkdir(parents=True, exist_ok=True)
        compile_library(ROOT / "harness" / "engine", "engine.c", target, headers=False)
        build_data["force_include"][str(target)] = f"harness/engine/{name}"
        build_data["pure_python"] = False
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["tag"] = f"py3-none-{platform}"
