"""Damaged folders of sweeps: what is damaged is named, and no run counts that is not there."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import xarray as xr

from harness import SweepError
from harness.sweeps.folder import MANIFEST, TRAJECTORIES, SweepFolder, read_sweep
from harness.sweeps.worker import Outcome

DESCRIPTION = {"runs": 6}
KINDS = {"p.u": "Real"}


def outcome(run: int) -> Outcome:
    return Outcome(run=run, measures={"y": 2.0 * run}, wall_time=0.1, error="", warnings="", kept=None)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four of six runs, in two files."""
    sweep = SweepFolder(tmp_path, DESCRIPTION, KINDS, {})  # type: ignore[arg-type]
    samples = [{"p.u": float(run)} for run in range(6)]
    sweep.add([outcome(0), outcome(1)], samples)
    sweep.add([outcome(2), outcome(3)], samples)
    return tmp_path


def files(folder: Path) -> Sequence[Path]:
    return sorted(folder.glob("runs-*.parquet"))


def without(column: str) -> Callable[[Path], None]:
    return lambda folder: pq.write_table(pq.read_table(files(folder)[0]).drop_columns(column), files(folder)[0])


def with_runs(*runs: object) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        table = pq.read_table(files(folder)[0])
        pq.write_table(table.set_column(0, "run", pa.array(runs)), files(folder)[0])

    return change


def with_manifest(**entries: object) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        content = json.loads((folder / MANIFEST).read_text()) | entries
        (folder / MANIFEST).write_text(json.dumps({key: value for key, value in content.items() if value != "none"}))

    return change


def truncated(folder: Path) -> None:
    files(folder)[0].write_bytes(files(folder)[0].read_bytes()[:-20])


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (without("run"), "it has no column run"),
        (without("p.u"), r"it has no column p\.u"),
        (without("error"), "it has no column error"),
        (with_runs(0, 6), "its runs are not numbers from 0 to 5"),
        (with_runs(-1, 0), "its runs are not numbers from 0 to 5"),
        (with_runs(0, None), "its runs are not numbers from 0 to 5"),
        (with_runs(0.0, 1.0), "its runs are not numbers from 0 to 5"),
        (with_runs("0", "1"), "its runs are not numbers from 0 to 5"),
        (with_runs(1, 1), "it repeats a run of another file"),
        (with_runs(1, 2), "it repeats a run of another file"),
        (truncated, "cannot read"),
        (with_manifest(parameters="none"), "is damaged: parameters and measures are missing"),
        (with_manifest(measured="none"), "is damaged: parameters and measures are missing"),
        (with_manifest(measured=3), "is damaged: parameters and measures are missing"),
        (with_manifest(parameters=[1]), "is damaged: parameters and measures are missing"),
        (lambda folder: (folder / MANIFEST).write_text("[]"), "is damaged: parameters and measures are missing"),
        (lambda folder: (folder / MANIFEST).write_text("[" * 100_000), "contains no sweep"),
        (with_manifest(runs=7), "contains another sweep, which differs in runs"),
    ],
)
def test_a_damaged_folder_is_refused(folder: Path, damage: Callable[[Path], None], message: str) -> None:
    damage(folder)
    with pytest.raises(SweepError, match=message) as error:
        SweepFolder(folder, DESCRIPTION, KINDS, {})  # type: ignore[arg-type]
    assert str(folder) in str(error.value)
    assert "\n" not in str(error.value)


def test_one_bit_of_a_value_is_found(folder: Path) -> None:
    """Plain numbers, so that no decompression finds it."""
    with_manifest(runs=2000)(folder)
    values = np.arange(2.0, 2.0 + 2000.0)
    table = pa.table({"run": np.arange(2000), "p.u": values, "y": values, "wall_time": values})
    table = table.append_column("error", pa.array([""] * 2000)).append_column("warnings", pa.array([""] * 2000))
    pq.write_table(table, files(folder)[0], compression="none", use_dictionary=False, write_page_checksum=True)
    files(folder)[1].unlink()
    content = bytearray(files(folder)[0].read_bytes())
    at = content.index(values[1000:1010].tobytes())
    content[at] ^= 1
    files(folder)[0].write_bytes(content)
    with pytest.raises(SweepError, match="cannot read"):
        SweepFolder(folder, {"runs": 2000}, KINDS, {})  # type: ignore[arg-type]
    with pytest.raises(SweepError, match="cannot read the runs"):
        read_sweep(folder)


def test_files_that_do_not_go_together_are_refused(folder: Path) -> None:
    table = pq.read_table(files(folder)[1])
    pq.write_table(table.set_column(1, "p.u", pa.array(["a", "b"])), files(folder)[1])
    with pytest.raises(SweepError, match="cannot read the runs in"):
        read_sweep(folder)


def test_measures_that_a_killed_process_has_begun_are_not_added_twice(tmp_path: Path) -> None:
    """It wrote the columns into the file of a failed run, and not the description."""
    samples = [{"p.u": float(run)} for run in range(6)]
    sweep = SweepFolder(tmp_path, DESCRIPTION, KINDS, {})  # type: ignore[arg-type]
    failed = Outcome(run=0, measures={}, wall_time=0.1, error="no", warnings="", kept=None)
    sweep.add([failed], samples)
    before = (tmp_path / MANIFEST).read_bytes()
    sweep.add([outcome(1)], samples)
    files(tmp_path)[1].unlink()
    (tmp_path / MANIFEST).write_bytes(before)
    again = SweepFolder(tmp_path, DESCRIPTION, KINDS, {})  # type: ignore[arg-type]
    again.add([outcome(1)], samples)
    found = read_sweep(tmp_path)
    assert np.isnan(found["y"][0])
    assert float(found["y"][1]) == 2.0


def test_trajectories_without_their_runs_are_removed(tmp_path: Path) -> None:
    """A process that was killed between the two files leaves them; other chunks repeat the runs."""
    samples = [{"p.u": float(run)} for run in range(6)]
    kept = xr.Dataset({"p.y": ("time", [1.0, 2.0, 3.0])}, {"time": [0.0, 1.0, 2.0]})

    def chunk(*runs: int) -> list[Outcome]:
        return [Outcome(run, measures={"y": 1.0}, kept=kept) for run in runs]

    sweep = SweepFolder(tmp_path, DESCRIPTION, KINDS, {})  # type: ignore[arg-type]
    sweep.add(chunk(0, 1), samples)
    sweep.add(chunk(2, 3, 4), samples)
    files(tmp_path)[1].unlink()
    again = SweepFolder(tmp_path, DESCRIPTION, KINDS, {})  # type: ignore[arg-type]
    assert again.done == {0, 1}
    for run in (2, 3, 4, 5):
        again.add(chunk(run), samples)
    rows = pq.read_table(tmp_path / TRAJECTORIES)["run"].to_pylist()
    assert sorted(rows) == sorted(3 * [*range(6)])
