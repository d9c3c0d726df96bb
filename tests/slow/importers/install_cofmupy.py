"""Make the environment in which `test_cofmupy.py` runs CoFmuPy, which pins an old fmpy: in the cache, once."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from harness.compiling.toolchain import cache_folder

VERSION = "1.0.0"
HOME = cache_folder() / f"cofmupy-{VERSION}-python{sys.version_info.major}.{sys.version_info.minor}"
PYTHON = HOME / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def install() -> None:
    """Install CoFmuPy, complete or not at all."""
    HOME.parent.mkdir(parents=True, exist_ok=True)
    made = Path(tempfile.mkdtemp(dir=HOME.parent))
    subprocess.run([sys.executable, "-m", "venv", str(made)], check=True)
    python = made / PYTHON.relative_to(HOME)
    subprocess.run([str(python), "-m", "pip", "install", "-q", f"cofmupy=={VERSION}"], check=True)
    made.rename(HOME)


if __name__ == "__main__" and not PYTHON.exists():
    install()
