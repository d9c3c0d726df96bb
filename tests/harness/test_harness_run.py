"""Recording, taps, progress, failures, and the files a result is written to."""

from __future__ import annotations

import csv
import pickle
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from harness_parts import mass, memoryless, plant

from harness import (
    CallablePart,
    ExperimentError,
    OutputError,
    PartError,
    Port,
    Result,
    System,
    Tap,
    UnknownNameError,
    plot,
    save_result,
)


def free_fall() -> System:
    """x = t**2, v = 2 t."""
    return System([mass()], start={"mass.F": -2.0}, name="fall")


def test_result_has_units_and_attributes() -> None:
    result = free_fall().run(stop=1.0, step=0.125)
    t = np.arange(9) * 0.125
    np.testing.assert_allclose(result["mass.x"], t**2, rtol=1e-14)
    np.testing.assert_array_equal(result["time"], t)
    assert list(result.data_vars) == ["mass.x", "mass.v"]
    assert result["mass.v"].attrs == {"units": "m/s"}
    assert result["time"].attrs == {"units": "s"}
    expected = {"system": "fall", "master": "gauss-seidel", "start": 0.0, "stop": 1.0, "step": 0.125}
    assert result.attrs.items() >= expected.items()


def test_decimation_keeps_the_start_values() -> None:
    result = free_fall().run(stop=1.0, step=0.125, decimate=3)
    np.testing.assert_array_equal(result["time"], [0.0, 0.375, 0.75])
    np.testing.assert_allclose(result["mass.v"], [0.0, 0.75, 1.5])


def names(*patterns: str) -> list[str]:
    parts = [memoryless("a", ["u"], ["y", "k[1]", "k[2]"]), plant("ab")]
    system = System(parts, ["ab.y -> a.u", "a.y -> ab.u"])
    return [str(name) for name in system.run(stop=0.0, step=1.0, record=patterns).data_vars]


def test_record_patterns() -> None:
    assert names("*") == ["a.y", "a.k[1]", "a.k[2]", "ab.y"]
    assert names("a.*") == ["a.y", "a.k[1]", "a.k[2]"]
    assert names("a.k[?]") == ["a.k[1]", "a.k[2]"]
    assert names("ab.y", "a.k[2]") == ["ab.y", "a.k[2]"]
    assert names("*.y", "a.y", "a.u") == ["a.y", "ab.y", "a.u"]
    assert names() == []


@pytest.mark.parametrize("pattern", ["c.*", "a.k[3]", "c.y"])
def test_record_of_nothing(pattern: str) -> None:
    with pytest.raises(UnknownNameError, match="record"):
        names(pattern)


def test_tap_reads_after_a_step() -> None:
    seen: list[tuple[float, float, float]] = []
    tap = Tap(lambda t, values: seen.append((t, *values.tolist())), ("mass.v", "mass.x"), every=4)
    result = free_fall().run(stop=1.0, step=0.125, taps=[tap], record=["mass.x"])
    np.testing.assert_allclose(seen, [(0.0, 0.0, 0.0), (0.5, 1.0, 0.25), (1.0, 2.0, 1.0)])
    assert list(result.data_vars) == ["mass.x"]


def test_tap_on_an_unknown_variable() -> None:
    with pytest.raises(UnknownNameError, match=r"'mass' has no variable 'w' \(in tap\)"):
        free_fall().run(stop=1.0, step=0.5, taps=[Tap(lambda t, values: None, ("mass.w",))])


def test_progress_begins_at_nothing_and_ends_at_all() -> None:
    class Log:
        def __init__(self) -> None:
            self.calls: list[tuple[int, int]] = []

        def update(self, done: int, total: int) -> None:
            self.calls.append((done, total))

    log = Log()
    free_fall().run(stop=250.0, step=1.0, progress=log)
    assert log.calls[0] == (0, 250)
    assert log.calls[-1] == (250, 250)
    assert 50 < len(log.calls) < 200
    done = [call[0] for call in log.calls]
    assert done == sorted(done)


def test_failing_function_names_part_and_time_and_keeps_the_result() -> None:
    def function(t: float, u: np.ndarray, x: np.ndarray) -> float:
        return 1.0 / (0.5 - t)

    system = System([CallablePart("pole", function, [], ["y"])])
    with pytest.raises(PartError, match=r"part 'pole' failed in function at t = 0\.5 s: ZeroDivisionError") as caught:
        system.run(stop=1.0, step=0.125)
    result = caught.value.result
    assert result is not None
    np.testing.assert_array_equal(result["time"], [0.0, 0.125, 0.25, 0.375])
    np.testing.assert_allclose(result["pole.y"], 1 / (0.5 - np.array([0.0, 0.125, 0.25, 0.375])))


def test_function_that_returns_too_much() -> None:
    with pytest.raises(PartError, match="returned 2 values instead of 1"):
        System([CallablePart("p", lambda t, u, x: [1, 2], [], ["y"])]).run(stop=1.0, step=0.5)


