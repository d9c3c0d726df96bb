"""FMUs of FMI 3.0 behind the functions of FMI 2.0, so that one suite of tests calls both versions (facade.c)."""

from __future__ import annotations

import hashlib
import subprocess
import tempfile
import zipfile
from io import BytesIO
from pathlib import Path

from lxml import etree
from shell.selection import built

from friction_fmus.export.targets import SourceFmu
from friction_fmus.export.targets.fmi3.fmi3_archive import fmi_3
from harness.compiling.platforms import PLATFORMS
from harness.compiling.toolchain import FLAGS, cache_folder, compiler, header_folder, identity
from harness.storage.files import atomic_path, cached

IN_3 = ":3"
"""Suffix of a name for FMI 3.0."""
FACADE = Path(__file__).with_suffix(".c")


def facade(two: Path, folder: Path, platform: str = "linux64", *, full: bool = False) -> Path:
    """Make an FMU with the description of FMI 2.0, whose library calls the functions of FMI 3.0.

    Parameters
    ----------
    two : Path
        The block or composite in FMI 2.0.
    folder : Path
        Where the new FMU is written.
    platform : str
        The platform of the library.
    full : bool
        Whether the FMI 3.0 FMU has arrays and clocks.
    """
    path = folder / f"{two.stem}-facade-{platform}.fmu"
    if path.exists():
        return path
    folder.mkdir(parents=True, exist_ok=True)
    three = BytesIO(fmi_3(SourceFmu(two.stem, two.read_bytes()), arrays=full, clocks=full))  # without a binary
    with zipfile.ZipFile(two) as old, zipfile.ZipFile(three) as new, atomic_path(path) as made:
        library = library_of(new, platform)
        with zipfile.ZipFile(made, "w") as archive:
            for name in old.namelist():
                if not name.startswith(("binaries/", "sources/")):
                    archive.writestr(name, old.read(name))
            archive.writestr(f"binaries/{platform}/{two.stem}{PLATFORMS[platform].suffix}", library)
    return path


def in_either(name: str, folder: str | Path) -> Path:
    """The FMU of a block or composite; with the suffix ``:3`` in FMI 3.0, behind the facade."""
    plain = name.removesuffix(IN_3)
    two = built(plain, folder)
    return two if name == plain else facade(two, Path(folder) / "fmi3")


def library_of(archive: zipfile.ZipFile, platform: str) -> bytes:
    """The sources of an FMI 3.0 FMU, compiled with the facade; from the cache if they were compiled before."""
    sources = {name: archive.read(name) for name in archive.namelist() if name.startswith("sources/")}
    sources[f"sources/{FACADE.name}"] = FACADE.read_bytes()
    build = etree.fromstring(sources["sources/buildDescription.xml"])
    main, *others = (str(file.get("name")) for file in build.iter("SourceFile"))
    plain = (flag for flag in FLAGS if flag not in ("-Werror", "-Wpedantic", "-O2"))
    flags = [*plain, "-O0", "-fno-sanitize=undefined", f'-DFMI_3="{main}"', "-isystem", str(header_folder())]
    (target,) = PLATFORMS[platform].targets
    command = [*compiler(target), *flags, FACADE.name, *others, "-shared", "-s", "-lm", "-o", "facade.so"]

    def make() -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            for name, text in sources.items():
                path = Path(folder) / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(text)
            subprocess.run(command, cwd=Path(folder) / "sources", check=True)
            return (Path(folder) / "sources" / "facade.so").read_bytes()

    digest = hashlib.sha256(repr((identity(target), command, sorted(sources.items()))).encode()).hexdigest()
    return cached(cache_folder() / "libraries" / f"facade-{digest[:24]}.so", make)
