"""The library as it is exported."""

from __future__ import annotations

import pytest
from modelica.library import Library

from friction_fmus.export.targets.modelica import write


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """The library in rumoca."""
    return Library(write(tmp_path_factory.mktemp("modelica")))
