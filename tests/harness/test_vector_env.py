"""The example of a vector environment of Gymnasium keeps to its interface."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "vector_env.py"


def test_episodes_end_begin_again_and_repeat_with_their_seed(capsys: pytest.CaptureFixture[str]) -> None:
    example = runpy.run_path(str(EXAMPLE))
    axes = example["AxisEnv"](20)
    first, _ = axes.reset(seed=3)
    assert first in axes.observation_space
    assert axes.action_space.sample().shape == (20, 1)
    actions = np.random.default_rng(3).uniform(-1.0, 1.0, (example["LENGTH"] + 1, 20, 1))
    actions[5, 2] = np.nan
    ended, seen = [], []
    for rows in actions:
        observed, rewards, terminated, truncated, info = axes.step(rows)
        seen.append(observed)
        ended.append((terminated | truncated).tolist())
        assert (rewards <= 0.0).all()
        assert [*info["failures"]] == np.flatnonzero(terminated).tolist()
    assert [sum(each) for each in ended] == [int(k == 5) + 19 * (k == len(actions) - 2) for k in range(len(actions))]
    assert seen[6][2, 0] == seen[6][2, 1] == 0.0  # it has begun again, the others have not
    assert np.count_nonzero(seen[6][:, 0] == 0.0) == 1
    again, _ = axes.reset(seed=3)
    np.testing.assert_array_equal(again, first)
    np.testing.assert_array_equal(axes.step(actions[0])[0], seen[0])
    axes.close()


def test_a_controller_follows_the_targets(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    assert -0.2 < float(capsys.readouterr().out.split()[-1]) < 0.0
