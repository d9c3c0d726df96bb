"""FMUs of FMI 3.0 behind the functions of FMI 2.0, so that one suite of tests calls both versions (facade.c)."""

from __future__ import annotations

import subprocess
import tempfile
import zipfile
from pathlib import Path

from lxml import etree
from shell.selection import built

from harness.compiling.platforms import PLATFORMS
from harness.compiling.toolchain import FLAGS, compiler, header_folder

IN_3 = ":3"
"""Suffix of a name for FMI 3.0."""
FACADE = Path(__file__).with_suffix(".c")


def facade(two: Path, three: Path, platform: str = "linux64") -> Path:
    """Make an FMU with the description of FMI 2.0, whose library calls the functions of FMI 3.0.

    Parameters
    ----------
    two, three : Path
        The same block or composite in both versions. The new FMU is written beside the second one.
    platform : str
        The platform of the library.
    """
    path = three.with_name(f"{three.stem}-facade-{platform}.fmu")
    if path.exists():
        return path
    with tempfile.TemporaryDirectory() as scratch, zipfile.ZipFile(two) as old, zipfile.ZipFile(three) as new:
        folder = Path(scratch)
        library = library_of(new, folder, platform)
        with zipfile.ZipFile(folder / "new.fmu", "w") as made:
            for name in old.namelist():
                if not name.startswith(("binaries/", "sources/")):
                    made.writestr(name, old.read(name))
            suffix = PLATFORMS[platform].suffix
            made.write(library, f"binaries/{platform}/{three.stem}{suffix}")
        (folder / "new.fmu").replace(path)
    return path


def in_either(name: str, folder: str | Path) -> Path:
    """The FMU of a block or composite; with the suffix ``:3`` in FMI 3.0, behind the facade."""
    plain = name.removesuffix(IN_3)
    two = built(plain, folder)
    return two if name == plain else facade(two, built(plain, Path(folder) / "fmi3", fmi=3))


def library_of(archive: zipfile.ZipFile, folder: Path, platform: str) -> Path:
    """Compile the sources of an FMU of FMI 3.0 with the facade."""
    for name in archive.namelist():
        if name.startswith("sources/"):
            archive.extract(name, folder)
    build = etree.parse(folder / "sources" / "buildDescription.xml")
    main, *others = (str(file.get("name")) for file in build.iter("SourceFile"))
    (folder / "sources" / FACADE.name).write_text(FACADE.read_text(encoding="utf-8"), encoding="utf-8")
    plain = (flag for flag in FLAGS if flag not in ("-Werror", "-Wpedantic", "-O2"))
    flags = [*plain, "-O0", "-fno-sanitize=undefined", f'-DFMI_3="{main}"']  # compiled in a fifth of the time
    (target,) = PLATFORMS[platform].targets
    command = [*compiler(target), *flags, "-isystem", str(header_folder()), FACADE.name, *others]
    subprocess.run([*command, "-shared", "-s", "-lm", "-o", "facade.so"], cwd=folder / "sources", check=True)
    return folder / "sources" / "facade.so"
