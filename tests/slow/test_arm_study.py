"""A study of an arm with gravity and friction under load: its C achieves on the true arm what the report claims."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "study"))

from independent_arm import ARM, exported, follow, moves, write
from independent_axis import exported_law
from thorough import nightly

from friction_fmus.__main__ import main


@nightly
def test_gravity_and_load_are_identified_and_compensated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    error = write(ARM, tmp_path, models=("Stribeck",), compensators=("StaticFeedforward",))
    monkeypatch.chdir(tmp_path)
    assert main(["study", "arm.toml", "-o", "out"]) == 0
    study = json.loads((tmp_path / "out" / "study.json").read_text(encoding="utf-8"))
    found = {each["name"]: each["value"] for each in study["models"][0]["parameters"]}
    for name in ("M", "Fc", "Fs", "Fv", "vs", "G_sin", "G_cos", "a"):
        assert found[name] == pytest.approx(getattr(ARM, name), rel=0.05)
    none, best = study["compensators"]
    assert study["recommendation"]["name"] == best["name"] == "StaticFeedforward"
    law = exported(exported_law(tmp_path / "out" / "recommended" / "c", tmp_path))
    achieved = float(np.sqrt(np.mean((moves()[0] - follow(ARM, law)[0]) ** 2)))
    assert best["metrics"]["rms"] == pytest.approx(achieved, rel=0.05)
    assert achieved < 0.05 * none["metrics"]["rms"] < 0.05 * float(np.sqrt(np.mean(error**2)))
