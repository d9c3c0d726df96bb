"""Rules of the archive (FMI 2.0.5, section 2.3), before anything is unpacked."""

from __future__ import annotations

import stat
import zipfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from friction_fmus.check.findings import DESCRIPTION, Fault, Finding, apply, declare, rule
from harness.archive import LARGEST, RATIO, find_outside

_DEFLATE = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_METHODS = {9: "deflate64", 12: "bzip2", 14: "LZMA", 93: "Zstandard", 95: "XZ", 98: "PPMd"}
_SUFFIXES = {"win": ".dll", "linux": ".so", "darwin": ".dylib", "windows": ".dll"}
_PLATFORMS = ("win32", "win64", "linux32", "linux64", "darwin32", "darwin64")
_ARCHITECTURES = ("aarch32", "aarch64", "riscv32", "riscv64", "x86", "x86_64", "ppc32", "ppc64")
_SYSTEMS = ("darwin", "linux", "windows")
_TOP = ("binaries", "documentation", "extra", "resources", "sources", "terminalsAndIcons")
_HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")

NOT_A_ZIP = declare("not-a-zip", "error", "2.3", "The file is no zip archive.", "archive")
DAMAGED = declare("zip-damaged", "error", "2.3", "A member of the archive cannot be read.", "archive")


@dataclass(frozen=True)
class Contents:
    """The members of an FMU.

    Parameters
    ----------
    path : Path
        The FMU.
    members : tuple of ZipInfo
        As they stand in the archive.
    identifier : str
        Model identifier for co-simulation; empty if it is not known.
    source_files : tuple of str or None
        What the XML declares as sources; None if it is not known.
    """

    path: Path
    members: tuple[zipfile.ZipInfo, ...]
    identifier: str = ""
    source_files: tuple[str, ...] | None = None
    names: frozenset[str] = field(init=False)

    def __post_init__(self) -> None:
        """Collect the names."""
        object.__setattr__(self, "names", frozenset(member.filename for member in self.members))

    def below(self, folder: str) -> list[PurePosixPath]:
        """The files in a folder of the archive."""
        return [PurePosixPath(n) for n in sorted(self.names) if n.startswith(f"{folder}/") and not n.endswith("/")]


def list_members(path: Path) -> Contents | Finding:
    """The members of an archive, or why they cannot be listed.

    Raises
    ------
    OSError
        If there is no such file or it may not be read.
    """
    with path.open("rb") as file:
        file.read(1)
    try:
        with zipfile.ZipFile(path) as archive:
            return Contents(path, tuple(archive.infolist()))
    except (zipfile.BadZipFile, NotImplementedError, ValueError, EOFError) as error:
        return NOT_A_ZIP.finding(f"{path.name} is not a zip archive ({error}); export it again")


def read_member(path: Path, name: str) -> bytes | Finding:
    """The content of a member, or why it cannot be read."""
    try:
        with zipfile.ZipFile(path) as archive:
            return archive.read(name)
    except Exception as error:  # zipfile and the codecs raise many kinds for broken members
        reason = " ".join(str(error).split()) or type(error).__name__
        return DAMAGED.finding(f"{name} cannot be unpacked ({reason}); export the FMU again", name)


def examine_archive(contents: Contents) -> list[Finding]:
    """What the rules of the archive find."""
    findings = list(apply("archive", contents))
    if not any(finding.rule in ("zip-bomb", "zip-encrypted", "zip-method") for finding in findings):
        findings += _damaged(contents)
    return findings


def _damaged(contents: Contents) -> Iterator[Finding]:
    try:
        with zipfile.ZipFile(contents.path) as archive:
            broken = archive.testzip()
    except Exception as error:  # as above
        broken = None
        yield DAMAGED.finding(f"the archive cannot be unpacked ({' '.join(str(error).split())}); export it again")
    if broken:
        yield DAMAGED.finding(f"the checksum of {broken} is wrong; copy or export the FMU again", broken)


# ---- paths


@rule("path-outside", "error", "2.3", "A member lies outside of the folder that the FMU is unpacked to.", "archive")
def _outside(contents: Contents) -> Iterator[Fault]:
    for member in contents.members:
        if "\\" not in member.orig_filename and find_outside([member.orig_filename]) is not None:
            yield Fault(
                f"the member {member.orig_filename!r} points outside of the archive; do not use this file",
                file=member.filename,
            )


