"""Every C header compiles alone, or right after block.h if it is about the model of a block."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from harness.compiling.toolchain import header_folder

ROOT = Path(__file__).parents[2]
SOURCES = ROOT / "fmu_src"
FOLDERS = [
    path for path in (SOURCES, *SOURCES.iterdir(), ROOT / "harness/engine", ROOT / "harness/masters") if path.is_dir()
]
HEADERS = {path.name: path for folder in FOLDERS for path in sorted(folder.glob("*.h"))}
BLOCKS = sorted(path for folder in FOLDERS for path in folder.glob("*.c") if folder.name not in ("fmu_src", "wasm"))
SHELLS = {"compiled_part.h", "compiled_system.h", "composite.h", "composite_parts.h", "fmi3.h", "fmi3_values.h"}
"""The generated file of a composite, of an FMI 3.0 FMU or of a compiled system defines tables before them; every build
compiles them."""


def compiles(text: str, folder: Path) -> str:
    """The messages of the compiler about a C file; empty if it compiles."""
    source = folder / "alone.c"
    source.write_text(text)
    include = [f"-I{path}" for path in (*FOLDERS, header_folder())]
    command = ["gcc", "-std=c99", "-fsyntax-only", "-w", *include, str(source)]
    return subprocess.run(command, capture_output=True, text=True, check=False).stderr


def used_by(name: str, text: str) -> bool:
    """Whether a C file includes a header, itself or through others."""
    found = re.findall(r'^#include "(\w+\.h)"', text, re.M)
    return name in found or any(used_by(name, HEADERS[each].read_text()) for each in found if each in HEADERS)


@pytest.mark.parametrize("name", sorted(set(HEADERS) - SHELLS))
def test_a_header_compiles_alone(name: str, tmp_path: Path) -> None:
    messages = [compiles(f'#include "{name}"\n', tmp_path)]
    for block in (path for path in BLOCKS if messages[-1] and used_by(name, path.read_text())):
        head, _, _ = block.read_text().partition('#include "block.h"\n')
        messages.append(compiles(f'{head}#include "block.h"\n#include "{name}"\n', tmp_path))
    assert not messages[-1], messages
