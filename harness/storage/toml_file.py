"""TOML files from any source, limited in size, depth and text length, and the checked reading of their tables."""

import re
import tomllib
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

from harness.errors import nearest
from harness.storage.files import read_source, reason
from harness.values import is_line, shown

_Value = TypeVar("_Value")

DEEPEST: Final = 20  # largest depth of nested tables and lists
LONGEST: Final = 4096  # largest length of a text [characters]; no path on Linux is longer

_PART = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')"""
# time and memory of tomllib grow with the square of the number of parts of a key
_LONG_KEY = re.compile(rf"(?<![A-Za-z0-9_-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{DEEPEST}}}")


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file."""
    content = read_source(path)  # with line ends as tomllib.load has them
    long = _LONG_KEY.search(content)
    if long is not None:
        line = content.count("\n", 0, long.start()) + 1
        raise ValueError(f"line {line} has a key with more than {DEEPEST} parts")
    try:
        document = tomllib.loads(content)
    except RecursionError:
        raise ValueError(f"it is nested deeper than {DEEPEST} levels") from None
    _check(document)
    return document


@dataclass(frozen=True)
class TomlTable:
    """A table of a TOML file whose entries are checked when they are read."""

    content: Mapping[str, Any]  # what the file says
    where: str  # start of the messages, such as ``[servo] in axis.toml``
    error: type[Exception]  # class of the errors

    def __post_init__(self) -> None:
        if not isinstance(self.content, Mapping):
            raise self.error(f"{self.where} is {shown(self.content)}, not a table; make it a table")

    def __contains__(self, key: str) -> bool:
        return key in self.content

    def __iter__(self) -> Iterator[str]:
        return iter(self.content)

    def known(self, keys: Collection[str], noun: str = "key") -> None:
        """Refuse a key that is not one of these."""
        for key in self:
            if key not in keys:
                raise self.error(f"{self.where} has the unknown {noun} {shown(key)}; {nearest(key, keys)}")

    def take(self, key: str, read: Callable[[object], _Value | None], remedy: str, *default: _Value) -> _Value:
        """Return what `read` makes of a value; None is an error, and so is a missing key without a default."""
        if key not in self.content:
            if not default:
                raise self.error(f"{self.where} has no {key}; add it")
            return default[0]
        value = read(self.content[key])
        if value is None:
            raise self.error(f"{self.where} has {key} = {shown(self.content[key])}; give {remedy}")
        return value

    def choice(self, key: str, choices: Collection[str], *default: str) -> str:
        """Return a text that is one of these."""

        def read(value: object) -> str | None:
            return value if isinstance(value, str) and value in choices else None

        hint = nearest(str(self.content.get(key)), choices)
        return self.take(key, read, f"one of {', '.join(choices)}" + f" ({hint})" * hint.startswith("did"), *default)


def read_table(path: Path, error: type[Exception]) -> TomlTable:
    """Read a TOML file as a table."""
    try:
        return TomlTable(read_toml(path), str(path), error)
    except OSError as failure:
        raise error(f"{path} cannot be read ({reason(failure)}); give the path of a readable file") from failure
    except ValueError as failure:
        raise error(f"{path} cannot be read as TOML ({reason(failure)}); correct it") from failure


def _check(document: dict[str, Any]) -> None:
    """Raise a ValueError if a limit is exceeded; not recursive, as the document may be deeply nested."""
    pending: list[tuple[str, Any, int]] = [("", document, 0)]
    while pending:
        place, value, depth = pending.pop()
        if depth > DEEPEST:
            raise ValueError(f"{place[:80]}... is nested deeper than {DEEPEST} levels")
        if isinstance(value, dict):
            for key in value:
                _check_text(f"a key in {place or 'it'}", key)
                if not is_line(key):
                    raise ValueError(f"the key {shown(key)} has control characters")
            pending += [(f"{place}.{key}".lstrip("."), item, depth + 1) for key, item in value.items()]
        elif isinstance(value, list):
            pending += [(f"{place}[{index}]", item, depth + 1) for index, item in enumerate(value)]
        elif isinstance(value, str):
            _check_text(place, value)
        elif type(value) is int and not -(1 << 63) <= value < 1 << 63:
            raise ValueError(f"the whole number {place} does not fit into 64 bits")


def _check_text(place: str, value: str) -> None:
    if len(value) > LONGEST:
        raise ValueError(f"{place[:200]} has {len(value)} characters; the limit is {LONGEST}")
    if "\0" in value:
        raise ValueError(f"{place[:200]} has a NUL character")