def test_part_error_survives_pickling() -> None:
    error = pickle.loads(pickle.dumps(PartError("p", "fmi2DoStep", "no", 0.5)))
    assert str(error) == "part 'p' failed in fmi2DoStep at t = 0.5 s: no"


def test_values_that_are_not_finite_are_reported(caplog: pytest.LogCaptureFixture) -> None:
    part = CallablePart("p", lambda t, u, x: np.nan if t > 0.6 else t, [], ["y"])
    System([part]).run(stop=1.0, step=0.25)
    assert "p.y is not finite from t = 0.75 s on" in caplog.text


def mixed() -> Result:
    part = CallablePart(
        "p",
        lambda t, u, x: [t / 3, round(t), t > 1],
        [],
        [Port("F", "N", description="force"), Port("n", type="Integer"), Port("b", type="Boolean")],
    )
    return System([part], name="mixed").run(stop=3.0, step=1.0)


def test_csv(tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    path.write_text("old")
    save_result(mixed(), path)
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["time [s]", "p.F [N]", "p.n", "p.b"]
    assert rows[2] == ["1.0", repr(1 / 3), "1", "0"]
    assert rows[4] == ["3.0", "1.0", "3", "1"]
    assert len(rows) == 5
    assert [p.name for p in tmp_path.iterdir()] == ["out.csv"]


def test_parquet(tmp_path: Path) -> None:
    path = tmp_path / "out.parquet"
    save_result(mixed(), path)
    table = pq.read_table(path)
    assert table.column_names == ["time", "p.F", "p.n", "p.b"]
    assert table.schema.field("time").metadata[b"units"] == b"s"
    assert table.schema.field("p.F").metadata == {b"units": b"N", b"description": b"force", **_extra(table, "p.F")}
    assert table.schema.metadata[b"system"] == b"mixed"
    assert table["p.F"].to_pylist() == [0.0, 1 / 3, 2 / 3, 1.0]
    assert table["p.n"].to_pylist() == [0, 1, 2, 3]
    assert table["p.b"].to_pylist() == [False, False, True, True]


def _extra(table: object, name: str) -> dict[bytes, bytes]:
    """Metadata that the Parquet reader itself adds."""
    metadata = table.schema.field(name).metadata  # type: ignore[attr-defined]
    return {key: value for key, value in metadata.items() if key.startswith(b"PARQUET:")}


def test_plot(tmp_path: Path) -> None:
    plot(free_fall().run(stop=1.0, step=0.1), tmp_path / "fall.svg")
    text = (tmp_path / "fall.svg").read_text()
    for label in ("time [s]", "mass.x [m]", "mass.v [m/s]"):
        assert f"<!-- {label} -->" in text
    plot(mixed(), tmp_path / "mixed.png", ["p.F"])
    assert (tmp_path / "mixed.png").read_bytes().startswith(b"\x89PNG")


def test_plot_of_nothing_or_to_nowhere(tmp_path: Path) -> None:
    result = free_fall().run(stop=1.0, step=0.5)
    with pytest.raises(UnknownNameError, match=r"'mass\.y' was not recorded: did you mean"):
        plot(result, tmp_path / "a.png", ["mass.y"])
    with pytest.raises(OutputError, match="suffix must be one of"):
        plot(result, tmp_path / "a.docx")
    with pytest.raises(OutputError, match="nothing to plot"):
        plot(free_fall().run(stop=1.0, step=0.5, record=[]), tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["out.csv", "out.mat", "out.nc", "out.parquet", "out.png"])
def test_failed_write_leaves_the_old_file_and_nothing_else(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, result = plot if name == "out.png" else save_result, mixed()
    with pytest.raises(OutputError, match="existing writable folder"):
        write(result, tmp_path / "missing" / name)
    path = tmp_path / name
    path.write_text("old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OutputError, match="No space left"):
        write(result, path)
    assert [p.name for p in tmp_path.iterdir()] == [name]
    assert path.read_text() == "old"


def test_record_that_is_too_large() -> None:
    with pytest.raises(
        ExperimentError, match="GB, more than is available: record fewer variables or increase decimate"
    ):
        free_fall().run(stop=1e17, step=1.0)


def test_error_before_the_first_row_has_no_result() -> None:
    with pytest.raises(PartError) as caught:
        System([CallablePart("p", lambda t, u, x: 1 / t, [], ["y"])]).run(stop=1.0, step=0.5)
    assert caught.value.result is None
    assert caught.value.time == 0.0


def test_run_that_fails_the_experiment_check_starts_nothing() -> None:
    started: list[float] = []
    part = CallablePart("p", lambda t, u, x: started.append(t) or 0.0, [], ["y"])
    with pytest.raises(ExperimentError):
        System([part]).run(stop=1.0, step=-1.0)
    assert started == []
