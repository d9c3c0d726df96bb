"""Question about the columns of a data file on a terminal, where more than one guess fits."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from friction_fmus.cli.console import console
from friction_fmus.errors import AmbiguousColumnsError
from friction_fmus.identification import DataMapping, Measurement, read_measurement


def read_asking(path: Path, mapping: DataMapping | Path | None) -> Measurement:
    """Read a data file; on a terminal, ask which guess of its columns is right if more than one fits."""
    try:
        return read_measurement(path, mapping)
    except AmbiguousColumnsError as error:
        if not (error.choices and isinstance(mapping, DataMapping) and sys.stdin.isatty() and sys.stdout.isatty()):
            raise
        console.print(f"The columns of {path} can be read in {len(error.choices)} ways:", soft_wrap=True)
        for number, (columns, reasons) in enumerate(error.choices, 1):
            console.print(f"  {number}  {columns}", soft_wrap=True)
            if reasons:
                console.print(f"       {reasons}", soft_wrap=True)
        try:
            answer = input("Which one is right? Number, or Enter for none: ").strip()
        except EOFError:
            answer = ""
        if not (answer.isdigit() and 1 <= int(answer) <= len(error.choices)):
            raise
        return read_measurement(path, replace(mapping, option=error.choices[int(answer) - 1][0]))
