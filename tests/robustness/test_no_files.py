"""Devices, pipes, folders and endless archives in the place of every kind of input file: one sentence at once."""

from __future__ import annotations

import gzip
import os
from pathlib import Path

import pytest
from robustness.cases import ROOT, run_cases
from thorough import nightly

from friction_fmus import BuildError, build
from friction_fmus.errors import RecordError
from friction_fmus.identification.data import text_file
from friction_fmus.identification.data.formats import read_table

FILES: dict[str, list[str]] = {
    "run {}.toml -o out.csv": ["toml"],
    "run {}.ssp -o out.csv": ["ssp"],
    "sweep {}.ssp --vary=a.b=1 -o out": ["ssp"],
    "study {}.toml -o out": ["toml"],
    "identify {}.toml --model LuGre -o out": ["toml"],
    "identify {}.csv --model LuGre -o out": ["csv"],
    "identify {}.txt.gz --model LuGre -o out": ["txt.gz"],
    "identify {}.mat --model LuGre -o out": ["mat"],
    "identify {}.parquet --model LuGre -o out": ["parquet"],
    "run system.toml --parameters {}.ssv -o out.csv": ["ssv"],
    "run system.toml --resume {}.state -o out.csv": ["state"],
    "sweep system.toml --samples {}.csv -o out": ["csv"],
    "show {}.c": ["c"],
    "codegen {}.py -o out": ["py"],
    "run {}-record.toml -o out.csv": ["csv"],
    "run {}-fmu.toml -o out.csv": ["fmu"],
}
SYSTEM = 'wires = []\nexperiment = { stop = 1.0, step = 0.5 }\nparts.r = { record = "right.csv" }\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where commands run: a system that is right, and systems with parts that are no files."""
    (tmp_path / "right.csv").write_text("time [s],F\n0,1\n1,2\n")
    (tmp_path / "system.toml").write_text(SYSTEM)
    for kind in ("device", "pipe", "folder"):
        (tmp_path / f"{kind}-record.toml").write_text(SYSTEM.replace("right.csv", f"{kind}.csv"))
        (tmp_path / f"{kind}-fmu.toml").write_text(SYSTEM.replace('record = "right.csv"', f'fmu = "{kind}.fmu"'))
    return tmp_path


@nightly
def test_devices_pipes_and_folders(folder: Path) -> None:
    for suffix in {suffix for suffixes in FILES.values() for suffix in suffixes}:
        (folder / f"device.{suffix}").symlink_to("/dev/zero")
        os.mkfifo(folder / f"pipe.{suffix}")
        (folder / f"folder.{suffix}").mkdir()
    commands = [text.format(kind) for text in FILES for kind in ("device", "pipe", "folder")]
    counts = run_cases(folder, [(command, "unused", "", command.split()) for command in commands])
    assert counts == {"runs": 0, "sentences": len(commands), "bad": 0}


@nightly
def test_large_files_and_texts_that_are_none(folder: Path) -> None:
    commands = []
    for name in ("large.toml", "large.c", "large.py"):
        with (folder / name).open("wb") as file:
            file.truncate(1 << 23)
    for suffix, content in (("c", b"\xff\xfe#define MODEL A"), ("c", b"int x;"), ("py", b"\0\0"), ("py", b"x = (")):
        name = f"none{len(commands)}.{suffix}"
        (folder / name).write_bytes(content)
        commands.append(f"show {name}")
    commands += ["run large.toml -o out.csv", "study large.toml -o out", "identify large.toml --model LuGre -o out"]
    commands += ["show large.c", "show large.py"]
    counts = run_cases(folder, [(command, "unused", "", command.split()) for command in commands])
    assert counts == {"runs": 0, "sentences": len(commands), "bad": 0}


def test_a_text_that_unpacks_to_too_much(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_file, "LARGEST_DATA", 1 << 20)
    with gzip.open(tmp_path / "large.txt.gz", "wb") as file:
        file.write(bytes((1 << 20) + 1))
    with pytest.raises(RecordError, match=r"large\.txt\.gz has more than 1048576 bytes of text"):
        read_table(tmp_path / "large.txt.gz")


def test_a_header_that_is_no_text(tmp_path: Path) -> None:
    source = (ROOT / "fmu_src" / "friction" / "Coulomb.c").read_text(encoding="utf-8")
    (tmp_path / "mine.c").write_text(source.replace('#include "block.h"', '#include "mine.h"\n#include "block.h"'))
    (tmp_path / "mine.h").write_bytes(b"\xff\xfe\xff")
    with pytest.raises(BuildError, match=r"mine\.h cannot be read as C .*; give a text in UTF-8"):
        build(tmp_path / "mine.c", tmp_path / "out")
