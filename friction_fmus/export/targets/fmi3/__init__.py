"""FMI 3.0, made from FMI 2.0 with its sources; the numbers are the same."""

from pathlib import Path

from friction_fmus.export.targets import Option, SourceFmu, Target, write_file


def write(source: SourceFmu, path: Path, *, clocks: bool = False, arrays: bool = False) -> None:
    """Write the FMU with libraries for the platforms."""
    from friction_fmus.export.targets.fmi3.fmi3_archive import fmi_3

    write_file(fmi_3(source, clocks=clocks, arrays=arrays), path)


CLOCKS = Option("clocks", "FMI 3.0: sampled blocks have a clock")
ARRAYS = Option("arrays", "FMI 3.0: vectors are arrays")
TARGET = Target("an FMI 3.0 FMU", "fmu", write, ".fmu", (CLOCKS, ARRAYS))
