"""The sections of a WebAssembly module that tell what it needs and offers."""

from __future__ import annotations

from collections.abc import Iterator

_IMPORTS = 2


def imports(module: bytes) -> tuple[str, ...]:
    """Return the functions and memories that a module needs, as "module.name"."""
    for section, data in _sections(module):
        if section == _IMPORTS:
            found: list[str] = []
            count, place = _number(data, 0)
            while len(found) < count:
                names = []
                for _ in range(2):
                    length, place = _number(data, place)
                    names.append(data[place : place + length].decode())
                    place += length
                found.append(".".join(names))
                place = _after_type(data, place)
            return tuple(found)
    return ()


def _after_type(data: bytes, place: int) -> int:
    """Return the place after the type of an import: function, table, memory or global."""
    kind = data[place]
    place += 1
    if kind == 0:
        return _number(data, place)[1]
    if kind == 3:
        return place + 2
    place += kind == 1
    flags, place = _number(data, place)
    for _ in range(1 + (flags & 1)):
        _, place = _number(data, place)
    return place


def _sections(module: bytes) -> Iterator[tuple[int, bytes]]:
    place = 8
    while place < len(module):
        size, start = _number(module, place + 1)
        yield module[place], module[start : start + size]
        place = start + size


def _number(data: bytes, place: int) -> tuple[int, int]:
    """Return an unsigned number in LEB128, and the place after it."""
    value = shift = 0
    while True:
        byte = data[place]
        place += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, place
        shift += 7
