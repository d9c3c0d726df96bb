"""Commands of the documentation that take long."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from docs.test_documents import ROOT, blocks, run
from thorough import nightly


@nightly
@pytest.mark.skipif(shutil.which("clang") is None, reason="clang is not installed")
def test_commands_of_the_robustness_page_work(tmp_path: Path) -> None:
    (commands,) = blocks(ROOT / "docs" / "reliability.md", "commands")
    (tmp_path / "tests").symlink_to(ROOT / "tests")
    for command in commands.splitlines():
        run(command, tmp_path)
