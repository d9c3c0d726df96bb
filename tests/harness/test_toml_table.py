"""Tables of TOML files: what is wrong, where, and what to give."""

from __future__ import annotations

import re
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from harness.errors import SystemFileError
from harness.storage.toml_file import TomlTable, read_table
from harness.values import finite, flag, text

SERVO = TomlTable({"Ts": 1e-3, "law": "PID", "enable": 1}, "[servo] in axis.toml", SystemFileError)


def refused(message: str) -> AbstractContextManager[object]:
    return pytest.raises(SystemFileError, match=re.escape(f"[servo] in axis.toml {message}"))


def test_entries_are_read_once_they_are_right() -> None:
    assert SERVO.take("Ts", finite, "a number") == 1e-3
    assert SERVO.take("window", finite, "a number", 2.0) == 2.0
    assert SERVO.choice("law", ("PID", "P")) == "PID"
    assert [*SERVO] == ["Ts", "law", "enable"] and "Ts" in SERVO and "ts" not in SERVO


def test_errors_name_place_key_and_remedy() -> None:
    with refused("has the unknown key 'law'; did you mean 'lag'?"):
        SERVO.known(("Ts", "lag", "enable"))
    with refused("has the unknown key 'Ts'; known are enable, law"):
        SERVO.known(("law", "enable"))
    with refused("has enable = 1; give true or false"):
        SERVO.take("enable", flag, "true or false")
    with refused("has Ts = 0.001; give a text"):
        SERVO.take("Ts", text, "a text")
    with refused("has no Kp; add it"):
        SERVO.take("Kp", finite, "a number")
    with refused("has law = 'PID'; give one of PI, P (did you mean 'PI'?)"):
        SERVO.choice("law", ("PI", "P"))
    with refused("is 3, not a table; make it a table"):
        TomlTable(3, SERVO.where, SERVO.error)  # type: ignore[arg-type]


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(SystemFileError, match=r"none.toml cannot be read .*; give the path"):
        read_table(tmp_path / "none.toml", SystemFileError)
    (tmp_path / "broken.toml").write_text("[servo\n", encoding="utf-8")
    with pytest.raises(SystemFileError, match=r"broken.toml cannot be read as TOML .*; correct it"):
        read_table(tmp_path / "broken.toml", SystemFileError)
