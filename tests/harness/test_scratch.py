"""Temporary folders: gone when their process was killed and the next one runs, kept while their process lives."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from thorough import nightly

from harness.storage import files
from harness.storage.files import ScratchFolder

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has another kind of lock")

ROOT = Path(__file__).parents[2]
WAIT = "import sys; print('ready', flush=True); sys.stdin.read()\n"


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def started(code: str, temporary: Path) -> subprocess.Popen[str]:
    """A process that has run the code and waits."""
    process = subprocess.Popen(
        [sys.executable, "-c", code + WAIT],
        env=os.environ | {"TMPDIR": str(temporary), "PYTHONPATH": str(ROOT)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


def kill(process: subprocess.Popen[str]) -> None:
    process.send_signal(signal.SIGKILL)
    process.wait()
    for pipe in (process.stdin, process.stdout):
        assert pipe is not None
        pipe.close()


def next_run() -> None:
    """What the first folder of another process does."""
    files._remove_leftovers.cache_clear()
    ScratchFolder().cleanup()


HERE = "from harness.storage.files import ScratchFolder\nfolder = ScratchFolder()\nopen(folder.name + '/x', 'w')\n"


def test_the_folder_of_a_killed_process_goes_and_that_of_a_living_one_stays(temporary: Path) -> None:
    killed, living = started(HERE, temporary), started(HERE, temporary)
    assert len(list(temporary.iterdir())) == 2
    kill(killed)
    next_run()
    (left,) = temporary.iterdir()
    assert (left / "x").exists()
    living.communicate("")
    assert list(temporary.iterdir()) == []


@nightly
def test_what_a_run_of_an_fmu_leaves(temporary: Path, probe: Path) -> None:
    """One folder for each FMU."""
    code = (
        "from harness import FmuPart, System\n"
        f"parts = [FmuPart(name, {str(probe)!r}) for name in 'ab']\n"
        "start = {f'{part}.{name}': value for part in 'ab' for name, value in (('u', 1.0), ('n', 1), ('b', True))}\n"
        "system = System(parts, start=start)\nsystem.run(stop=1.0, step=0.1)\n"
    )
    process = started(code, temporary)
    assert len(list(temporary.iterdir())) == 2
    kill(process)
    assert len(list(temporary.iterdir())) == 2
    next_run()
    assert list(temporary.iterdir()) == []


def test_folders_of_others_stay(temporary: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of another user, of another program, without a lock, and what a link points to."""
    kill(started(HERE, temporary))
    (mine,) = temporary.iterdir()
    (temporary / "harness-of-someone").mkdir()
    (temporary / "harness-of-someone" / "x").touch()
    (temporary / "other-program").mkdir()
    mine.rename(tmp_path / "elsewhere")
    (temporary / "harness-link").symlink_to(tmp_path / "elsewhere")
    next_run()
    assert sorted(path.name for path in temporary.iterdir()) == ["harness-link", "harness-of-someone", "other-program"]
    assert (tmp_path / "elsewhere" / "x").exists()
    (tmp_path / "elsewhere").rename(temporary / "harness-mine")
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    next_run()
    assert (temporary / "harness-mine" / "x").exists()
    monkeypatch.undo()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    next_run()
    assert not (temporary / "harness-mine").exists()


def test_a_compilation_that_is_killed_leaves_nothing(temporary: Path, tmp_path: Path) -> None:
    """Neither in the temporary folder, once another process has made one, nor in the cache."""
    compiler = tmp_path / "cc"  # stays in the compilation
    started_compiling = tmp_path / "started"  # then no process has the lock of another
    script = f'case "$*" in *--version*) echo 1;; *) touch "{started_compiling}"; sleep 60;; esac'
    compiler.write_text(f"#!/bin/sh\n{script}\n")
    compiler.chmod(0o755)
    code = "from harness.compiling.platforms import native_library\nnative_library({'a.c': 'int a;'}, 'a')\n"
    cache = tmp_path / "cache"
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        env=os.environ
        | {"TMPDIR": str(temporary), "PYTHONPATH": str(ROOT), "CC": str(compiler), "FRICTION_FMUS_CACHE": str(cache)},
        text=True,
        start_new_session=True,
    )
    for _ in range(600):
        if started_compiling.exists():
            break
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert len([*temporary.glob("harness-*")]) == 1
    files._remove_leftovers.cache_clear()
    with ScratchFolder():
        pass
    assert [*temporary.iterdir()] == []
    assert [path for path in cache.rglob("*") if path.is_file() or path.name.startswith("compile-")] == []


def test_without_a_home_the_cache_is_named(temporary: Path) -> None:
    """Zig then says that it knows no folder for its own cache, which is no reason to install another compiler."""
    code = (
        "from harness.compiling.toolchain import identity\nfrom harness.errors import BuildError\n"
        "try:\n    identity()\n    print('it runs')\nexcept BuildError as error:\n    print(error)\n"
    )
    hidden = ("HOME", "CC", "FRICTION_FMUS_CACHE", "XDG_CACHE_HOME", "ZIG_GLOBAL_CACHE_DIR")
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    environment |= {"HOME": "/dev/null/none", "PYTHONPATH": str(ROOT), "TMPDIR": str(temporary)}
    run = [sys.executable, "-c", code]
    found = subprocess.run(run, env=environment, capture_output=True, text=True, check=True).stdout
    assert found.startswith("the folder /dev/null/none/.cache/friction-fmus for compiled files cannot be made")
    assert "set the environment variable FRICTION_FMUS_CACHE to a writable folder" in found
    environment |= {"FRICTION_FMUS_CACHE": str(temporary / "cache")}
    assert subprocess.run(run, env=environment, capture_output=True, text=True, check=True).stdout == "it runs\n"
