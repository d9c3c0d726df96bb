"""Results as CSV."""

from __future__ import annotations

import csv
from pathlib import Path

from harness.result import Result, heading, quoted, split_heading, unquoted
from harness.results.table import from_columns
from harness.storage.atomic import atomic_path


def to_csv(result: Result, path: str | Path) -> None:
    """Write a result as CSV: ``time [s]`` and one column per variable, with all digits.

    A heading that begins with =, +, - or @ gets a leading apostrophe, so that a spreadsheet does not read it as a
    formula; `from_csv` removes it.

    Parameters
    ----------
    result : xarray.Dataset
        Result of a run.
    path : path-like
        The file; an existing file is replaced only when the new one is complete.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    names = ["time", *result.data_vars]
    columns = [result[name].to_numpy().tolist() for name in names]
    with atomic_path(Path(path)) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(quoted(heading(result, str(name))) for name in names)
        writer.writerows(
            # most readers would not take true and false for numbers
            ([int(value) if value is True or value is False else value for value in row])
            for row in zip(*columns, strict=True)
        )


def from_csv(path: Path) -> Result:
    """Read a result from CSV; a column of whole numbers without a decimal point becomes an Integer."""
    from pyarrow import csv as table_reader

    # nan is a value here; only an empty field is missing
    options = table_reader.ConvertOptions(null_values=[""])
    table = table_reader.read_csv(path, convert_options=options)
    headings = [split_heading(unquoted(text)) for text in table.column_names]
    columns = {name: table.column(index).to_numpy() for index, (name, _) in enumerate(headings)}
    return from_columns(columns, {name: {"units": unit} for name, unit in headings}, {})
