"""Reading data files of all supported formats as tables."""

from __future__ import annotations

import gzip
import json
import lzma
import math
import numbers
import re
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.guessing import meaning_of
from friction_fmus.identification.data.record import Array, Finding, unit_of
from friction_fmus.identification.data.tables import EXACT, ChannelGroup, DataTable, from_arrow, on_one_clock
from harness.errors import MissingPackageError
from harness.extras import require
from harness.storage.files import LARGEST_DATA

MISSING: Final = ("", "nan", "NaN", "NAN", "NA", "null", "-nan", "#N/A")  # cells without a value

_NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][-+]?\d+)?|[-+]?(nan|inf(inity)?)", re.IGNORECASE)
_WORDS = dict.fromkeys(MISSING, math.nan) | {"true": 1.0, "True": 1.0, "false": 0.0, "False": 0.0}


def split_cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line without spaces and quotes around them."""
    cells = line.split() if separator == " " else line.split(separator)
    return [cell.strip().strip('"').strip() for cell in cells]


def numeric(cell: str) -> bool:
    """Return whether a cell is a number, with a decimal point or a decimal comma."""
    return _NUMBER.fullmatch(cell) is not None


def as_numbers(cells: Sequence[str], comma: bool) -> Array | None:
    """Return cells as numbers, nan where one is missing; None if one of them is a text."""
    if any("_" in cell or (comma and "." in cell) for cell in cells):  # Python takes 1_000 for a number
        return None
    if comma:
        cells = [cell.replace(",", ".") for cell in cells]
    try:
        return np.array([_WORDS[cell] if cell in _WORDS else float(cell) for cell in cells])
    except ValueError:
        return None


def decimal_comma(path: Path) -> Finding:
    """Return the finding that commas are read as decimal points."""
    what = f"Commas in the numbers of {path.name} are read as decimal points."
    return Finding("decimal-comma", what, "Check a value of each column, or use decimal points.")


KEY = "Name"  # first cell of the row with the names of the channels; it is repeated above each column of times
TICKS = 1e4  # ticks of a time stamp of Windows in a millisecond
LONGEST_HEAD = 200  # largest number of lines above the numbers; comments of symbols can have several lines

_NO_UNIT = ("", "(None)", "None")


def is_scope_export(lines: Sequence[tuple[int, str]], separator: str) -> bool:
    """Return whether a text is an export of TwinCAT Scope."""
    if not lines[0][1].startswith(KEY + separator):
        return False
    names = _names_row(lines, separator)
    first = _first_number(lines, separator, names + 1)
    if names == 0 or first is None:
        return False
    width, wanted = (len(split_cells(lines[row][1], separator)) for row in (first, names))
    return abs(width - wanted) <= 1  # older versions end lines with a separator


def read_scope_export(path: Path, lines: Sequence[tuple[int, str]], separator: str) -> DataTable:
    """Read a text export of TwinCAT Scope (`is_scope_export`)."""
    names_row = _names_row(lines, separator)
    first = _first_number(lines, separator, names_row + 1)
    assert first is not None
    names = split_cells(lines[names_row][1], separator)
    head = {row[0]: row for row in (split_cells(line, separator) for _, line in lines[names_row + 1 : first])}
    symbols, units = head.get("SymbolName", names), head.get("Unit", [])
    rows = []
    for number, line in lines[first:]:
        cells = split_cells(line, separator)
        if cells[0] and not numeric(cells[0]):
            break  # the mark at the end, or a table of triggers
        rows.append((number, (cells + [""] * len(names))[: len(names)]))
    comma = separator != "," and any("," in cell and numeric(cell) for _, row in rows for cell in row)
    starts = [i for i, name in enumerate(names) if name == KEY]
    groups: list[ChannelGroup] = []
    known: dict[str, str] = {}
    for start, end in zip(starts, [*starts[1:], len(names)], strict=True):
        there = [i for i, (_, row) in enumerate(rows) if row[start]]
        t = _times(path, [rows[i] for i in there], start, comma)
        signals = {}
        for column in range(start + 1, end):
            if not names[column]:
                continue  # older versions end each line with a separator
            name = names[column] if names.count(names[column]) == 1 else symbols[column]
            cells = [rows[i][1][column] for i in there]
            signals[name] = _column(path, name, [rows[i][0] for i in there], cells, comma)
            unit = re.sub(r"\s*\([^()]*\)$", "", units[column]) if column < len(units) else ""
            if unit not in _NO_UNIT:
                known[name] = unit
        same = next((group for group in groups if np.array_equal(group.t, t)), None)
        if same is not None:
            groups[groups.index(same)] = ChannelGroup(t, {**same.signals, **signals})
        else:
            groups.append(ChannelGroup(t, signals))
    if not any(group.signals for group in groups):
        raise RecordError(f"{path} is an export of TwinCAT Scope without channels; export the chart again.")
    table = on_one_clock(path, groups, "time", "ms")
    return replace(table, units={**table.units, **known}, findings=(decimal_comma(path),) if comma else ())


def _names_row(lines: Sequence[tuple[int, str]], separator: str) -> int:
    """Return the index of the last row of names in the head; the first row names the scope."""
    head = lines[: min(len(lines), LONGEST_HEAD)]
    return max(i for i, (_, line) in enumerate(head) if line.startswith(KEY + separator))


def _first_number(lines: Sequence[tuple[int, str]], separator: str, begin: int) -> int | None:
    rows = enumerate(lines[begin : begin + LONGEST_HEAD], start=begin)
    return next((i for i, (_, line) in rows if numeric(split_cells(line, separator)[0])), None)


def _times(path: Path, rows: Sequence[tuple[int, list[str]]], column: int, comma: bool) -> Array:
    """Return times in ms; time stamps of Windows, in 100 ns since 1601, are counted from the first one."""
    cells = [row[column] for _, row in rows]
    if cells and cells[0].isdigit() and len(cells[0]) >= 17:
        ticks = [int(cell) if cell.isdigit() else None for cell in cells]
        if None not in ticks:
            return np.array([(tick - int(cells[0])) / TICKS for tick in ticks if tick is not None])
    return _column(path, "time", [number for number, _ in rows], cells, comma)


def _column(path: Path, name: str, lines: Sequence[int], cells: Sequence[str], comma: bool) -> Array:
    values = as_numbers(cells, comma)
    if values is None:
        number, cell = next((n, c) for n, c in zip(lines, cells, strict=True) if as_numbers([c], comma) is None)
        raise RecordError(f"{path} has the text {cell!r} in line {number}, channel {name!r}; correct the file.")
    return values


_COMMENTS = ("#", "%", "//", "!", '"#')
_HEADING = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*(\([^()]*\))?[^\[\]()]*)[\])]\s*")
_SEPARATORS = (";", "\t", ",", "|")


def read_text(path: Path) -> DataTable:
    """Read a text table: columns separated by ; tab , | or spaces, after comments and a heading."""
    full = [(n, line) for n, line in enumerate(_decoded(path).splitlines(), start=1) if line.strip()]
    numbered = [(n, line) for n, line in full if not line.lstrip().startswith(_COMMENTS)]
    if len(numbered) < 4:
        raise RecordError(f"{path} has too few lines for a table ({len(numbered)}); use a heading and rows of numbers.")
    separator = _separator([line for _, line in numbered])
    if is_scope_export(numbered, separator):
        return read_scope_export(path, numbered, separator)
    cells = [split_cells(line, separator) for _, line in numbered]
    if len(cells[-1]) == 1 and len(cells[-2]) > 1 and not numeric(cells[-1][0]):
        del cells[-1], numbered[-1]  # EOF
    first = _first_row(cells)
    if first is None:
        raise RecordError(f"{path} has no line of numbers; use a table with a heading and rows of numbers.")
    rows = [(n, row) for (n, _), row in zip(numbered[first:], cells[first:], strict=True)]
    width = _width(path, rows)
    # the heading may be the last comment line, as written by numpy.savetxt
    remarks = [(n, line.lstrip(' #%/!"')) for n, line in full if n < numbered[0][0]] if first == 0 else []
    remarked = [row for row in remarks[-1:] if len(split_cells(row[1], separator)) == width]
    headings = _headings(path, numbered[:first] or remarked, separator, width, not rows[0][1][-1])
    comma = separator != "," and any("," in cell and numeric(cell) for _, row in rows for cell in row)
    units = {}
    names = []
    for heading in headings:
        name, unit = split_unit(heading)
        names.append(name)
        if unit:
            units[name] = unit
    if len(set(names)) < len(names):
        (double, _), *_ = Counter(names).most_common(1)
        raise RecordError(f"{path} has two columns with the heading {double!r}; rename one.")
    table = _parsed(path, names, rows, comma)
    return replace(table, units={**units, **table.units}, findings=(decimal_comma(path),) if comma else ())


def split_unit(heading: str) -> tuple[str, str]:
    """Return name and unit of a heading such as ``x [mm]`` or ``x (mm)``; the unit may be empty."""
    heading = heading.strip().strip('"').strip()
    match = _HEADING.fullmatch(heading)
    if not match or not match["name"]:
        return heading, ""
    return match["name"].removesuffix("/").rstrip(), match["unit"].strip(" -")


def _decoded(path: Path) -> str:
    opener: Callable[..., IO[bytes]] = {".gz": gzip.open, ".xz": lzma.open}.get(path.suffix.lower(), open)  # type: ignore[assignment]
    with opener(path, "rb") as file:
        content = file.read(LARGEST_DATA + 1)
    if len(content) > LARGEST_DATA:
        raise RecordError(f"{path} has more than {LARGEST_DATA} bytes of text; split the file.")
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _separator(lines: list[str]) -> str:
    """Return the separator with the same count in most of the last lines; a space if there is none."""
    tail = lines[-50:]
    for separator in _SEPARATORS:
        counts = Counter(line.count(separator) for line in tail)
        count, often = counts.most_common(1)[0]
        if count and often > 0.5 * len(tail):
            return separator
    return " "


def _first_row(cells: list[list[str]]) -> int | None:
    """Return the index of the first row of data: as wide as the last rows, with numbers where they have numbers."""
    tail = cells[-50:]
    width = Counter(map(len, tail)).most_common(1)[0][0]
    tail = [row for row in tail if len(row) == width]
    columns = [i for i in range(width) if 2 * sum(numeric(row[i]) for row in tail) > len(tail)]
    if not columns:
        return None

    def is_row(row: list[str]) -> bool:
        return len(row) == width and 2 * sum(numeric(row[i]) for i in columns) >= len(columns)

    first = next((i for i, row in enumerate(cells) if is_row(row) and numeric(row[columns[0]])), None)
    while first and is_row(cells[first - 1]):
        first -= 1  # its first cell is a text, which is reported
    return first


def _width(path: Path, rows: list[tuple[int, list[str]]]) -> int:
    """Return the number of cells per line, which must be equal; the last cell may be empty."""
    widths = [len(row) for _, row in rows]
    width = Counter(widths).most_common(1)[0][0]
    other = next((i for i, found in enumerate(widths) if found != width), None)
    if other is not None:
        raise RecordError(
            f"Line {rows[other][0]} of {path} has {widths[other]} cells, but the others have {width}; correct or "
            "remove it."
        )
    return width


def _headings(path: Path, above: list[tuple[int, str]], separator: str, width: int, loose_end: bool) -> list[str]:
    """Return the headings of the columns, including units from a separate line of units."""
    if not above:
        return [f"column {index + 1}" for index in range(width)]
    rows = [split_cells(line, separator) for _, line in above]
    if separator == " " and len(rows[-1]) != width:
        rows = [re.split(r"\s{2,}|\t", line.strip()) for _, line in above]
    rows = [[*row, "unnamed"] if len(row) == width - 1 and loose_end else row for row in rows]
    fitting = [row for row in rows if len(row) == width]
    if not fitting:
        number, line = above[-1]
        cells = len(split_cells(line, separator))
        decimal = separator == "," and width == 2 * cells
        raise RecordError(
            f"The heading in line {number} of {path} has {cells} names, but the numbers below have {width} columns; "
            + (
                "if the commas are decimal points, use semicolons between the columns."
                if decimal
                else "add a name for each column."
            )
        )
    best = max(range(len(fitting)), key=lambda i: (sum(map(_is_signal, fitting[i])), not _is_units(fitting[i]), i))
    units = next((row for row in fitting[best + 1 :] if _is_units(row)), None)
    if units is None:
        return fitting[best]
    return [f"{name} [{unit.strip('[]() ')}]" for name, unit in zip(fitting[best], units, strict=True)]


def _is_signal(cell: str) -> bool:
    """Return whether a cell of the lines above the numbers names a signal."""
    return meaning_of(*split_unit(cell)) is not None


def _is_units(row: list[str]) -> bool:
    units = [cell.strip("[]() ") for cell in row]
    return any(units) and all(unit in ("", "-") or unit_of(unit) is not None for unit in units)


def _parsed(path: Path, names: list[str], rows: list[tuple[int, list[str]]], comma: bool) -> DataTable:
    columns, units, texts = {}, {}, {}
    for name, cells in zip(names, zip(*(row for _, row in rows), strict=True), strict=True):
        if (values := as_numbers(cells, comma)) is not None:
            columns[name] = values
        elif (moments := _moments(cells)) is not None:
            columns[name], units[name] = moments, "s"
        else:
            number, cell = next((rows[i][0], cell) for i, cell in enumerate(cells) if as_numbers([cell], comma) is None)
            texts[name] = f"{cell!r} in line {number}"
    return DataTable(path, columns, units, texts, np.array([number for number, _ in rows]))


def _moments(cells: Sequence[str]) -> Array | None:
    """Return the seconds since the first of some dates with times; None if a cell is no such date."""
    import pandas as pd

    if not all(cell in MISSING or ":" in cell for cell in cells):
        return None
    try:
        found = pd.to_datetime(["NaT" if cell in MISSING else cell for cell in cells], format="ISO8601", utc=True)
    except ValueError:
        return None
    counts = found.as_unit("ns")
    return np.asarray((counts - counts[0]) / pd.Timedelta(1, "ns"), dtype=np.float64) * 1e-9


JOINT: Final = ("position", "velocity", "effort")
"""Arrays of ``sensor_msgs/JointState`` with one element for each name."""

DEEPEST: Final = 8  # largest depth of nested fields
LONGEST: Final = 64  # largest number of elements of an array whose elements become columns


def read_mcap(path: Path) -> DataTable:
    """Read an MCAP file.

    Each number in a message becomes a column named after topic, joint and field, such as
    ``/joint_states/axis1/position``. The time is that of the header of the message if it has one, otherwise the time of
    the log, in s since the first message of the file.
    """
    require("mcap")
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    factory = DecoderFactory()
    decoders: dict[int, Callable[[bytes], Any] | None] = {}
    rows: dict[str, list[tuple[int, dict[str, float]]]] = {}
    ignored: dict[str, str] = {}
    damaged: dict[str, str] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.id not in decoders:
                coded_as_json = channel.message_encoding == "json"
                decoders[channel.id] = (
                    json.loads if coded_as_json else factory.decoder_for(channel.message_encoding, schema)
                )
            decode = decoders[channel.id]
            if decode is None:
                ignored[channel.topic] = channel.message_encoding
                continue
            try:
                content = decode(message.data)
                values = dict(_numbers(content, channel.topic, DEEPEST))
            except Exception as error:  # a damaged message may raise any exception in the decoders
                damaged[channel.topic] = f"a damaged message ({' '.join(str(error).split()) or type(error).__name__})"
                continue
            if values:
                rows.setdefault(channel.topic, []).append((_stamp(content) or message.log_time, values))
    texts = {name: why for topic, why in damaged.items() for _, values in rows.pop(topic, ()) for name in values}
    if not rows and damaged:
        topic, why = next(iter(damaged.items()))
        raise RecordError(f"{path} has {why} in the topic {topic}; record it again.")
    if not rows:
        encodings = f" (encodings: {', '.join(sorted(set(ignored.values())))})" if ignored else ""
        raise RecordError(f"{path} has no topic with numbers that can be decoded{encodings}; record ROS 2 or JSON.")
    begin = min(stamp for messages in rows.values() for stamp, _ in messages)
    table = on_one_clock(path, [_group(messages, begin) for messages in rows.values()], "time", "s")
    return replace(table, texts=texts)


def _group(messages: list[tuple[int, dict[str, float]]], begin: int) -> ChannelGroup:
    """Return the signals of a topic at increasing times; of messages with equal times the first one counts."""
    at = dict(reversed(messages))
    stamps = sorted(at)
    names = dict.fromkeys(name for _, values in messages for name in values)
    signals = {name: np.array([at[stamp].get(name, np.nan) for stamp in stamps]) for name in names}
    return ChannelGroup(np.array([(stamp - begin) * 1e-9 for stamp in stamps]), signals)


def _numbers(content: Any, name: str, depth: int) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message by name; texts, headers and long arrays are left out, large integers missing."""
    if isinstance(content, numbers.Real):
        yield name, math.nan if isinstance(content, int) and abs(content) > EXACT else float(content)
    elif (fields := _fields(content)) is not None and depth:
        joints = fields.get("name")
        named = isinstance(joints, (list, tuple)) and all(isinstance(joint, str) for joint in joints)
        for field, value in fields.items():
            if field == "header":
                continue
            if named and field in JOINT and joints and len(value) == len(joints):
                yield from ((f"{name}/{joint}/{field}", float(each)) for joint, each in zip(joints, value, strict=True))
            else:
                yield from _numbers(value, f"{name}/{field}", depth - 1)
    elif isinstance(content, (list, tuple, np.ndarray)) and len(content) <= LONGEST and depth:
        for index, each in enumerate(content):
            yield from _numbers(each, f"{name}[{index}]", depth - 1)


