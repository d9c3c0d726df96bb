"""Results of a study or an identification, read for the targets."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from drive_axis import rigid

from friction_fmus.axis.position_map import Grid, PositionMap
from friction_fmus.errors import BuildError
from friction_fmus.export.identified_axis import IdentifiedAxis, read_axis
from friction_fmus.export.targets import minas
from friction_fmus.identification import ROTARY, Record, identify
from friction_fmus.identification.result_files import axis_of, identified_axis
from friction_fmus.listings import plain
from friction_fmus.study.steps import rebuild


def test_an_axis_comes_back_as_written(tmp_path: Path) -> None:
    table = PositionMap(Grid(0.0, 0.1, 4, periodic=True), (1.0, 0.0, -1.0, 0.0), (0.1,) * 4, 1e-3)
    axis = rigid(position=table, citation="A. Author, 2020")
    other = rigid(label="Coulomb", model="Coulomb", parameters={"Fc": 3.0})
    file = tmp_path / "study.json"
    file.write_text(json.dumps({"axes": [plain(axis), plain(other)]}), encoding="utf-8")
    (tmp_path / "report.html").write_text("", encoding="utf-8")
    for path in (tmp_path, file, tmp_path / "report.html"):
        assert read_axis(path) == axis
        assert read_axis(path, "Coulomb") == other
    assert rebuild(plain(axis), IdentifiedAxis) == axis  # as part of the result of a study


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "has no axes: it is damaged, or of an earlier version"),
        ("{}", "has no axes"),
        ('{"axes": [{"name": 1}]}', "has no axes"),
        ("[]", "has no axes"),
        ('{"axes": []}', "no axis to export: no model was identified, the result is not in SI units"),
        (None, "is no result, which has study.json or identification.json"),
    ],
)
def test_files_without_an_axis(tmp_path: Path, text: str | None, message: str) -> None:
    if text is not None:
        (tmp_path / "study.json").write_text(text, encoding="utf-8")
    with pytest.raises(BuildError, match=message):
        read_axis(tmp_path)


def test_an_identification_is_a_result() -> None:
    """2 kg, 3 N, 20 N.s/m and 0.5 N, with 1 % of noise."""
    t = 2e-3 * np.arange(2000)
    v = 0.1 * np.sin(2.0 * np.pi * 0.5 * t)
    q = -0.1 * np.cos(2.0 * np.pi * 0.5 * t) / np.pi
    a = 0.1 * np.pi * np.cos(2.0 * np.pi * 0.5 * t)
    force = 2.0 * a + 3.0 * np.sign(v) + 20.0 * v + 0.5 + 0.03 * np.random.default_rng(1).normal(size=len(t))
    result = identify("Stribeck", Record("slide", t, q=q, force=force), fixed={"vs": 1e-3})
    axis = axis_of(result, "A. Author, 2020")
    assert (axis.model, axis.rotary, axis.loop, axis.position) == ("Stribeck", False, None, None)
    assert (axis.name, axis.citation) == ("slide", "A. Author, 2020")
    assert axis.mass == pytest.approx(2.0, rel=0.02)
    assert axis.offset == pytest.approx(0.5, abs=0.02)
    assert axis.speed == pytest.approx(0.1, rel=0.02)
    assert axis.parameters["Fv"] == pytest.approx(20.0, rel=0.05)
    assert {"M", "OF"}.isdisjoint(axis.parameters)


def test_terms_beside_the_model_are_kept(tmp_path: Path) -> None:
    record = Record("arm", np.arange(40.0), q=np.linspace(0.0, 0.8, 40), units=ROTARY)
    values = {"Fc": 1.0, "M": 2.0, "G_sin": 3.0, "G_cos": 4.0, "a": 0.1}
    axis = identified_axis([record], "", "Coulomb", "Coulomb", values, 2.0, 0.0, None)
    assert axis.terms == {"G_sin": 3.0, "G_cos": 4.0, "a": 0.1}
    assert axis.position is not None
    assert axis.position.force(np.array([0.5]), np.zeros(1)) == pytest.approx(-3.0 * np.sin(0.5) - 4.0 * np.cos(0.5))
    minas.write(axis, tmp_path, rated="10 N.m")
    page = (tmp_path / "minas.md").read_text(encoding="utf-8")
    assert "beside the friction model is not compensated: a." in page
    assert "The torque over position is not compensated" in page
