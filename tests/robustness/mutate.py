"""Damage of files, each reproducible from a random generator: bytes, words, values of TOML, members of archives."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from random import Random

from lxml import etree

Files = Mapping[str, bytes]
Way = Callable[[bytes, Random], bytes]

SCRAPS = (b"", b"\0", b"\xff", b"nan", b"1e999", b"-1", b'"', b"[", b"]", b"{}", b"<", b"&x;", b"../../x", b"=", b"\n")

WORDS = ("", "0", "-1", "1e999", "NaN", "99999999999999999999999", "x" * 5000, "\u2603", "true", "2 2", "-")
"""Texts for attributes of XML and cells of tables."""

NAMES = (
    *("../a", "/a", "a/../../b", "C:\\a", "\\\\host\\a", "a//b"),
    *(".", "..", "./", "a/./b", "CON", "binaries//x", "binaries/x/y", "a\x00b"),
)
"""Names for members of archives."""

DEEP = "[" * 2000 + "]" * 2000

NUMBERS = (
    *(
        "inf",
        "-inf",
        "nan",
        "0",
        "-1",
        "1",
        "2",
        "0.5",
        "0.01",
        "-0.0",
        "1e-320",
        "1e-12",
        "1e6",
        "1e30",
        "1e308",
        "-1e308",
    ),
    *("9223372036854775807", "9223372036854775808", "-9223372036854775809", "4294967296", "1000001", "10" * 300),
)
TEXTS = (
    *(
        '""',
        '"a"',
        '"mass.v"',
        '"../../x"',
        '"/dev/zero"',
        '"/dev/null"',
        '"."',
        '"\\u0000"',
        '"[/b]"',
        '"\\u2603"',
        '"1"',
    ),
    *(
        '"m/s"',
        '"kN"',
        '"%"',
        '"9**9**9**9*N"',
        '"((((((N))))))"',
        "''",
        f'"{"x" * 100_000}"',
        '"hold"',
        '"jacobi"',
        '"LuGre"',
    ),
)
OTHERS = (
    *(
        "true",
        "false",
        "[]",
        "[1]",
        '["a"]',
        '["mass.v", "mass.v"]',
        "[[1.0, 0.0]]",
        "[inf, nan]",
        "{}",
        "{ a = 1 }",
        DEEP,
    ),
    *(f"[{'1, ' * 5000}]", "{ a = { b = { c = [] } } }", "1979-05-27T07:32:00Z", "07:32:00", "1979-05-27"),
)
"""Values of TOML that a table of settings may hold by mistake."""


def damaged(content: bytes, random: Random, ways: Sequence[Way]) -> bytes:
    """The content, damaged in up to eight places."""
    for _ in range(random.choice((1, 1, 1, 1, 2, 2, 3, 8))):
        content = random.choice(ways)(content, random)
    return content


def _flip(content: bytes, random: Random) -> bytes:
    if not content:
        return content
    k = random.randrange(len(content))
    return content[:k] + bytes([content[k] ^ (1 << random.randrange(8))]) + content[k + 1 :]


def _set(content: bytes, random: Random) -> bytes:
    if not content:
        return content
    k = random.randrange(len(content))
    return content[:k] + bytes([random.choice((0, 1, 127, 128, 255, random.randrange(256)))]) + content[k + 1 :]


def _ends(content: bytes, random: Random, most: int = 200) -> tuple[int, int]:
    begin = random.randrange(len(content) + 1)
    return begin, min(begin + random.randint(1, most), len(content))


def _truncate(content: bytes, random: Random) -> bytes:
    return content[: random.choice((0, 1, 4, random.randrange(len(content) + 1), max(len(content) - 1, 0)))]


def _delete(content: bytes, random: Random) -> bytes:
    begin, end = _ends(content, random)
    return content[:begin] + content[end:]


def _double(content: bytes, random: Random) -> bytes:
    begin, end = _ends(content, random)
    return content[:end] + content[begin:end] * random.choice((1, 1, 1, 50)) + content[end:]


def _splice(content: bytes, random: Random) -> bytes:
    begin, end = _ends(content, random, 40)
    return content[:begin] + random.choice(SCRAPS) + content[random.choice((begin, end)) :]


def _lines(content: bytes, random: Random) -> bytes:
    """A line less, twice, or two exchanged."""
    lines = content.splitlines(keepends=True)
    if not lines:
        return content
    i, j = random.randrange(len(lines)), random.randrange(len(lines))
    way = random.randrange(3)
    if way == 0:
        lines[i], lines[j] = lines[j], lines[i]
    else:
        lines[i : i + 1] = [] if way == 1 else [lines[i]] * 2
    return b"".join(lines)


def _words(content: bytes, random: Random) -> bytes:
    """Two words exchanged."""
    found = list(re.finditer(rb"[\w.+-]+", content))
    if len(found) < 2:
        return content
    a, b = sorted(random.sample(found, 2), key=lambda match: match.start())
    return content[: a.start()] + b[0] + content[a.end() : b.start()] + a[0] + content[b.end() :]


def _number(content: bytes, random: Random) -> bytes:
    """A number or a quoted text replaced by an odd one."""
    found = list(re.finditer(rb'(?<=")[^"\n]*(?=")|(?<![\w.])[-+]?\d[\d.eE+-]*', content))
    if not found:
        return content
    match = random.choice(found)
    return content[: match.start()] + random.choice(WORDS).encode() + content[match.end() :]


BYTES: Sequence[Way] = (_flip, _set, _truncate, _delete, _double, _splice)
TEXT: Sequence[Way] = (_flip, _delete, _double, _splice, _lines, _lines, _words, _words, _number, _number, _number)


def odd_values(content: bytes, random: Random, keys: Sequence[str] = ()) -> bytes:
    """A TOML file with odd values of one to three keys, some of which are new to it."""
    text = content.decode()
    for _ in range(random.choice((1, 1, 1, 1, 2, 3))):
        if keys and random.random() < 0.2:
            heads = [match.end() for match in re.finditer(r"^\[.*\]$", text, re.M)] or [0]
            place, key = random.choice(heads), random.choice(keys)
            if f"\n{key} = " not in text[place:].split("\n[")[0]:
                text = f"{text[:place]}\n{key} = {random.choice(NUMBERS + TEXTS + OTHERS)}\n{text[place:]}"
            continue
        # a number, a quoted text, a word or a list behind "=" or within a list
        found = list(re.finditer(r'(?<=[=\[,] )("[^"\n]*"|[-+\w.]+|\[[^\]\n]*\])|(?<=\[)"[^"\n]*"', text))
        if found:
            match = random.choice(found)
            alike = TEXTS if match[0].startswith('"') else NUMBERS
            pool = alike if random.random() < 0.7 else NUMBERS + TEXTS + OTHERS
            text = text[: match.start()] + random.choice(pool) + text[match.end() :]
    return text.encode()


def odd_xml(content: bytes, random: Random) -> bytes:
    """Well-formed XML of which up to three elements are lost, doubled or copied, or attributes have odd values."""
    root = etree.fromstring(content)
    for _ in range(random.choice((1, 1, 1, 1, 2, 3))):
        # comments have no attributes, and the root stays
        elements = [each for each in root.iter("*") if each is not root]
        if not elements:
            break
        one, other = random.choice(elements), random.choice(elements)
        way = random.random()
        if way < 0.7:
            with_values = [each for each in root.iter("*") if each.attrib]
            one, other = random.choice(with_values), random.choice(with_values)
            key = random.choice(list(one.attrib))
            known = [value for each in with_values for value in each.attrib.values()]
            one.set(key, random.choice((random.choice(known), random.choice(WORDS), random.choice(NUMBERS))))
        elif way < 0.8:
            one.getparent().remove(one)
        elif way < 0.9:
            one.addnext(deepcopy(one))
        else:
            other.append(deepcopy(one))
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8")


def members(content: bytes) -> dict[str, bytes]:
    """Member -> content of an archive."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def zipped(content: Mapping[str, bytes], twice: Sequence[tuple[str, bytes]] = ()) -> bytes:
    """An archive with these members, and further ones of the same names."""
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in (*content.items(), *twice):
            archive.writestr(name, data)
    return whole.getvalue()


def damaged_archive(content: bytes, random: Random, inner: str, ways: Sequence[Way] = TEXT) -> bytes:
    """An archive with a damaged directory, other members, or members that are damaged behind a right checksum.

    Parameters
    ----------
    content : bytes
        The archive.
    random : Random
        What decides.
    inner : str
        Regular expression of the members that may be damaged inside.
    ways : sequence of callable
        How these are damaged.
    """
    if random.random() < 0.25:
        # the directory at the end is where an archive can lie most
        first = random.choice((0, content.index(b"PK\x01\x02")))
        return content[:first] + damaged(content[first:], random, BYTES)
    found = members(content)
    matching = [name for name in found if re.search(inner, name)]
    if random.random() < 0.2:
        name = random.choice(list(found))
        way = random.randrange(3)
        if way == 0:
            found[random.choice(NAMES)] = found.pop(name)
        elif way == 1:
            del found[name]
        else:
            found[name] = b""
    if matching and (target := random.choice(matching)) in found:
        found[target] = damaged(found[target], random, ways)
    return zipped(found)
