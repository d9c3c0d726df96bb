"""Pieces of a study: kept when they are done, done once, done again when something about them changes."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from friction_fmus.study.steps import Step, StepCache, _ready, rebuild, run_steps


@dataclass(frozen=True)
class Inner:
    at: tuple[float, ...]
    note: str | None = None


@dataclass(frozen=True)
class Outcome:
    total: float | None
    inner: Inner
    by_name: Mapping[str, Inner]
    flag: bool = True


CALLS: list[float] = []


def double(x: float) -> Outcome:
    """Fails at 3."""
    CALLS.append(x)
    if x == 3.0:
        raise KeyboardInterrupt
    return Outcome(2.0 * x, Inner((x, 1.0)), {"a": Inner((), "b")})


def steps(*values: float) -> list[Step]:
    return [Step(f"double-{value:g}", double, (value,), Outcome) for value in values]


def test_a_result_comes_back_as_it_was() -> None:
    result = double(1.0)
    content = {"total": None, "inner": {"at": [1, 2], "note": None}, "by_name": {}, "flag": False}
    assert rebuild(content, Outcome) == Outcome(None, Inner((1.0, 2.0)), {}, False)
    assert result.by_name["a"].note == "b"


@pytest.mark.parametrize("parallel", [False, True])
def test_what_is_done_is_not_done_again(tmp_path: Path, parallel: bool) -> None:
    CALLS.clear()
    pool = ThreadPoolExecutor(2) if parallel else None
    first = run_steps(steps(1.0, 2.0), StepCache(tmp_path), pool)
    store = StepCache(tmp_path)
    assert run_steps(steps(2.0, 1.0, 4.0), store, pool)[:2] == [first[1], first[0]]
    assert sorted(CALLS) == [1.0, 2.0, 4.0]
    assert store.reused == 2
    if pool is not None:
        pool.shutdown()


def test_a_study_that_was_broken_off_goes_on(tmp_path: Path) -> None:
    CALLS.clear()
    with pytest.raises(KeyboardInterrupt):
        run_steps(steps(1.0, 2.0, 3.0, 4.0), StepCache(tmp_path), None)
    assert CALLS == [1.0, 2.0, 3.0]
    run_steps(steps(1.0, 2.0, 4.0), StepCache(tmp_path), None)
    assert CALLS == [1.0, 2.0, 3.0, 4.0]


def test_a_damaged_file_is_done_again(tmp_path: Path) -> None:
    CALLS.clear()
    run_steps(steps(1.0), StepCache(tmp_path), None)
    (file,) = tmp_path.glob("*.json")
    file.write_text(file.read_text(encoding="utf-8")[:20], encoding="utf-8")
    assert run_steps(steps(1.0), StepCache(tmp_path), None) == [Outcome(2.0, Inner((1.0, 1.0)), {"a": Inner((), "b")})]
    assert CALLS == [1.0, 1.0]


def test_the_key_depends_on_every_argument(tmp_path: Path) -> None:
    file = tmp_path / "reference.fmu"
    file.write_bytes(b"one")
    inner = Inner((1.0,))
    base = Step("step", double, (1.0, np.arange(3.0), {"Fc": 1.0}, inner, file), Outcome)
    others = [
        (2.0, np.arange(3.0), {"Fc": 1.0}, inner, file),
        (1.0, np.arange(4.0), {"Fc": 1.0}, inner, file),
        (1.0, np.arange(3.0), {"Fs": 1.0}, inner, file),
        (1.0, np.arange(3.0), {"Fc": 1.0}, Inner((2.0,)), file),
    ]
    keys = [base.key, *(replace(base, arguments=arguments).key for arguments in others)]
    assert len(set(keys)) == 5
    assert replace(base, arguments=(1.0, np.arange(3.0), {"Fc": 1.0}, Inner((1.0,)), file)).key == base.key
    file.write_bytes(b"two")
    assert base.key != keys[0]


def test_a_worker_imports_what_the_steps_need(monkeypatch: pytest.MonkeyPatch) -> None:
    frozen: list[bool] = []
    monkeypatch.setattr("gc.freeze", lambda: frozen.append(True))
    _ready()
    assert frozen == [True]
