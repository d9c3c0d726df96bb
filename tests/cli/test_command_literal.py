"""Paths and names are printed as they are: rich takes ``[/b]`` for markup and ``:bug:`` for a picture."""

from __future__ import annotations

import ast
import io
import re
from pathlib import Path

import pytest
from rich.text import Text
from thorough import nightly

from friction_fmus.cli.console import RunBar, console, literal_console, progress_bar, styled
from friction_fmus.cli.main import main

ROOT = Path(__file__).parents[2]
STICK_SLIP = ROOT / "examples" / "stick_slip.toml"
NAMES = ("o[/b].csv", "o[red].csv", "o[x] :bug:.csv", "100 %(s) {y}.csv")
SYSTEM = """[experiment]
stop = 1.0
step = 0.1

[parts.contact]
model = "Viscous"
start = { v = 1.0 }
"""
SOURCES = sorted(path for folder in ("friction_fmus", "harness") for path in (ROOT / folder).rglob("*.py"))
SPEAKING = [path for path in SOURCES if re.search("rich|markup|emoji|Console|TextColumn", path.read_text("utf-8"))]


def printed(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert main([str(argument) for argument in arguments]) in (0, 1)
    return capsys.readouterr().out


@pytest.mark.parametrize("name", NAMES)
def test_the_path_of_a_result(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = printed(capsys, "run", STICK_SLIP, "--stop", "0.01", "-o", tmp_path / name)
    assert out.startswith(f"wrote {tmp_path / name}: ")
    assert (tmp_path / name).is_file()


@nightly
@pytest.mark.parametrize("folder", ["a[/b]", "[x]"])
def test_the_paths_that_other_commands_print(folder: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    here = tmp_path / folder
    assert f"{here / 'Viscous.fmu'}\n" in printed(capsys, "build", "Viscous", "-o", here)
    assert f"{here / 'Viscous.fmu'}: " in printed(capsys, "check", "--static", here / "Viscous.fmu")
    assert f"{here / 'coulomb_feedforward.c'}\n" in printed(capsys, "codegen", "CoulombFeedforward", "-o", here)
    system = here / "system.toml"
    system.write_text(SYSTEM, encoding="utf-8")
    out = printed(capsys, "sweep", system, "--vary", "contact.v=1,2", "--executor", "serial", "-o", here / "sweep")
    assert out.splitlines()[-1] == f"{here / 'sweep'}: 2 runs"


def test_the_name_of_a_system_on_the_progress_bar() -> None:
    with progress_bar() as bar:
        RunBar(bar, "[/b] :bug:")
        column = bar.columns[0].render(bar.tasks[0])
    assert isinstance(column, Text)
    assert column.plain == "[/b] :bug:"


def test_styled_text_is_literal() -> None:
    out = io.StringIO()
    literal_console(file=out).print(styled(("[/b]", "bold"), " :bug: [x]"))
    assert out.getvalue() == "[/b] :bug: [x]\n"
    assert console.render_str("[/b] :bug:").plain == "[/b] :bug:"


def calls(tree: ast.AST) -> list[tuple[str, set[str], int]]:
    """Name, keyword arguments and line of every call."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            found.append((name, {keyword.arg or "" for keyword in node.keywords}, node.lineno))
    return found


@pytest.mark.parametrize("path", SPEAKING, ids=lambda path: str(path.relative_to(ROOT)))
def test_nothing_is_printed_with_markup(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    imported = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert "rich.markup" not in imported
    assert "rich" not in {module for module in imported if module == "rich"}  # its print() reads markup
    for name, keywords, line in calls(tree):
        where = f"{path}:{line}"
        assert name not in ("from_markup", "render_markup"), where
        assert name != "Console" or path.name == "console.py", f"{where}: use literal_console"
        assert name != "TextColumn" or "markup" in keywords, f"{where}: TextColumn reads markup unless told not to"
        assert name != "print" or not keywords & {"markup", "emoji"}, where
