"""The catalogue of blocks: one C file per block and one Python file per law, found by folder."""

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from friction_fmus.blocks import FAMILIES, KINDS
from friction_fmus.blocks.axis_units import SLIDING, TURNING, Words
from friction_fmus.blocks.block_declarations import About, about_c_block, cited, use_of
from friction_fmus.blocks.customise import with_long_arrays
from friction_fmus.blocks.law_summaries import law_paths, read_headings
from friction_fmus.blocks.macros import string, words
from friction_fmus.errors import FrictionError, UnknownNameError, did_you_mean
from harness.extras import require
from harness.storage.files import read_source, reason

PACKAGE = Path(__file__).parents[1]

OWN_BLOCKS = "FRICTION_FMUS_BLOCKS"  # environment variable with folders of user blocks, separated as in PATH

FEATURES = {
    "presliding": "the contact is elastic before it slides",
    "nonlocal memory": "inner hysteresis loops close and do not change the outer ones",
    "drift-free": "no drift under a constant force with small vibrations",
    "Stribeck": "friction decreases with speed at the onset of sliding",
    "lag": "friction lags behind changes of the speed",
    "dwell": "static friction grows with the dwell time",
    "rate dependent": "the force depends on how fast a path is followed",
    "needs force": "an input for the other forces on the mass determines friction at rest",
    "mass inside": "the model contains the moving mass",
    "random": "random numbers, reproducible with a seed",
}
"""Phenomena that a friction model can show, in the order of the table in docs/models.md, with their meaning."""


@dataclass(frozen=True)
class Block:
    """A block that can be built as an FMU.

    Attributes
    ----------
    name : str
        Model identifier.
    kind : str
        friction, plant, compensator or signal.
    summary, source : str
        One line each: a short description, and the literature.
    notes : str
        The documentation as plain text; indented paragraphs are equations.
    path : Path
        The file that defines it.
    code : str
        Its C source.
    features : tuple of str
        Phenomena that the friction model shows, from `FEATURES`.
    bibtex : tuple of str
        BibTeX entries of its sources.
    status : str
        What its equations were checked against: their numbers in the source, or that they were not checked.
    no_exchange : str
        Why it cannot be used for model exchange; empty if it can.
    reinitialises : tuple of str
        Continuous states that an event of model exchange may change.
    about : About
        Further declarations in its file.
    rotary_summary : str
        The description for a rotary axis.
    """

    name: str
    kind: str
    summary: str
    source: str
    notes: str
    path: Path
    code: str
    features: tuple[str, ...] = ()
    bibtex: tuple[str, ...] = ()
    status: str = ""
    no_exchange: str = ""
    reinitialises: tuple[str, ...] = ()
    about: About = field(default_factory=About)
    rotary_summary: str = ""

    @property
    def family(self) -> str:
        """Family of a compensator, one of the values of `FAMILIES`; empty for other kinds."""
        use = self.about.use.kind if self.about.use else "other"
        return FAMILIES[use] if self.kind == "compensator" else ""

    @property
    def is_law(self) -> bool:
        """Whether it is a compensator in a Python file, which exports C."""
        return self.path.suffix == ".py"

    @property
    def origin(self) -> str:
        """Return the source and, if known, the origin of the equations."""
        return f"{self.source}; {self.status}" if self.status else self.source


def summary_of(block: Block, words: Words) -> str:
    """Return the description of a block with the nouns of an axis."""
    return block.rotary_summary if words == TURNING else block.summary


class Entry(NamedTuple):
    """A line in a list of blocks, with the attribute names of `Block`."""

    name: str
    kind: str
    summary: str
    source: str
    path: Path
    family: str = ""


def source_folder() -> Path:
    """Return the folder of the C sources: inside an installed package, next to it in a checkout."""
    inside = PACKAGE / "fmu_src"
    return inside if inside.is_dir() else PACKAGE.parent / "fmu_src"


def licence_text() -> str:
    """Return the text of ``LICENSE``: inside an installed package, next to it in a checkout."""
    inside = PACKAGE / "LICENSE"
    return (inside if inside.is_file() else PACKAGE.parent / "LICENSE").read_text(encoding="utf-8")


