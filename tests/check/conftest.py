"""What the tests of the check share: the FMU with one fault, compiled once."""

from __future__ import annotations

import subprocess

import pytest
from check.libraries import HERE, Library

from harness.compiling import toolchain


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """The compiled FMU, with a definition."""
    made: dict[tuple[str, str], bytes] = {}

    def compile_it(definition: str = "IN_ORDER", source: str = "faulty.c") -> bytes:
        if (definition, source) not in made:
            path = tmp_path_factory.mktemp("faulty") / "faulty.so"
            flags = ["-std=gnu99", "-O0", "-fno-sanitize=undefined", "-shared", "-fPIC", "-Wl,-z,lazy"]
            flags += [f"-D{definition}", f"-I{toolchain.header_folder()}", str(HERE / source), "-o", str(path), "-lm"]
            subprocess.run([*toolchain.compiler(), *flags], check=True, timeout=300)
            made[definition, source] = path.read_bytes()
        return made[definition, source]

    return compile_it