def _fields(content: Any) -> Mapping[str, Any] | None:
    """Return the fields of a message by name; None if it is not a message."""
    if isinstance(content, Mapping):
        return content
    slots = getattr(content, "__slots__", None)
    return {name: getattr(content, name) for name in slots} if slots else None


def _stamp(content: Any) -> int:
    """Return the time in the header of a message [ns]; 0 if it has none."""
    header = (_fields(content) or {}).get("header")
    stamp = (_fields(header) or {}).get("stamp") if header is not None else None
    parts = _fields(stamp) or {} if stamp is not None else {}
    seconds, rest = parts.get("sec", 0), parts.get("nanosec", 0)
    return int(seconds) * 1_000_000_000 + int(rest)


def read_table(path: Path) -> DataTable:
    """Read a data file; the suffix determines the format."""
    readers: dict[str, Callable[[Path], DataTable]] = dict.fromkeys((".csv", ".tsv", ".txt", ".dat", ".asc"), read_text)
    readers |= {".mcap": read_mcap, ".parquet": _read_parquet, ".pq": _read_parquet, ".mat": _read_mat}
    suffix = path.suffix.lower()
    if suffix in (".gz", ".xz") and readers.get(Path(path.stem).suffix.lower()) is read_text:
        readers[suffix] = read_text
    if suffix not in readers:
        raise RecordError(f"The format of {path} is unknown; use a file that ends in {', '.join(readers)} or .toml.")
    if not path.is_file():
        raise RecordError(f"There is no data file {path}; correct the path.")
    try:
        return readers[suffix](path)
    except (MissingPackageError, RecordError):
        raise
    except Exception as error:  # a damaged file may raise any exception in the libraries
        reason = " ".join(str(error).split()) or type(error).__name__
        raise RecordError(f"{path} cannot be read as a {suffix} file ({reason}); export it again.") from error


