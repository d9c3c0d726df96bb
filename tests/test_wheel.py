"""The wheel as pip builds it."""

from __future__ import annotations

import ctypes
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_wheel_carries_the_compiled_engine(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", str(tmp_path), str(ROOT)]
    subprocess.run(command, check=True, timeout=300)
    (wheel,) = tmp_path.glob("friction_fmus-*-py3-none-*.whl")
    assert "any" not in wheel.name
    with zipfile.ZipFile(wheel) as archive:
        (engine,) = (
            name for name in archive.namelist() if name in ("harness/engine/engine.so", "harness/engine/engine.dll")
        )
        archive.extract(engine, tmp_path)
    assert ctypes.CDLL(str(tmp_path / engine)).engine_run
