"""The claims in examples/models hold, and docs/claims.md shows what they print and draw."""

from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path
from types import ModuleType

import pytest
from PIL import Image

ROOT = Path(__file__).parent.parent
CLAIMS = sorted(p.stem for p in (ROOT / "examples" / "models").glob("*.py") if p.stem != "page" and p.stem[0] != "_")
PAGE = ROOT / "docs" / "claims.md"
REMEDY = "run `python examples/models/page.py docs`"


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "examples" / "models")
    import page

    return page


@pytest.mark.parametrize("name", CLAIMS)
def test_claim_holds_and_the_page_shows_it(
    name: str, page: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Runs the command of the page, in this process."""
    text = PAGE.read_text(encoding="utf-8")
    (folder,) = re.findall(rf"^python examples/models/{name}\.py (\S+)$", text, re.M)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [f"{name}.py", folder])
    runpy.run_path(str(ROOT / "examples" / "models" / f"{name}.py"), run_name="__main__")
    numbers = capsys.readouterr().out.strip()
    assert "\n" not in numbers
    assert page.section(name, numbers) in text, REMEDY
    shown = ROOT / "docs" / "figures" / f"{name}.png"
    with Image.open(tmp_path / folder / f"{name}.png") as drawn, Image.open(shown) as kept:
        assert drawn.size == kept.size, REMEDY
    assert shown.stat().st_size < 60_000


def test_page_has_these_claims_and_no_others(page: ModuleType) -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert list(page.claims()) == CLAIMS
    assert re.findall(r"^python examples/models/(\w+)\.py", text, re.M) == CLAIMS, REMEDY
    assert re.findall(r"\(figures/(\w+)\.png\)", text) == CLAIMS, REMEDY
    assert sorted(path.stem for path in (ROOT / "docs" / "figures").glob("*")) == CLAIMS
    assert text.startswith(page.INTRODUCTION), REMEDY
