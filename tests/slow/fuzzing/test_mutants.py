"""A short form of the campaign of mutants; `tests/nightly.sh` has the long one."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from random import Random

import pytest
from thorough import some

if not hasattr(os, "fork") or not Path("/proc/self/stat").is_file():
    pytest.skip("mutants are tried in forked processes that are watched in /proc", allow_module_level=True)

from robustness.mutate import BYTES, TEXT, damaged, damaged_archive, members, odd_values, zipped

FOLDER = Path(__file__).parent


SOME_KINDS = ("check-static", "run-toml")


def test_no_mutant_gives_a_traceback_a_hang_or_a_crash(tmp_path: Path) -> None:
    """One of each of these kinds, always the same one; of each kind every night."""
    command = [
        sys.executable,
        str(FOLDER / "mutants.py"),
        "1",
        *some((), SOME_KINDS),
        "--keep",
        str(tmp_path / "mutants"),
    ]
    environment = os.environ | {"PYTHONPATH": str(FOLDER.parents[2])}
    run = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout[-5000:] + run.stderr[-2000:]


@pytest.mark.parametrize("ways", [BYTES, TEXT])
def test_a_number_gives_the_same_mutant_again(ways: tuple[object, ...]) -> None:
    content = b"a = 1\nb = 2.5\nc = 'x'\n" * 20
    made = [[damaged(content, Random(f"kind {n}"), ways) for n in range(50)] for _ in range(2)]  # type: ignore[arg-type]
    assert made[0] == made[1]
    assert sum(mutant != content for mutant in made[0]) > 45


def test_members_are_damaged_behind_a_right_checksum() -> None:
    archive = zipped({"a.xml": b"<a b='1'/>" * 30, "b.bin": bytes(range(256))})
    inside = 0
    for n in range(200):
        try:
            found = members(damaged_archive(archive, Random(n), r"\.xml$"))
        except Exception:
            continue
        inside += found.get("a.xml") not in (None, b"", b"<a b='1'/>" * 30) and found.get("b.bin") == bytes(range(256))
    assert inside > 80


def test_odd_values_reach_every_value_of_a_file() -> None:
    text = b'[a]\nx = 1\ny = "text"\nz = [0.0, 1.0]\nu = { v = true }\n'
    changed = {
        line.split(b" = ")[0]
        for n in range(500)
        for line, now in zip(text.splitlines(), odd_values(text, Random(n)).splitlines(), strict=False)
        if line != now
    }
    assert changed == {b"x", b"y", b"z", b"u"}
