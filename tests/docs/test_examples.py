"""The scripts in examples/ hold, and the pages of docs/ show what they print and draw."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

ROOT = Path(__file__).parents[2]
FILES = {"models": "claims.md", "compensation": "effects.md"}
SCRIPTS = {
    folder: sorted(p.stem for p in (ROOT / "examples" / folder).glob("*.py") if p.stem[0] != "_") for folder in FILES
}
REMEDY = "run `python examples/page.py docs`"


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "examples")
    import page

    return page


FIGURES = "run `python benchmarks/effects.py --page docs/compensation.md`"


def check_figures(name: str, checks: tuple[Any, ...]) -> None:
    """Each is in the table of docs/compensation.md, with its bounds; numbers may differ a little elsewhere."""
    text = (ROOT / "docs" / "compensation.md").read_text(encoding="utf-8")
    (heading,) = re.findall(r'^"""(.+)$', (ROOT / "examples" / "compensation" / f"{name}.py").read_text("utf-8"), re.M)[
        :1
    ]
    part = text.split(f"## [{heading}](effects.md#")[1].split("\n## ")[0]
    shown = {row[0]: row[1:] for row in re.findall(r"^\| (.*?) \| (\S+).*? \| (.*?) \| (.*?) \|$", part, re.M)}
    assert len({check.name for check in checks}) == len(checks) > 0
    for check in checks:
        value, bounds, mark = shown[check.name]
        assert (bounds, mark) == (check.bounds, ""), FIGURES
        assert float(value) == pytest.approx(check.value, rel=0.02, abs=1e-5), FIGURES


TILE, LOOKS_ALIKE = 16, 12
"""Side of the tiles by which figures are compared [pixels], and their largest difference in colour, of 255."""


def difference(a: Image.Image, b: Image.Image) -> int:
    """Largest difference in colour of any tile; letters that another library draws alike hardly count."""
    size = (a.width // TILE, a.height // TILE)
    tiles = [np.asarray(each.convert("RGB").resize(size, Image.Resampling.BOX), dtype=np.int64) for each in (a, b)]
    return int(np.abs(tiles[0] - tiles[1]).max())


def test_a_line_that_has_moved_makes_another_figure() -> None:
    white = Image.new("RGB", (320, 160), "white")
    line, moved = white.copy(), white.copy()
    ImageDraw.Draw(line).line((0, 40, 320, 40), fill="#0072B2", width=2)
    ImageDraw.Draw(moved).line((0, 60, 320, 60), fill="#0072B2", width=2)
    assert difference(line, line.quantize(64)) <= 2
    assert difference(line, moved) > LOOKS_ALIKE


@pytest.mark.parametrize(("folder", "name"), [(folder, name) for folder in FILES for name in SCRIPTS[folder]])
def test_claim_holds_and_the_page_shows_it(
    folder: str,
    name: str,
    page: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Runs the command of the page, in this process."""
    monkeypatch.syspath_prepend(ROOT / "examples" / folder)
    text = (ROOT / "docs" / FILES[folder]).read_text(encoding="utf-8")
    (figures,) = re.findall(rf"^python examples/{folder}/{name}\.py (\S+)$", text, re.M)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [f"{name}.py", figures])
    if folder == "compensation":
        import _effect

        def confirm(self: _effect.Effect, confirmed: Callable[[_effect.Effect], None] = _effect.Effect.confirm) -> None:
            confirmed(self)
            check_figures(name, self.checks)

        monkeypatch.setattr(_effect.Effect, "confirm", confirm)
    runpy.run_path(str(ROOT / "examples" / folder / f"{name}.py"), run_name="__main__")
    numbers = capsys.readouterr().out.strip()
    assert "\n" not in numbers
    assert page.section(folder, name, numbers) in text, REMEDY
    shown = ROOT / "docs" / "figures" / f"{name}.png"
    with Image.open(tmp_path / figures / f"{name}.png") as drawn, Image.open(shown) as kept:
        assert drawn.size == kept.size, REMEDY
        assert difference(drawn, kept) < LOOKS_ALIKE, REMEDY
    assert shown.stat().st_size < 60_000


@pytest.mark.parametrize("folder", FILES)
def test_page_has_these_scripts_and_no_others(folder: str, page: ModuleType) -> None:
    text = (ROOT / "docs" / FILES[folder]).read_text(encoding="utf-8")
    assert list(page.scripts(folder)) == SCRIPTS[folder]
    assert re.findall(rf"^python examples/{folder}/(\w+)\.py", text, re.M) == SCRIPTS[folder], REMEDY
    assert re.findall(r"\(figures/(\w+)\.png\)", text) == SCRIPTS[folder], REMEDY
    assert text.startswith(page.PAGES[folder].introduction), REMEDY


def test_every_page_and_figure_belongs_to_a_script(page: ModuleType) -> None:
    assert {folder: made.file for folder, made in page.PAGES.items()} == FILES
    shown = sorted(path.stem for path in (ROOT / "docs" / "figures").glob("*"))
    pages = "".join(path.read_text("utf-8") for path in (ROOT / "docs").glob("*.md"))
    assert shown == sorted(set(re.findall(r"\]\(figures/(\w+)\.\w+\)", pages)))
    assert set(shown) >= {name for names in SCRIPTS.values() for name in names}


def test_benchmark_of_the_effects_prints_figures_and_writes_a_page(tmp_path: Path) -> None:
    command = [sys.executable, "benchmarks/effects.py", "hunting", "--short", "--page", str(tmp_path / "page.md")]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert "from slip to slip" in run.stdout
    kept = (ROOT / "docs" / "compensation.md").read_text(encoding="utf-8")
    written = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert kept.startswith(written.split("## ")[0]), FIGURES
    assert written.split("\n\n| | value")[0].split("## ")[1] in kept, FIGURES


def test_benchmark_of_the_effects_refuses_an_unknown_name() -> None:
    command = [sys.executable, "benchmarks/effects.py", "hunting_high"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 2 and "there is no hunting_high.py in examples/compensation" in run.stderr


def test_every_effect_is_in_the_table_of_figures(page: ModuleType) -> None:
    text = (ROOT / "docs" / "compensation.md").read_text(encoding="utf-8")
    assert text.count("\n## [") == len(page.scripts("compensation")), FIGURES
