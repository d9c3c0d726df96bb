"""Rules of the archive (FMI 2.0.5, section 2.3), checked before anything is unpacked."""

import stat
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath

from friction_fmus.check.findings import DESCRIPTION, Fault, Finding, Severity, apply, declare, rule
from harness.compiling.platforms import LONGEST_TABLE, missing_of
from harness.storage.files import reason
from harness.storage.zip_file import (
    LONGEST,
    ZipError,
    find_clashes,
    find_outside,
    is_bomb,
    is_special,
    is_too_long,
    method,
    normal_name,
    open_unchecked,
    read_zip,
    size_of,
    unpacked_size,
)

_DEFLATE = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_SUFFIXES = {"win": ".dll", "linux": ".so", "darwin": ".dylib", "windows": ".dll"}
_PLATFORMS = ("win32", "win64", "linux32", "linux64", "darwin32", "darwin64")
_TUPLES = {
    f"{system}{bits}": f"{architecture}-{name}"
    for system, name in (("win", "windows"), ("linux", "linux"), ("darwin", "darwin"))
    for bits, architecture in ((32, "x86"), (64, "x86_64"))
}
_OTHER = {2: {new: old for old, new in _TUPLES.items()}, 3: _TUPLES}
"""Platforms of the other version of FMI, and their names in this version."""
_FORMATS: dict[str, tuple[bytes, int, dict[str, int]]] = {
    "linux": (b"\x7fELF", 18, {"x86": 3, "x86_64": 62, "aarch32": 40, "aarch64": 183}),
    "windows": (b"MZ", 0, {"x86": 0x14C, "x86_64": 0x8664, "aarch64": 0xAA64}),
}
"""First bytes of libraries of a system, and place and number of the machine in ELF and PE files (that of PE varies)."""
_ARCHITECTURES = ("aarch32", "aarch64", "riscv32", "riscv64", "x86", "x86_64", "ppc32", "ppc64")
_SYSTEMS = ("darwin", "linux", "windows")
_TOP = ("binaries", "documentation", "extra", "resources", "sources", "terminalsAndIcons")
_HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")

NOT_A_ZIP = declare("not-a-zip", "error", "2.3", "The file is not a readable zip archive.", "archive")
FORMAT = declare("binary-format", "error", "2.3", "A library is in another format than its platform has.", "archive")
TRUNCATED = declare("binary-truncated", "error", "2.3", "The file of a library is truncated.", "archive")

_UNREADABLE = ("zip-bomb", "zip-encrypted", "zip-method")  # rules whose violation prevents unpacking

DAMAGED = declare("zip-damaged", "error", "2.3", "A member of the archive cannot be read.", "archive")


@dataclass(frozen=True)
class Contents:
    """The members of an FMU."""

    archive: zipfile.ZipFile  # the FMU, which is open during the check
    identifiers: tuple[str, ...] = ()  # model identifiers of the interfaces; none if unknown
    source_files: tuple[str, ...] | None = None  # source files declared in the XML; None if unknown
    version: int = 2  # version of FMI

    @property
    def members(self) -> list[zipfile.ZipInfo]:
        """The members in the order of the archive."""
        return self.archive.infolist()

    @cached_property
    def names(self) -> frozenset[str]:
        """The names of the members."""
        return frozenset(self.archive.namelist())

    def below(self, folder: str) -> list[PurePosixPath]:
        """Return the files in a folder of the archive."""
        return [PurePosixPath(n) for n in sorted(self.names) if n.startswith(f"{folder}/") and not n.endswith("/")]


def open_contents(path: Path) -> Contents | Finding:
    """Return the open archive, or a finding that explains why its members cannot be listed."""
    if path.exists() and not path.is_dir() and not path.is_file():
        raise OSError("it is not a regular file")  # a device or a pipe may have no end
    try:
        return Contents(open_unchecked(path))
    except ZipError as error:
        return NOT_A_ZIP.finding(f"{path.name} cannot be read as an archive: {error}")


