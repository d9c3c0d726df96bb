"""Structured Text for a programmable logic controller."""

from pathlib import Path
from typing import Any

from friction_fmus.export.targets import Target
from friction_fmus.export.targets.c import REAL


def write(model: str | Path, folder: Path, **options: Any) -> tuple[Path, ...]:
    """Write the files and return their paths."""
    from friction_fmus.codegen.function_block import function_block, plcopen
    from friction_fmus.codegen.law_export import make_export, write_texts

    block = function_block(make_export(model, **options))
    return write_texts({f"{block.prefix}.st": block.text, f"{block.prefix}.xml": plcopen(block.text)}, folder)


TARGET = Target("IEC 61131-3 Structured Text, and PLCopen XML, for a controller (PLC)", "law", write, options=(REAL,))