def icon_files(block: Block) -> tuple[Path, ...]:
    """Return the icon of a block: ``NAME.png`` and ``NAME.svg`` beside its file, or else that of its kind."""
    files = block.path.with_suffix(".png"), block.path.with_suffix(".svg")
    if all(file.is_file() for file in files):
        return files
    return drawn("presliding" if "presliding" in block.features else block.kind)


def drawn(name: str) -> tuple[Path, Path]:
    """Return the PNG and SVG file of an icon of this package."""
    folder = PACKAGE / "fmi" / "icons"
    return folder / f"{name}.png", folder / f"{name}.svg"


def laws_folder() -> Path:
    """Return the folder of the laws in this package."""
    return PACKAGE / "laws"


@contextmanager
def _errors_of(path: Path) -> Iterator[None]:
    """Name the file in errors."""
    try:
        yield
    except FrictionError as error:
        raise FrictionError(f"{path}: {error}") from error


def read_c(path: Path, failure: type[Exception]) -> str:
    """Return the text of a C file; `failure` is the class of the error if it cannot be read."""
    try:
        return read_source(path)
    except (OSError, ValueError) as error:
        raise failure(f"{path} cannot be read as C ({reason(error)}); give a text in UTF-8") from error


def _c_heading(path: Path, kind: str) -> tuple[Entry, str]:
    """Return the line in the list for a C file, and its text."""
    code = read_c(path, FrictionError)
    name = re.search(r"^#define\s+MODEL\s+(\w+)\s*$", code, re.M)
    if not name or not re.search(r"^#define\s+VARIABLES\b", code, re.M):
        raise FrictionError(f"{path} is not a block: it needs `#define MODEL name` and `#define VARIABLES`")
    family = ""
    if kind == "compensator":
        with _errors_of(path):
            used = use_of(code)
        family = FAMILIES[used.kind if used else "other"]
    return Entry(name[1], kind, SLIDING.fill(string(code, "SUMMARY")), string(code, "SOURCE"), path, family), code


def read_c_block(path: Path, kind: str) -> Block:
    """Return the block in a C file."""
    entry, code = _c_heading(path, kind)
    with _errors_of(path):
        about = about_c_block(code)
    notes = re.match(r"\s*/\*(.*?)\*/", code, re.S)
    lines = notes.group(1).splitlines() if notes else []
    page = "\n".join(line.removeprefix("   ").rstrip() for line in lines).strip()

    features = words(string(code, "FEATURES"))
    if unknown := set(features) - set(FEATURES):
        raise FrictionError(f"{path} states the feature {unknown.pop()!r}; known features are {', '.join(FEATURES)}")
    found = re.findall(r"/\*\s*(@\w+\{.*?\})\s*\*/", code, re.S)
    entries = tuple("\n  ".join(line.strip() for line in entry.splitlines()) for entry in found)
    return Block(
        *(entry.name, kind, entry.summary, entry.source, page, path, code),
        features=features,
        bibtex=(*cited(about.cites), *entries),
        status=string(code, "STATUS"),
        no_exchange=string(code, "NO_EXCHANGE"),
        reinitialises=words(string(code, "REINITIALISES")),
        about=about,
        rotary_summary=TURNING.fill(string(code, "SUMMARY")),
    )


def _read_laws(path: Path) -> list[Block]:
    require("casadi", "a law in a Python file needs it")
    from friction_fmus.lawkit.law import block_source, discover_laws

    return [
        Block(
            *(law.name, "compensator", SLIDING.fill(law.summary), law.source, law.documentation, law.path),
            block_source(law),
            bibtex=cited(law.about.cites),
            about=law.about,
            rotary_summary=TURNING.fill(law.summary),
        )
        for law in discover_laws(path)
    ]


def listing() -> dict[str, Entry]:
    """Return all blocks by name, in the order of `catalogue`, without translating the laws to C."""
    return _listing(os.environ.get(OWN_BLOCKS, ""))