def read_member(contents: Contents, name: str) -> bytes | Finding:
    """Return the content of a member of an archive that is not a bomb, or a finding if it cannot be read."""
    try:
        return read_zip(contents.archive, name)
    except ZipError as error:
        return DAMAGED.finding(f"{name} cannot be unpacked: {error}", name)


def examine_archive(contents: Contents) -> list[Finding]:
    """Return the findings of the archive rules."""
    findings = list(apply("archive", contents))
    if not any(finding.rule in _UNREADABLE for finding in findings):
        findings += _damaged(contents)
    return findings


def _damaged(contents: Contents) -> Iterator[Finding]:
    for member in contents.members:
        try:
            with contents.archive.open(member) as file:
                while file.read(1 << 20):
                    pass
        except Exception as error:  # zipfile and the codecs raise many kinds of exceptions for damaged members
            message = f"{member.filename} cannot be unpacked ({reason(error)}); copy or export the FMU again"
            yield DAMAGED.finding(message, member.filename)


def of_member(
    id: str, severity: Severity, summary: str
) -> Callable[[Callable[[zipfile.ZipInfo], str]], Callable[[zipfile.ZipInfo], str]]:
    """Add a rule with a function that returns what is wrong with a member of the archive; empty if nothing is."""

    def add(function: Callable[[zipfile.ZipInfo], str]) -> Callable[[zipfile.ZipInfo], str]:
        @rule(id, severity, "2.3", summary, "archive")
        def faults(contents: Contents) -> Iterator[Fault]:
            return (Fault(text, file=member.filename) for member in contents.members if (text := function(member)))

        return function

    return add


# ---- paths


@of_member("path-outside", "error", "The path of a member points outside the folder to which the FMU is unpacked.")
def _outside(member: zipfile.ZipInfo) -> str:
    outside = "\\" not in member.orig_filename and find_outside([member.orig_filename]) is not None
    return f"the member {member.orig_filename!r} points outside the archive; do not use this file" if outside else ""


@of_member("path-backslash", "error", "A path contains backslashes instead of slashes.")
def _backslash(member: zipfile.ZipInfo) -> str:
    path = member.orig_filename
    return f"the path {path!r} contains backslashes; zip the FMU with '/'" if "\\" in path else ""


@of_member("path-dot", "warning", "A path starts with './' or contains an empty or '.' part.")
def _dot(member: zipfile.ZipInfo) -> str:
    parts = member.filename.removesuffix("/").removeprefix("/").split("/")
    long = "" in parts or "." in parts
    return f"the path {member.filename!r} is not in its shortest form; zip the FMU again" if long else ""


@rule("path-duplicate", "error", "2.3", "Two members have the same path, or paths that differ only in case.", "archive")
def _duplicate(contents: Contents) -> Iterator[Fault]:
    counted = Counter(member.filename.lower() for member in contents.members)
    for name, count in counted.items():
        if count > 1:
            yield Fault(f"{count} members are called {name!r} (ignoring case); keep one", file=name)


@of_member("path-symlink", "error", "A member is a symbolic link or another special file.")
def _symlink(member: zipfile.ZipInfo) -> str:
    kind = stat.filemode(member.external_attr >> 16)[0]
    text = f"{member.filename!r} is not a regular file but a {kind!r}; replace it by the file itself"
    return text if is_special(member) else ""


@rule("path-clash", "error", "2.3", "A path is both a file and a folder, ignoring case.", "archive")
def _clash(contents: Contents) -> Iterator[Fault]:
    for name in find_clashes((normal_name(member).lower(), member.is_dir()) for member in contents.members):
        yield Fault(f"{name!r} is both a file and a folder (ignoring case); rename one", file=name)


@of_member("path-long", "error", "A path is longer than file systems allow.")
def _long(member: zipfile.ZipInfo) -> str:
    part, whole = LONGEST
    where = f"a path that begins with {member.filename[:60]!r} is too long"
    text = f"{where}; shorten each name to {part} bytes, the path to {whole}"
    return text if is_too_long(member.filename) else ""


# ---- compression


