"""DiscreteInverse with a preview that is chosen when it is built: against an inverse filter in numpy."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from thorough import nightly

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.law_runs import LawC, rows_of
from friction_fmus import build
from friction_fmus.__main__ import main
from friction_fmus.codegen.law_export import make_export
from friction_fmus.codegen.layout import Export
from friction_fmus.errors import FrictionError

Array = NDArray[np.float64]
K, ZERO, INNER = 0.3, -1.01, 0.5
POLES = [0.9, -0.4, 0.2, 0.1]
START = {
    **{"K": K, "zero": ZERO, "inner[1]": INNER, "inner[2]": 0.0, "u_min": -1e6, "u_max": 1e6},
    **{f"a[{i + 1}]": float(value) for i, value in enumerate(np.poly(POLES)[1:])},
}
"""A plant whose zero is so near to the circle that 32 samples leave an error of 1.01^-32 = 73 %."""


def reference(n: int) -> Array:
    """From rest, 300 samples late, and back to rest."""
    t = np.clip((np.arange(n) - 300.0) / 600.0, 0.0, 1.0)
    return np.sin(np.pi * t) ** 4


def inverse(r: Array, N: int) -> tuple[Array, Array]:
    """The reference that is followed, N + 1 samples late, and the force: a non-causal FIR and a causal inverse."""
    s = np.concatenate([np.full(N, r[0]), r, np.full(N, r[-1])])
    weights = -(ZERO ** -np.arange(1.0, N + 1))
    w = np.array([weights @ s[k + 1 : k + N + 1] for k in range(N + r.size)])
    return np.concatenate([np.zeros(N + 1), r[:-1]]), lfilter(np.poly(POLES), [K, -K * INNER], w)


def run(export: Export, r: Array, folder: Path, *flags: str) -> dict[str, Array]:
    found = LawC(export, folder, flags=flags).run(rows_of(export, {"r": r}), feeds_back=True)
    return {place.split("->")[1]: found[:, i] for i, place in enumerate(export.results[:3])}


def check_long_preview(N: int, folder: Path) -> None:
    r = reference(1500)
    export = make_export("DiscreteInverse", start={**START, "preview": N})
    # each sample is a few thousand operations: optimised, they compile for minutes and run for milliseconds
    found = run(export, np.concatenate([r, np.full(N, r[-1])]), folder, "-O0")
    now, u = inverse(r, N)
    assert found["r_now"][: now.size] == pytest.approx(now, abs=1e-15)
    assert found["u"][: u.size] == pytest.approx(u, rel=1e-9, abs=1e-9 * np.abs(u).max())
    # the plant then follows with the error of the truncation, 1.01^-N
    x = lfilter(K * np.poly([ZERO, INNER]), np.poly(POLES), found["u"])
    error = found["r_now"][1:] - x[:-1]
    assert np.abs(error).max() == pytest.approx(1.01**-N, rel=1e-3)


@nightly
def test_a_long_preview_is_the_inverse_filter(tmp_path: Path) -> None:
    check_long_preview(200, tmp_path)


@nightly
def test_a_long_preview_in_float(tmp_path: Path) -> None:
    """A mass 10 m from zero: the force is that of the second difference."""
    r = 10.0 + 1e-3 * reference(1200)
    runs = {}
    for real in ("double", "float"):
        export = make_export("DiscreteInverse", start={"preview": 100}, real=real)
        runs[real] = run(export, r, tmp_path / real)
    u = runs["double"]["u"]
    assert runs["float"]["u"] == pytest.approx(u, abs=1e-4 * float(np.std(u)))


def test_the_fmu_has_the_preview_it_is_built_with(build_fmu: Callable[..., Path], tmp_path: Path) -> None:
    from fmpy import read_model_description

    path = build("DiscreteInverse", tmp_path, start={"preview": 40}, name="Inverse40")
    variables = {v.name: v for v in read_model_description(str(path)).modelVariables}
    preview = variables["preview"]
    assert (float(preview.start), float(preview.min), float(preview.max)) == (40.0, 40.0, 40.0)
    assert "line[41]" in variables
    assert "line[42]" not in variables
    short = {v.name: v for v in read_model_description(str(build_fmu("DiscreteInverse"))).modelVariables}
    assert (float(short["preview"].start), float(short["preview"].max)) == (12.0, 32.0)
    assert "line[34]" not in short


@pytest.mark.parametrize("value", ["1025", "40.5"])
@pytest.mark.parametrize("command", ["build", "codegen"])
def test_what_does_not_fit_is_refused(
    command: str, value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, "DiscreteInverse", "-o", str(tmp_path / "none"), "--set", f"preview={value}"]) != 0
    said = " ".join(capsys.readouterr().err.split())
    assert f"DiscreteInverse cannot have preview = {value}: above 32, give an integer up to 1024" in said
    assert not (tmp_path / "none").exists()


@nightly
def test_a_preview_of_a_pair_of_zeros(tmp_path: Path) -> None:
    """1.02 exp(+-i pi/3): g[i+1] = sin(i pi/3) / (sin(pi/3) 1.02^(i+1)), as 1.02 p = 1.02^2."""
    N, size = 300, 1.02
    start = {**START, "zero": 0.0, "pair[1]": size / 2.0, "pair[2]": size * np.sqrt(0.75), "preview": N}
    r = reference(1500)
    found = run(make_export("DiscreteInverse", start=start), np.concatenate([r, np.full(N, r[-1])]), tmp_path)
    i = np.arange(N)
    g = np.sin(i * np.pi / 3.0) / np.sin(np.pi / 3.0) * size ** -(i + 1.0)
    s = np.concatenate([r, np.full(N, r[-1])])
    w = np.array([g @ s[k + 1 : k + N + 1] for k in range(r.size)])
    u = np.concatenate([np.zeros(N), lfilter(np.poly(POLES), [K, -K * INNER], w)])
    assert found["u"][: u.size] == pytest.approx(u, abs=1e-9 * np.abs(u).max())


def test_a_law_file_may_not_exceed_its_size() -> None:
    with pytest.raises(FrictionError, match="integer up to 1024"):
        make_export("DiscreteInverse", start={"preview": 5000.0})
