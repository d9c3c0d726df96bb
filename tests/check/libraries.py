"""The library of the FMU with one fault, compiled."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import fmpy

HERE = Path(__file__).parent
BINARY = f"binaries/{fmpy.platform}/faulty{fmpy.sharedLibraryExtension}"
Library = Callable[..., bytes]
