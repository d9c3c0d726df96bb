"""The scripts in examples/ hold, and docs/effects.md shows what they print and draw."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from collections.abc import Callable, Mapping
from decimal import Decimal
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw
from thorough import nightly, some

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "effects.md"
SCRIPTS = {
    folder: sorted(p.stem for p in (ROOT / "examples" / folder).glob("*.py") if p.stem[0] != "_")
    for folder in ("models", "compensation")
}
REMEDY = "run `python examples/page.py docs`"
FIGURES = "run `python benchmarks/effects.py --csv examples/compensation/figures.csv`"
NUMBER = r"\d+(?:\.\d+)?(?:e[-+]?\d+)?"
EACH = [(folder, name) for folder in SCRIPTS for name in SCRIPTS[folder]]


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "examples")
    import page

    return page


def alike(kept: str, printed: str) -> bool:
    """Whether two texts have the same words, and numbers that differ by at most one in the last digit of the kept one.

    Another processor can round the last digit differently. Whole numbers below ten are counts and must be equal.
    """
    numbers = [re.findall(NUMBER, text) for text in (kept, printed)]
    return re.sub(NUMBER, "#", kept) == re.sub(NUMBER, "#", printed) and all(
        a == b or (len(a) > 1 and abs(Decimal(a) - Decimal(b)) <= last_digit(a)) for a, b in zip(*numbers, strict=True)
    )


def last_digit(number: str) -> Decimal:
    """One in the last digit of a number."""
    return Decimal((0, (1,), int(Decimal(number).as_tuple().exponent)))


def check_figures(name: str, checks: tuple[Any, ...], kept: Mapping[str, Any]) -> None:
    """Each is in figures.csv with its bounds; its value may differ a little on another processor."""
    assert len({check.name for check in checks}) == len(checks) > 0
    for check in checks:
        figure = kept[check.name]
        assert check.holds
        assert figure.unit == check.unit and alike(figure.bounds, check.bounds), FIGURES
        assert (figure.value != "") == check.reproducible, FIGURES
        if check.reproducible:
            assert float(figure.value) == pytest.approx(check.value, rel=0.02, abs=1e-5), FIGURES
        else:
            assert check.bounds, f"{check.name} has neither digits nor bounds"


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


@pytest.mark.parametrize(("kept", "printed", "same"), [
    ("2.72 times", "2.73 times", True),
    ("2.72 times", "2.74 times", False),
    ("49 µm, 3e-05", "50 µm, 4e-05", True),
    ("1.5e-05", "1.7e-05", False),
    ("6 parameters", "7 parameters", False),
    ("after 12 s", "for 12 s", False),
    ("1 N", "1 N, 2 N", False),
])  # fmt: skip
def test_numbers_are_alike_if_the_last_digit_differs_by_one(kept: str, printed: str, same: bool) -> None:
    assert alike(kept, printed) == same


@pytest.mark.parametrize(("folder", "name"), some(EACH, [(folder, SCRIPTS[folder][0]) for folder in SCRIPTS]))
def test_claim_holds_and_the_page_shows_it(
    folder: str,
    name: str,
    page: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Runs the command of the page for this script, in this process."""
    monkeypatch.syspath_prepend(ROOT / "examples" / folder)
    text = PAGE.read_text(encoding="utf-8")
    (folder_of_figures,) = re.findall(r"^python examples/\w+/\w+\.py (\S+)$", text, re.M)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [f"{name}.py", folder_of_figures])
    if folder == "compensation":
        import figures

        import _effect

        kept = figures.read()[name]

        def confirm(self: _effect.Effect, confirmed: Callable[[_effect.Effect], None] = _effect.Effect.confirm) -> None:
            confirmed(self)
            check_figures(name, self.checks, kept)

        monkeypatch.setattr(_effect.Effect, "confirm", confirm)
    runpy.run_path(str(ROOT / "examples" / folder / f"{name}.py"), run_name="__main__")
    (said,) = re.findall(rf"^!\[.*\]\(figures/{name}\.png\)\n\n> (.+)$", text, re.M)
    assert alike(said, capsys.readouterr().out.rstrip("\n")), REMEDY
    assert page.section(folder, name, said) in text, REMEDY
    shown = ROOT / "docs" / "figures" / f"{name}.png"
    with Image.open(tmp_path / folder_of_figures / f"{name}.png") as drawn, Image.open(shown) as before:
        assert drawn.size == before.size, REMEDY
        assert difference(drawn, before) < LOOKS_ALIKE, REMEDY
    assert shown.stat().st_size < 60_000


def test_page_has_these_scripts_and_no_others(page: ModuleType) -> None:
    text = PAGE.read_text(encoding="utf-8")
    said = dict(re.findall(r"^!\[.*\]\(figures/(\w+)\.png\)\n\n> (.+)$", text, re.M))
    assert {folder: list(page.scripts(folder)) for folder in page.CHAPTERS} == SCRIPTS
    assert list(said) == [name for names in SCRIPTS.values() for name in names], REMEDY
    assert text == page.page({(folder, name): said[name] for folder in SCRIPTS for name in SCRIPTS[folder]}), REMEDY


def test_every_figure_belongs_to_a_page() -> None:
    shown = sorted(path.stem for path in (ROOT / "docs" / "figures").glob("*"))
    pages = "".join(path.read_text("utf-8") for path in (ROOT / "docs").glob("*.md"))
    assert shown == sorted(set(re.findall(r"\bfigures/([\w-]+)\.(?!csv)\w+", pages)))
    assert set(shown) >= {name for names in SCRIPTS.values() for name in names}


@nightly
def test_benchmark_of_the_effects_prints_and_writes_figures(page: ModuleType, tmp_path: Path) -> None:
    import figures

    command = [sys.executable, "benchmarks/effects.py", "hunting", "--short", "--csv", str(tmp_path / "figures.csv")]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert "LuGre: period" in run.stdout
    written, kept = figures.read(tmp_path / "figures.csv")["hunting"], figures.read()["hunting"]
    assert (
        written
        and {name: figure.bounds for name, figure in written.items()}.items()
        <= {name: figure.bounds for name, figure in kept.items()}.items()
    ), FIGURES


def test_benchmark_of_the_effects_refuses_an_unknown_name() -> None:
    command = [sys.executable, "benchmarks/effects.py", "hunting_high"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 2 and "there is no hunting_high.py in examples/compensation" in run.stderr


def test_every_effect_has_figures(page: ModuleType) -> None:
    import figures

    assert list(figures.read()) == list(page.scripts("compensation")), FIGURES