@rule("path-backslash", "error", "2.3", "A path has backslashes in place of slashes.", "archive")
def _backslash(contents: Contents) -> Iterator[Fault]:
    for member in contents.members:
        if "\\" in member.orig_filename:
            yield Fault(f"the path {member.orig_filename!r} has backslashes; zip it with '/'", file=member.filename)


@rule("path-dot", "warning", "2.3", "A path starts with './' or has an empty or '.' part.", "archive")
def _dot(contents: Contents) -> Iterator[Fault]:
    for member in contents.members:
        parts = member.filename.removesuffix("/").removeprefix("/").split("/")
        if "" in parts or "." in parts:
            yield Fault(f"the path {member.filename!r} is not in its shortest form; zip it anew", file=member.filename)


@rule("path-duplicate", "error", "2.3", "Two members have one path, or paths that differ only by case.", "archive")
def _duplicate(contents: Contents) -> Iterator[Fault]:
    counted = Counter(member.filename.lower() for member in contents.members)
    for name, count in counted.items():
        if count > 1:
            yield Fault(f"{count} members are called {name!r} (case apart); keep one", file=name)


@rule("path-symlink", "error", "2.3", "A member is a symbolic link or another special file.", "archive")
def _symlink(contents: Contents) -> Iterator[Fault]:
    for member in contents.members:
        mode = member.external_attr >> 16
        if member.create_system == 3 and stat.S_IFMT(mode) not in (0, stat.S_IFREG, stat.S_IFDIR):
            yield Fault(
                f"{member.filename!r} is no ordinary file but a {stat.filemode(mode)[0]!r}; put the file itself there",
                file=member.filename,
            )


# ---- compression


@rule("zip-encrypted", "error", "2.3", "A member is encrypted.", "archive")
def _encrypted(contents: Contents) -> Iterator[Fault]:
    for member in contents.members:
        if member.flag_bits & 1:
            yield Fault(f"{member.filename!r} is encrypted; zip it without a password", file=member.filename)


@rule("zip-method", "error", "2.3", "A member is compressed by another method than deflate.", "archive")
def _method(contents: Contents) -> Iterator[Fault]:
    for member in contents.members:
        if member.compress_type not in _DEFLATE:
            name = _METHODS.get(member.compress_type, f"method {member.compress_type}")
            yield Fault(f"{member.filename!r} is compressed by {name}; use deflate or store", file=member.filename)


@rule("zip-version", "warning", "2.3", "Unpacking a member needs more than version 2.0 of the zip format.", "archive")
def _version(contents: Contents) -> Iterator[Fault]:
    for member in contents.members:
        if member.extract_version > 20 and member.compress_type in _DEFLATE:
            needed = member.extract_version / 10
            yield Fault(f"{member.filename!r} needs zip version {needed}; use at most 2.0", file=member.filename)


@rule("zip-bomb", "error", "2.3", "The archive unpacks to much more than its size lets expect.", "archive")
def _bomb(contents: Contents) -> Iterator[Fault]:
    unpacked = sum(member.file_size for member in contents.members)
    packed = sum(member.compress_size for member in contents.members)
    if unpacked > LARGEST and unpacked > RATIO * max(packed, 1):
        yield Fault(f"{packed} bytes unpack to {unpacked}; do not use this file", file="")


# ---- what there must be, and where


@rule("no-model-description", "error", "2.3", "There is no modelDescription.xml at the top of the archive.", "archive")
def _no_description(contents: Contents) -> Iterator[Fault]:
    if DESCRIPTION not in contents.names:
        found = [name for name in sorted(contents.names) if PurePosixPath(name).name == DESCRIPTION]
        beside = f", only {found[0]!r}; zip the contents of that folder" if found else "; export it again as FMI 2.0"
        yield Fault(f"there is no {DESCRIPTION} at the top{beside}", file="")


@rule("no-code", "error", "2.3", "There are neither binaries nor sources.", "archive")
def _no_code(contents: Contents) -> Iterator[Fault]:
    if not contents.below("binaries") and not contents.below("sources"):
        yield Fault("the archive has neither binaries nor sources; export it with one of them", file="")


