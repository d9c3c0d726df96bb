"""Records of a few strokes: what they determine is found, the rest is named, and too few samples are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from friction_fmus.__main__ import main
from friction_fmus.identification import LINEAR, Record, read_measurement
from friction_fmus.identification.data.reading import default_windows
from friction_fmus.identification.fit.first_look import first_look

M, FC, FV, OF = 2.0, 8.0, 5.0, 0.7
TS = 1e-3


def record(samples: int, start: float = 0.0) -> Record:
    """A motion of 1 Hz in closed form, which reverses every half second."""
    t = start + TS * np.arange(samples)
    w = 2 * np.pi
    q, v, a = 0.1 * np.sin(w * t), 0.1 * w * np.cos(w * t), -0.1 * w**2 * np.sin(w * t)
    return Record("axis", t - start, q=q, force=M * a + FC * np.sign(v) + FV * v + OF)


def saved(folder: Path, *records: Record, pause: float = 0.1) -> Path:
    path = folder / "axis.csv"
    start, lines = 0.0, ["t [s],x [m],F [N]"]
    for each in records:
        assert each.q is not None
        assert each.force is not None
        columns = (start + each.t, each.q, each.force)
        lines += [",".join(f"{x:.9g}" for x in row) for row in zip(*columns, strict=True)]
        start += each.t[-1] + pause
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_too_few_samples_are_refused_once_with_the_number_that_is_needed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = saved(tmp_path, record(60))
    assert main(["identify", str(path), "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    # 49 samples at each end until the filter has settled, and 25 between them
    assert error.count("has 60 samples at 1000 Hz, but the filters need more than 123;") == 1
    assert "log a longer motion" in error
    assert not (tmp_path / "out").exists()


def test_a_short_segment_is_left_out_beside_a_longer_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = saved(tmp_path, record(1500), record(70))
    assert len(read_measurement(path).records) == 2
    window = ["--train", "0", "5"]
    assert main(["identify", str(path), *window, "--model", "Coulomb", "-o", str(tmp_path / "out")]) == 0
    assert "1500 samples" in capsys.readouterr().out


@pytest.mark.parametrize(("samples", "parts"), [(200, {"train"}), (400, {"train", "validation"})])
def test_a_record_is_divided_only_if_both_parts_are_long_enough(samples: int, parts: set[str]) -> None:
    assert default_windows([record(samples)]).keys() == parts


@pytest.mark.parametrize(("start", "name", "sum_"), [(-0.2, "Fc + OF", FC + OF), (0.3, "Fc - OF", FC - OF)])
def test_one_direction_shows_the_sum_of_friction_and_offset(start: float, name: str, sum_: float) -> None:
    found = first_look([record(400, start)])
    assert found.keys() == {"M", name, "Fv"}
    assert found[name].value == pytest.approx(sum_, rel=0.01)
    assert found["Fv"].value == pytest.approx(FV, rel=0.01)
    assert first_look([record(2000, start)]).keys() == {"M", "Fc", "Fv", "OF"}
    assert LINEAR.force == found[name].unit