@of_member("zip-encrypted", "error", "A member is encrypted.")
def _encrypted(member: zipfile.ZipInfo) -> str:
    return f"{member.filename!r} is encrypted; zip it without a password" if member.flag_bits & 1 else ""


@of_member("zip-method", "error", "A member is compressed by a method other than deflate.")
def _method(member: zipfile.ZipInfo) -> str:
    text = f"{member.filename!r} is compressed by {method(member)}; use deflate or store"
    return text if member.compress_type not in _DEFLATE else ""


@of_member("zip-version", "warning", "A member requires a zip version above 2.0.")
def _version(member: zipfile.ZipInfo) -> str:
    above = member.extract_version > 20 and member.compress_type in _DEFLATE
    text = f"{member.filename!r} requires zip version {member.extract_version / 10}; use at most 2.0"
    return text if above else ""


@rule("zip-bomb", "error", "2.3", "The archive unpacks to far more than its size suggests.", "archive")
def _bomb(contents: Contents) -> Iterator[Fault]:
    unpacked, size = unpacked_size(contents.members), size_of(contents.archive)
    if is_bomb(unpacked, size):
        yield Fault(f"{size} bytes unpack to {unpacked}; do not use this file", file="")


# ---- required files and their places


@rule(
    "no-model-description",
    "error",
    "2.3",
    "modelDescription.xml is missing at the top level of the archive.",
    "archive",
)
def _no_description(contents: Contents) -> Iterator[Fault]:
    if DESCRIPTION not in contents.names:
        found = [name for name in sorted(contents.names) if PurePosixPath(name).name == DESCRIPTION]
        beside = f", only {found[0]!r}; zip the contents of that folder" if found else "; export it again as FMI 2.0"
        yield Fault(f"{DESCRIPTION} is missing at the top level{beside}", file="")


@rule("no-code", "error", "2.3", "There are neither binaries nor sources.", "archive")
def _no_code(contents: Contents) -> Iterator[Fault]:
    if not contents.below("binaries") and not contents.below("sources"):
        yield Fault("the archive has neither binaries nor sources; export it with one of them", file="")


@rule("platform-unknown", "warning", "2.3", "The name of a folder with binaries is not a platform.", "archive")
def _platform(contents: Contents) -> Iterator[Fault]:
    for folder in sorted({path.parts[1] for path in contents.below("binaries") if len(path.parts) > 2}):
        architecture, _, system = folder.partition("-")
        there = contents.version
        if (other := _OTHER[there].get(folder)) is not None:
            yield Fault(
                f"importers of FMI {there}.0 do not look into binaries/{folder}; rename it to {other}",
                file=f"binaries/{folder}",
            )
        elif folder not in _PLATFORMS and not (architecture in _ARCHITECTURES and system in _SYSTEMS):
            known = ", ".join(_PLATFORMS)
            yield Fault(f"binaries/{folder} is not a platform; rename it to one of {known}", file=f"binaries/{folder}")


@rule("binary-misnamed", "error", "2.3", "A platform has no library with the name of the model.", "archive")
def _misnamed(contents: Contents) -> Iterator[Fault]:
    for folder in sorted({path.parts[1] for path in contents.below("binaries") if len(path.parts) > 2}):
        system = folder.partition("-")[2] or folder.rstrip("0123456789")
        for identifier in contents.identifiers:
            needed = f"binaries/{folder}/{identifier}{_SUFFIXES.get(system, '')}"
            if system in _SUFFIXES and needed not in contents.names:
                yield Fault(f"{needed} is missing; name the library after modelIdentifier", file=f"binaries/{folder}")


@rule("source-missing", "error", "2.2.1", "A file listed in SourceFiles is missing in the folder sources.", "archive")
def _source_missing(contents: Contents) -> Iterator[Fault]:
    missing = [
        name for name in contents.source_files or () if str(PurePosixPath("sources", name)) not in contents.names
    ]
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        yield Fault(f"SourceFiles lists {missing[0]!r}{more}, missing in sources; add the files")


