"""Texts from files do not command the terminal, and do not become entries of files that are written."""

from __future__ import annotations

import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from thorough import landing

from friction_fmus.cli.main import main
from friction_fmus.errors import visible
from friction_fmus.identification import RecordError
from friction_fmus.identification.data.mapping import load_mapping

TITLE = "\x1b]0;owned\x07"
"""It sets the title of a terminal."""


def test_visible_text_has_no_commands() -> None:
    assert visible("a\x1b[2J\r\x9bm\u202e\x00µ\n\t–") == "a\\x1b[2J\\r\\x9bm\\u202e\\x00µ\n\t–"


def test_check_shows_the_names_of_members_with_escapes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "x.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(f"../{TITLE}.txt", "")
    assert main(["check", str(path), "--static"]) == 1
    shown = capsys.readouterr().out
    assert "path-outside" in shown
    assert "\\x1b]0;owned\\x07" in shown
    assert "\x1b" not in shown
    assert main(["check", str(path), "--static", "-o", str(tmp_path / "report.txt")]) == 1
    assert "\x1b" not in (tmp_path / "report.txt").read_text()


@landing
def test_errors_and_log_messages_show_escapes(tmp_path: Path) -> None:
    """In a new process, as pytest replaces the handlers of messages."""
    program = (
        "import logging, sys; from friction_fmus.cli.main import main; status = main(sys.argv[1:]);"
        f"logging.getLogger('harness.part').warning({TITLE!r}); sys.exit(status)"
    )
    command = [sys.executable, "-c", program, "identify", f"{TITLE}.csv", "-o", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "\x1b" not in done.stderr
    assert done.stderr.count("\\x07") >= 2
    assert done.stderr.splitlines()[-1] == "harness.part: \\x1b]0;owned\\x07"


@pytest.mark.parametrize("heading", ['x\n[servo]\nlaw = "PID"\n#', "a\x7fb", "\x00", TITLE, "<b>'\"\\u0041"])
def test_a_heading_is_no_entry_of_the_settings(tmp_path: Path, heading: str) -> None:
    t = np.linspace(0.0, 2.0, 2001)
    columns = {"time [s]": t, "position [mm]": np.sin(9.0 * t), f"force [{heading}]": np.cos(9.0 * t), heading: t}
    table = pa.table(columns)
    parquet.write_table(table, tmp_path / "log.parquet")
    assert main(["study", str(tmp_path / "log.parquet"), "-o", str(tmp_path / "out"), "--init"]) == 0
    written = tomllib.loads((tmp_path / "out" / "study.toml").read_text(encoding="utf-8"))
    assert list(written) == ["data", "columns", "identify"]
    assert written["columns"]["position"]["column"] == "position [mm]"


def test_the_name_of_a_record_is_one_line(tmp_path: Path) -> None:
    text = '[data]\nfile = "x.csv"\nname = "{}"\n[columns]\ntime = "t [s]"\nposition = "x [m]"\n'
    path = tmp_path / "axis.toml"
    path.write_text(text.format("axis\\n[servo]"), encoding="utf-8")
    assert load_mapping(path).name == "axis [servo]"
    path.write_text(text.format("axis\\u001b[2J"), encoding="utf-8")
    with pytest.raises(RecordError, match="without control characters"):
        load_mapping(path)