@cache
def _listing(own: str) -> dict[str, Entry]:
    entries = [*_c_entries(source_folder()), *_law_entries(laws_folder())]
    for folder in map(Path, filter(None, own.split(os.pathsep))):
        if not folder.is_dir():
            raise FrictionError(f"{OWN_BLOCKS} names the folder {folder}, which does not exist; correct it or unset it")
        entries += [*_c_entries(folder), *_law_entries(folder)]
    found: dict[str, Entry] = {}
    order = [*KINDS.values()]
    for entry in sorted(entries, key=lambda entry: (order.index(entry.kind), entry.name)):
        other = found.setdefault(entry.name, entry)
        if other is not entry:
            raise FrictionError(f"Two blocks are called {entry.name}: {other.path} and {entry.path}; rename one")
    return found


def _c_entries(folder: Path) -> list[Entry]:
    kinds = {"": "friction", **KINDS}
    files = [(path, kind) for part, kind in kinds.items() for path in sorted((folder / part).glob("*.c"))]
    return [_c_heading(path, kind)[0] for path, kind in files]


def _law_entries(folder: Path) -> list[Entry]:
    found: list[Entry] = []
    for file in law_paths(folder):
        headings = read_headings(file)
        laws = _read_laws(file) if headings is None else headings
        for law in laws:
            text = SLIDING.fill(law.summary)
            found.append(Entry(law.name, "compensator", text, law.source, law.path, law.family))
    return found


def catalogue() -> dict[str, Block]:
    """Return all blocks by name, in the order friction, plant, compensator, signal.

    They are in this package and in the folders of the environment variable ``FRICTION_FMUS_BLOCKS``: C files of
    friction models, law files, and C files of other kinds in the subfolders of `KINDS`.

    Returns
    -------
    dict of str to Block
        Blocks by name.

    Raises
    ------
    FrictionError
        If a folder does not exist, a file is not a block, or two blocks have the same name.
    """
    return {name: _read(entry) for name, entry in listing().items()}


@cache
def _known_c_block(path: Path, kind: str) -> Block:
    return read_c_block(path, kind)


@cache
def _read(entry: Entry) -> Block:
    if entry.path.suffix == ".py":
        return next(block for block in _read_laws(entry.path) if block.name == entry.name)
    return _known_c_block(entry.path, entry.kind)


@cache
def about_of(entry: Entry) -> About:
    """Return the declarations in a block's file, without translating a law to C."""
    if entry.path.suffix != ".py":
        return _known_c_block(entry.path, entry.kind).about
    from friction_fmus.lawkit.law import discover_laws

    return next(law.about for law in discover_laws(entry.path) if law.name == entry.name)


def find(model: str | Path) -> Block:
    """Return the block with this name, or from a user's ``.c`` or law ``.py`` file.

    Parameters
    ----------
    model : str or Path
        Name of a block of the catalogue, or path of a file.

    Returns
    -------
    Block
        Contents of the block's file.

    Raises
    ------
    UnknownNameError
        If the block does not exist; the message suggests the most similar name.
    FrictionError
        If the file is not a block.
    """
    if not os.environ.get(OWN_BLOCKS):  # else the listing tells whether two blocks have this name
        for folder, kind in KINDS.items():
            path = source_folder() / folder / f"{model}.c"
            if path.is_file() and (block := _known_c_block(path, kind)).name == str(model):
                return block
    known = listing()
    if str(model) in known:
        return _read(known[str(model)])
    path = Path(model)
    if path.suffix not in (".c", ".py"):
        raise UnknownNameError(
            f"There is no model {str(model)!r}{did_you_mean(str(model), known)} (`friction-fmus list` lists all models)"
        )
    if not path.is_file():
        raise UnknownNameError(
            f"The file {path} does not exist; give the path of a block's .c file or a law's .py file"
        )
    if path.suffix == ".c":
        return read_c_block(path, "friction")
    laws = _read_laws(path)
    if len(laws) != 1:
        raise FrictionError(f"{path} defines {len(laws)} laws; a law file defines exactly one with @law")
    return laws[0]


def with_room(block: Block, start: Mapping[str, Any]) -> Block:
    """Return the block with vectors and arrays as large as these start values need."""
    if not block.is_law:
        return replace(block, code=with_long_arrays(block.code, block.name, start))
    if not start:
        return block
    from friction_fmus.lawkit.law import block_source, discover_laws

    law = next(law for law in discover_laws(block.path) if law.name == block.name)
    grown = law.with_room(start)
    return block if grown is law else replace(block, code=block_source(grown))
