"""The library as it is exported."""

from __future__ import annotations

import re
import shutil

import pytest
from modelica.library import Library

from friction_fmus.export.targets.modelica import write


@pytest.fixture(scope="session")
def whole_library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """The library in rumoca."""
    return Library(write(tmp_path_factory.mktemp("modelica")))


@pytest.fixture(scope="session")
def library(whole_library: Library, tmp_path_factory: pytest.TempPathFactory) -> Library:
    """The library without compensators, whose names each compilation resolves: 0.05 s in place of 0.2 s."""
    folder = tmp_path_factory.mktemp("friction") / "FrictionFMUs"
    shutil.copytree(whole_library.roots[0], folder, ignore=shutil.ignore_patterns("Compensators", "Resources"))
    text = (folder / "Examples.mo").read_text()
    short = re.sub(r"  model FrictionCompensation .*?end FrictionCompensation;\n", "", text, flags=re.DOTALL)
    assert short != text
    (folder / "Examples.mo").write_text(short)
    return Library(folder)
