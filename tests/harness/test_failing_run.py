"""The command `run` on an FMU that fails: the incomplete result is kept, in every format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from friction_fmus.__main__ import main
from harness import load_result
from harness.results import FORMATS


@pytest.fixture
def seizing(make_fmu: Callable[..., Path], tmp_path: Path) -> Callable[..., Path]:
    """A system file around an FMU whose step from 0.5 s fails; x' = 3."""

    def make(start: str = "fail_time = 0.6") -> Path:
        make_fmu()
        path = tmp_path / "seizing.toml"
        path.write_text(
            "[parts.spindle]\nfmu = 'probe.fmu'\n"
            f"[parts.spindle.start]\nu = 3.0\nn = 1\nb = false\nlabel = 'bearing'\n{start}\n"
            "[experiment]\nstop = 1.0\nstep = 0.25\n"
        )
        return path

    return make


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize(("status", "label"), [(2, "Discard"), (3, "Error"), (4, "Fatal")])
def test_the_rows_before_the_failure_are_written(
    suffix: str,
    status: int,
    label: str,
    seizing: Callable[..., Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    system = seizing(f"fail_time = 0.6\nfail_status = {status}")
    path = tmp_path / "new" / f"out{suffix}"
    assert main(["run", str(system), "-o", str(path)]) == 2
    captured = capsys.readouterr()
    message = f"part 'spindle' failed in fmi2DoStep at t = 0.5 s: it returned {label} and logged 'bearing seized'"
    assert captured.out == ""
    assert captured.err.splitlines()[-1] == (
        f"friction-fmus: {message}; the incomplete result is in {path}, 4 variables, 3 time points (0 to 0.5 s)"
    )
    result = load_result(path)
    np.testing.assert_array_equal(result["time"], [0.0, 0.25, 0.5])
    np.testing.assert_array_equal(result["spindle.x"], [0.0, 0.75, 1.5])
    if suffix != ".csv":  # which has no place for it
        assert result.attrs["incomplete"] == message
        assert result.attrs["system"] == "seizing"


def test_a_run_that_ends_well_is_not_incomplete(seizing: Callable[..., Path], tmp_path: Path) -> None:
    assert main(["run", str(seizing("")), "-o", str(tmp_path / "out.nc")]) == 0
    assert "incomplete" not in load_result(tmp_path / "out.nc").attrs


def test_a_run_that_cannot_be_started_writes_nothing(
    seizing: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", str(seizing("gain = -1.0")), "-o", str(tmp_path / "out.nc")]) == 2
    assert "rejected the start value -1.0 of gain" in capsys.readouterr().err
    assert not (tmp_path / "out.nc").exists()


def test_the_failure_is_told_even_if_the_file_cannot_be_written(
    seizing: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out.nc").mkdir()
    assert main(["run", str(seizing()), "-o", str(tmp_path / "out.nc")]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert "logged 'bearing seized'; the incomplete result is lost: cannot write" in error
