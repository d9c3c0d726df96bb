"""What a notebook shows of a study."""

from __future__ import annotations

from dataclasses import replace

from made_up_study import made_up_study


def test_the_recommendation_and_all_models_and_compensators() -> None:
    study = made_up_study()
    shown = study._repr_html_()
    for row in (*study.models, *study.compensators):
        assert f"<td>{row.name}</td>" in shown
    assert f"Recommendation: {study.recommendation.name}" in shown
    assert len(repr(study)) < 200
    assert repr(study).startswith(f"<StudyResult {study.name!r}: {len(study.models)} models, ")


def test_texts_are_escaped() -> None:
    study = made_up_study()
    hostile = replace(study, recommendation=replace(study.recommendation, name="<b>", reason="a < b"))
    assert "<b>" not in hostile._repr_html_()
    assert "a &lt; b" in hostile._repr_html_()
