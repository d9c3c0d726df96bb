"""Fixtures of the harness tests: a small FMU that fails on request, and files that only look like FMUs."""

from __future__ import annotations

import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import exchange_fmus
import fmpy
import pytest
from foreign_fmus import in_c, in_python

from harness.compiling.toolchain import compiler

SOURCES = Path(__file__).parent / "probe"
BINARY = f"binaries/{fmpy.platform}/probe{fmpy.sharedLibraryExtension}"


@pytest.fixture(scope="session")
def probe_library(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    library = tmp_path_factory.mktemp("probe") / Path(BINARY).name
    headers = Path(fmpy.__file__).parent / "c-code"
    flags = ["-std=gnu99", "-O1", "-ffp-contract=off", "-shared", "-fPIC", f"-I{headers}", "-o", str(library)]
    subprocess.run([*compiler(), *flags, str(SOURCES / "probe.c"), "-lm"], check=True, timeout=300)
    return library.read_bytes()


@pytest.fixture
def make_fmu(tmp_path: Path, probe_library: bytes) -> Callable[..., Path]:
    """Write a probe FMU: members can be replaced or removed, the XML changed by (old, new) pairs."""

    def make(
        *changes: tuple[str, str], name: str = "probe.fmu", members: dict[str, bytes | None] | None = None
    ) -> Path:
        xml = (SOURCES / "modelDescription.xml").read_text(encoding="utf-8")
        for old, new in changes:
            assert old in xml
            xml = xml.replace(old, new)
        content: dict[str, bytes | None] = {"modelDescription.xml": xml.encode(), BINARY: probe_library}
        content |= members or {}
        path = tmp_path / name
        with zipfile.ZipFile(path, "w") as archive:
            for member, data in content.items():
                if data is not None:
                    archive.writestr(member, data)
        return path

    return make


@pytest.fixture
def probe(make_fmu: Callable[..., Path]) -> Path:
    return make_fmu()


@pytest.fixture(scope="session")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """FMUs as other tools export them, see `in_c`."""
    return in_c(tmp_path_factory.mktemp("foreign"), compiler())


@pytest.fixture(scope="session")
def exchange(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """FMUs for model exchange as other tools export them, see `exchange_fmus.in_c`."""
    return exchange_fmus.in_c(tmp_path_factory.mktemp("exchange"), compiler())


@pytest.fixture(scope="session")
def pythonfmu(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """FMUs that pythonfmu exports, see `in_python`."""
    return in_python(tmp_path_factory.mktemp("pythonfmu"))