def _read_parquet(path: Path) -> DataTable:
    require("pyarrow")
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        _limit(path, 8 * file.metadata.num_rows * file.metadata.num_columns)
    return from_arrow(path, pq.read_table(path))


UNPACKED: Final = 2**30  # largest size of the numbers in a file [bytes]


def _limit(path: Path, size: int) -> None:
    """Raise RecordError for contents that would fill the memory."""
    if size > UNPACKED:
        raise RecordError(
            f"{path} unpacks to more than {UNPACKED // 2**20} MiB; save only the columns that are needed, or fewer "
            "samples."
        )


HDF5: Final = b"\x89HDF\r\n\x1a\n"  # signature of HDF5, at offset 512 of a MATLAB 7.3 file or at its start


def _read_mat(path: Path) -> DataTable:
    """Read a .mat file: MATLAB up to 7.2 with scipy, MATLAB 7.3 with h5py, Dymola with the harness."""
    with path.open("rb") as file:
        header = file.read(520)
    if HDF5 in (header[:8], header[512:]):
        return DataTable(path, _same_length(path, _hdf5(path)))
    _limit(path, _unpacked(path))
    import scipy.io

    content = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)
    if "Aclass" in content:
        return _trajectory(path)
    return DataTable(path, _same_length(path, (item for key, value in content.items() for item in _flat(key, value))))