@rule("source-undeclared", "warning", "2.2.1", "There are C sources, but no list of the files to compile.", "archive")
def _source_undeclared(contents: Contents) -> Iterator[Fault]:
    sources = [path for path in contents.below("sources") if path.suffix in (".c", ".cpp", ".cc")]
    if sources and contents.source_files == () and "sources/buildDescription.xml" not in contents.names:
        yield Fault(f"no SourceFiles element lists {sources[0]} and the other sources; list the files to compile")


@rule("source-no-build", "error", "2.5.1.1", "There are C sources, but no build description of FMI 3.0.", "archive")
def _no_build(contents: Contents) -> Iterator[Fault]:
    sources = [path for path in contents.below("sources") if path.suffix in (".c", ".cpp", ".cc")]
    if contents.version == 3 and sources and "sources/buildDescription.xml" not in contents.names:
        yield Fault(f"no sources/buildDescription.xml tells how to compile {sources[0]} and the other sources; add it")


@rule("source-headers", "note", "2.3", "The sources contain FMI headers.", "archive")
def _headers(contents: Contents) -> Iterator[Fault]:
    for path in contents.below("sources"):
        if path.name in _HEADERS:
            yield Fault(f"the FMU contains {path}; remove it, as importers provide it", file=str(path))


@rule("file-unknown", "note", "2.3", "A file or folder at the top level is not defined by the standard.", "archive")
def _unknown(contents: Contents) -> Iterator[Fault]:
    for top in sorted({PurePosixPath(name).parts[0] for name in contents.names if PurePosixPath(name).parts}):
        if top not in (*_TOP, DESCRIPTION, "model.png") and top not in ("/", "..", "."):
            yield Fault(f"the standard does not define {top!r}; move it to resources or extra", file=top)


@rule("documentation-entry", "note", "2.3", "documentation/index.html is missing.", "archive")
def _documentation(contents: Contents) -> Iterator[Fault]:
    if "documentation/index.html" not in contents.names:
        yield Fault("documentation/index.html is missing; add it, as tools open it on request", file="documentation")


@rule("licence-misplaced", "note", "2.3", "A licence is outside documentation/licenses.", "archive")
def _licence(contents: Contents) -> Iterator[Fault]:
    for name in sorted(contents.names):
        path = PurePosixPath(name)
        licence = path.stem.lower() in ("license", "licence") and path.suffix.lower() in ("", ".txt", ".html", ".md")
        if licence and path.parts[0] in ("documentation", "licenses", name) and "licenses" not in path.parts[1:-1]:
            yield Fault(f"move {name!r} to documentation/licenses/license.txt", file=name)


def truncated_libraries(contents: Contents) -> Iterator[Finding]:
    """Yield a finding for each truncated library in a safe archive; some loaders crash on them."""
    libraries = [str(path) for path in contents.below("binaries") if path.suffix in _SUFFIXES.values()]
    for name in libraries:
        with contents.archive.open(name) as file:
            missing = missing_of(file.read(LONGEST_TABLE), contents.archive.getinfo(name).file_size)
        if missing:
            yield TRUNCATED.finding(
                f"{name} is truncated: {missing} bytes are missing at the end; copy or export the FMU again", name
            )


def misplaced_libraries(contents: Contents) -> Iterator[Finding]:
    """Yield a finding for each library in a safe archive that is none of its platform."""
    for path in contents.below("binaries"):
        folder = _OTHER[2].get(path.parts[1], path.parts[1])
        architecture, _, system = _TUPLES.get(folder, folder).partition("-")
        if system not in _FORMATS or path.suffix != _SUFFIXES[system] or len(path.parts) != 3:
            continue
        magic, place, machines = _FORMATS[system]
        with contents.archive.open(str(path)) as file:
            head = file.read(1024)
        if system == "windows":
            place = int.from_bytes(head[60:64], "little") + 4
        machine = machines.get(architecture)
        right = machine is None or head[place : place + 2] == machine.to_bytes(2, "little")
        if len(head) >= 64 and not (head.startswith(magic) and right):
            yield FORMAT.finding(f"{path} is no library for {folder}; compile it for this platform", str(path))
