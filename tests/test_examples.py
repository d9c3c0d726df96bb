"""The scripts in examples/ hold, and the pages of docs/ show what they print and draw."""

from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path
from types import ModuleType

import pytest
from PIL import Image

ROOT = Path(__file__).parent.parent
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
    runpy.run_path(str(ROOT / "examples" / folder / f"{name}.py"), run_name="__main__")
    numbers = capsys.readouterr().out.strip()
    assert "\n" not in numbers
    assert page.section(folder, name, numbers) in text, REMEDY
    shown = ROOT / "docs" / "figures" / f"{name}.png"
    with Image.open(tmp_path / figures / f"{name}.png") as drawn, Image.open(shown) as kept:
        assert drawn.size == kept.size, REMEDY
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
    assert shown == sorted(name for names in SCRIPTS.values() for name in names)