def _unpacked(path: Path) -> int:
    """Return the size of the variables of a MATLAB file, counted up to the limit; 0 before version 5."""
    total = 0
    with path.open("rb") as file:
        header = file.read(128)
        order = {b"IM": "<", b"MI": ">"}.get(header[126:128])
        while order and total <= UNPACKED and len(tag := file.read(8)) == 8:
            kind, size = struct.unpack(f"{order}II", tag)
            if kind != COMPRESSED:
                total += size
                file.seek(size, 1)
                continue
            unpacker = zlib.decompressobj()
            rest = file.read(size)
            while rest and total <= UNPACKED:
                total += len(unpacker.decompress(rest, 2**20))
                rest = unpacker.unconsumed_tail
    return total


COMPRESSED: Final = 15  # type of a compressed variable in a MATLAB file of version 5


def _trajectory(path: Path) -> DataTable:
    from harness import load_result

    result = load_result(path)
    columns = {name: result[name].to_numpy().astype(np.float64) for name in ("time", *map(str, result.data_vars))}
    return DataTable(path, columns, {name: result[name].attrs.get("units", "") for name in columns})


def _flat(name: str, value: Any) -> Iterator[tuple[str, Array]]:
    """Yield the vectors of a variable: itself, columns of a matrix ``a(:,1)``, or members of a structure ``a.b``."""
    if name.startswith("__"):
        return
    if hasattr(value, "_fieldnames"):
        for member in value._fieldnames:
            yield from _flat(f"{name}.{member}", getattr(value, member))
        return
    array = np.asarray(value)
    if array.dtype.kind not in "biuf":
        return
    if array.ndim == 1:
        yield name, array.astype(np.float64)
    elif array.ndim == 2:
        if 1 in array.shape:
            yield name, array.ravel().astype(np.float64)
            return
        for column in range(array.shape[1]):
            yield f"{name}(:,{column + 1})", array[:, column].astype(np.float64)


