"""Measurement files of LabVIEW (.lvm): segments with their own header, times in columns or as a step."""

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from friction_fmus.identification.data.formats import text
from friction_fmus.identification.data.heading_rows import is_unit
from friction_fmus.identification.data.tables import DataTable
from friction_fmus.identification.data.text_file import any_numbers

SUFFIXES: Final = (".lvm",)

HEADER: Final = (
    *("***End_of_Header***", "Channels", "Samples", "Date", "Time", "Y_Unit_Label", "Y_Dimension", "X_Dimension"),
    *("X0", "Delta_X", "Test_Name", "Test_Numbers", "UUT_Name", "UUT_Number", "UUT_M/N", "Model_Number", "Notes"),
)
"""Keys of the headers of segments, which stand between the rows of one table."""


def recognises(head: str) -> bool:
    """Return whether a text is a measurement file of LabVIEW."""
    return head.lstrip().startswith("LabVIEW Measurement")


def read(path: Path) -> DataTable:
    """Read the rows of all segments, whose times continue if the file has no column of them."""
    table = text.read(path, HEADER)
    about = table.preamble
    names = [name for name in (*table.columns, *table.texts) if name.startswith("X_Value")]
    times = {name: table.columns[name] for name in names if name in table.columns}
    signals = {name: values for name, values in table.columns.items() if name not in names and name != "Comment"}
    delta = about.get("Delta_X", "").partition(";")[0]
    step = any_numbers([delta], comma="," in delta)
    if signals and not any(np.isfinite(values).any() for values in times.values()) and step is not None:
        count = len(next(iter(signals.values())))
        times = {"X_Value": float(step[0][0]) * np.arange(count, dtype=np.float64)}
        table = replace(table, columns={**times, **signals}, texts={})
    labels = about.get("Y_Unit_Label", "").split("; ")
    units = dict(zip(signals, labels, strict=True)) if len(labels) == len(signals) else {}
    units = {name: unit for name, unit in units.items() if is_unit(unit)}
    if about.get("X_Dimension", "Time").startswith("Time"):
        units |= dict.fromkeys(times, "s")
    return replace(table, units={**table.units, **units}, format=f"LabVIEW, {table.format}")
