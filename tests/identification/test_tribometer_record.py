"""The record of the tribometer is the published one, in SI units and with the sign of this project."""

from __future__ import annotations

import hashlib
import lzma
from pathlib import Path

import numpy as np
import pytest

from friction_fmus import data
from friction_fmus.data import load_tribometer

FOLDER = Path(data.__file__).parent / "tribometer"


def test_the_file_is_the_published_one_and_its_licence_is_beside_it() -> None:
    content = lzma.decompress((FOLDER / "reciprocating.txt.xz").read_bytes())
    assert len(content) == 1579921
    assert hashlib.sha256(content).hexdigest() in (FOLDER / "README.md").read_text(encoding="utf-8")
    assert (FOLDER / "LICENSE").read_text(encoding="utf-8").startswith("MIT License")


def test_the_record_is_loaded_and_opposes_the_motion() -> None:
    record = load_tribometer()
    assert len(record) == 40418
    assert record.Ts == pytest.approx(5e-3, rel=1e-6)
    assert np.ptp(record.column("q")) == pytest.approx(0.24e-3, rel=0.05)
    assert np.min(record.column("normal")) >= 4.9
    moving = np.gradient(record.column("q"))
    assert float(np.sum(record.column("friction") * moving)) > 0.0
    assert "Christopherson" in record.citation