def _hdf5(path: Path) -> Iterator[tuple[str, Array]]:
    """Yield the vectors of an HDF5 file, each object once and nothing from other files."""
    import h5py

    seen: set[int] = set()
    total = 0

    def walk(group: Any, prefix: str) -> Iterator[tuple[str, Array]]:
        nonlocal total
        for key in group:
            if key.startswith("#"):
                continue
            if not isinstance(group.get(key, getlink=True), h5py.HardLink):
                raise RecordError(f"{path}: {prefix}{key} is a link; save the data themselves.")
            value = group[key]
            at = h5py.h5o.get_info(value.id).addr
            if at in seen:
                continue
            seen.add(at)
            if isinstance(value, h5py.Group):
                yield from walk(value, f"{prefix}{key}.")
            elif isinstance(value, h5py.Dataset) and value.dtype.kind in "biuf" and "MATLAB_empty" not in value.attrs:
                if value.is_virtual or value.external:
                    raise RecordError(f"{path}: {prefix}{key} is stored in another file; save the data themselves.")
                total += 8 * (value.size or 0)
                _limit(path, total)
                yield from _flat(prefix + key, np.asarray(value[()]).T)  # MATLAB stores columns first

    with h5py.File(path, "r") as file:
        yield from walk(file, "")


def _same_length(path: Path, vectors: Iterator[tuple[str, Array]]) -> dict[str, Array]:
    """Return the vectors with the most frequent length; others, such as scalars and settings, are ignored."""
    found = {name: values for name, values in vectors if values.size >= 3}
    if not found:
        raise RecordError(f"{path} has no numeric vectors; save time, position and force as vectors or matrices.")
    sizes = [values.size for values in found.values()]
    length = max(set(sizes), key=lambda size: (sizes.count(size), size))
    return {name: values for name, values in found.items() if values.size == length}
