"""JSON: a list of records, columns by name, either of them nested in an object, and one record per line."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.column_builder import made_table, object_columns
from friction_fmus.identification.data.heading_rows import named_columns, stated_period
from friction_fmus.identification.data.tables import DataTable, limit_size
from friction_fmus.identification.data.text_file import whole_text

SUFFIXES: Final = (".json", ".jsonl", ".ndjson")

LARGEST: Final = 1 << 27  # largest size of the text, whose objects need up to 30 times as much memory [bytes]
DEEPEST: Final = 4  # largest depth of nested objects


def recognises(head: str) -> bool:
    """Return whether a text starts as JSON does."""
    text = head.lstrip()
    return text.startswith(("{", "[")) and '"' in text[:200] and ":" in text[:2000]


def read(path: Path) -> DataTable:
    """Read a JSON file, or one with a record per line."""
    text = whole_text(path, LARGEST)
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        content = _by_line(path, text, error)
    found = _table(content, DEEPEST)
    if found is None:
        raise RecordError(f"{path} has neither a list of records nor lists of numbers; save one of them.")
    columns, beside = found
    counts = [len(values) for values in columns.values()]
    length = max(set(counts), key=lambda count: (counts.count(count), count))
    columns = {name: values for name, values in columns.items() if len(values) == length}
    limit_size(path, 8 * length * len(columns))
    keys = {key: str(value)[:200] for key, value in beside.items() if isinstance(value, (str, int, float))}
    heading = named_columns(list(columns), [""] * len(columns), True, keys, stated_period(keys))
    builders = object_columns(heading.names, columns.values())
    return made_table(path, builders, heading, None, (), f"{length} rows, JSON")


def _by_line(path: Path, text: str, error: json.JSONDecodeError) -> list[Any]:
    lines = [(n, line) for n, line in enumerate(text.splitlines(), start=1) if line.strip()]
    records = []
    for number, line in lines:
        try:
            records.append(json.loads(line))
        except json.JSONDecodeError:
            if number == lines[-1][0] and len(records) > 1:
                break  # the log was cut off
            raise RecordError(
                f"{path} is not JSON ({error.msg} in line {error.lineno}, column {error.colno}); export it again."
            ) from error
    return records


def _table(content: Any, depth: int) -> tuple[dict[str, Sequence[Any]], Mapping[str, Any]] | None:
    """Return the columns with the most cells in an object and what stands beside them."""
    if isinstance(content, list) and len(content) >= 3:
        if all(isinstance(record, dict) for record in content):
            return _of_records([dict(_flat(record, "", DEEPEST)) for record in content]), {}
        rows = [row for row in content if isinstance(row, list)]
        if len(rows) == len(content) and len({len(row) for row in rows}) == 1 and rows[0]:
            names = rows[0] if all(isinstance(cell, str) for cell in rows[0]) else None
            body = rows[1:] if names else rows
            return {
                (names[i] if names else f"column {i + 1}"): [row[i] for row in body] for i in range(len(rows[0]))
            }, {}
    if not isinstance(content, dict) or not depth:
        return None
    columns: dict[str, Sequence[Any]] = {}
    for name, value in content.items():
        columns.update(_vectors(name, value))
    found = [(columns, content)] if len(columns) > 1 else []
    for name, value in content.items():
        if (inside := _table(value, depth - 1)) is not None:
            found.append((inside[0], {**content, **inside[1]}))
            if isinstance(value, dict):
                columns.update({f"{name}.{key}": cells for key, cells in inside[0].items()})
    if not found:
        return None
    if len(columns) > len(found[0][0]):
        found.append((columns, content))
    return max(found, key=lambda each: (max(map(len, each[0].values())), len(each[0])))


def _vectors(name: str, value: Any) -> Iterator[tuple[str, Sequence[Any]]]:
    """Yield a list of numbers or texts, or the columns of a list of lists."""
    if not isinstance(value, list) or len(value) < 3 or any(isinstance(cell, dict) for cell in value):
        return
    if not any(isinstance(cell, list) for cell in value):
        yield name, value
    elif all(isinstance(cell, list) for cell in value) and len({len(cell) for cell in value}) == 1:
        for i in range(min(len(value[0]), 64)):
            yield f"{name}[{i}]", [row[i] for row in value]


def _flat(record: Any, name: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Yield the cells of a record, those of objects and lists in it as well."""
    if isinstance(record, dict) and depth:
        for key, value in record.items():
            yield from _flat(value, f"{name}.{key}" if name else key, depth - 1)
    elif isinstance(record, list) and depth:
        for i, value in enumerate(record[:64]):
            yield from _flat(value, f"{name}[{i}]", depth - 1)
    else:
        yield name, record


def _of_records(records: Sequence[Mapping[str, Any]]) -> dict[str, Sequence[Any]]:
    names = dict.fromkeys(name for record in records for name in record)
    if len(names) > 2000:
        raise ValueError("its records have more than 2000 different names")
    return {name: [record.get(name) for record in records] for name in names}