@rule("platform-unknown", "warning", "2.3", "A folder of binaries is named after no platform.", "archive")
def _platform(contents: Contents) -> Iterator[Fault]:
    for folder in sorted({path.parts[1] for path in contents.below("binaries") if len(path.parts) > 2}):
        architecture, _, system = folder.partition("-")
        if folder not in _PLATFORMS and not (architecture in _ARCHITECTURES and system in _SYSTEMS):
            known = ", ".join(_PLATFORMS)
            yield Fault(f"binaries/{folder} is no platform; rename it to one of {known}", file=f"binaries/{folder}")


@rule("binary-misnamed", "error", "2.3", "A platform has no library that is named after the model.", "archive")
def _misnamed(contents: Contents) -> Iterator[Fault]:
    for folder in sorted({path.parts[1] for path in contents.below("binaries") if len(path.parts) > 2}):
        system = folder.partition("-")[2] or folder.rstrip("0123456789")
        needed = f"binaries/{folder}/{contents.identifier}{_SUFFIXES.get(system, '')}"
        if contents.identifier and system in _SUFFIXES and needed not in contents.names:
            yield Fault(f"there is no {needed}; name the library after modelIdentifier", file=f"binaries/{folder}")


@rule("source-missing", "error", "2.2.1", "A file of SourceFiles is not in the folder sources.", "archive")
def _source_missing(contents: Contents) -> Iterator[Fault]:
    missing = [
        name for name in contents.source_files or () if str(PurePosixPath("sources", name)) not in contents.names
    ]
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        yield Fault(f"SourceFiles lists {missing[0]!r}{more}, not found in sources; add what is missing")


@rule("source-undeclared", "warning", "2.2.1", "There are C sources, but nothing says which to compile.", "archive")
def _source_undeclared(contents: Contents) -> Iterator[Fault]:
    sources = [path for path in contents.below("sources") if path.suffix in (".c", ".cpp", ".cc")]
    if sources and contents.source_files == () and "sources/buildDescription.xml" not in contents.names:
        yield Fault(f"no SourceFiles names {sources[0]} and the others; list the files to compile")


@rule("source-headers", "note", "2.3", "The headers of FMI are among the sources.", "archive")
def _headers(contents: Contents) -> Iterator[Fault]:
    for path in contents.below("sources"):
        if path.name in _HEADERS:
            yield Fault(f"{path} is shipped; leave it out, importers bring their own", file=str(path))


@rule("file-unknown", "note", "2.3", "A file or folder at the top is not one of the standard's.", "archive")
def _unknown(contents: Contents) -> Iterator[Fault]:
    for top in sorted({PurePosixPath(name).parts[0] for name in contents.names if PurePosixPath(name).parts}):
        if top not in (*_TOP, DESCRIPTION, "model.png") and top not in ("/", "..", "."):
            yield Fault(f"{top!r} is nothing that the standard knows; move it to resources or extra", file=top)


@rule("documentation-entry", "note", "2.3", "There is no documentation/index.html.", "archive")
def _documentation(contents: Contents) -> Iterator[Fault]:
    if "documentation/index.html" not in contents.names:
        yield Fault("there is no documentation/index.html; add it, tools open it on request", file="documentation")


@rule("licence-misplaced", "note", "2.3", "A licence lies elsewhere than in documentation/licenses.", "archive")
def _licence(contents: Contents) -> Iterator[Fault]:
    for name in sorted(contents.names):
        path = PurePosixPath(name)
        licence = path.stem.lower() in ("license", "licence") and path.suffix.lower() in ("", ".txt", ".html", ".md")
        if licence and path.parts[0] in ("documentation", "licenses", name) and "licenses" not in path.parts[1:-1]:
            yield Fault(f"move {name!r} to documentation/licenses/license.txt", file=name)


def unpack(contents: Contents, folder: Path) -> None:
    """Unpack an archive in which no rule found a dangerous member.

    Raises
    ------
    OSError
        If the disk does not take it.
    """
    with zipfile.ZipFile(contents.path) as archive:
        archive.extractall(folder)
