"""``friction-fmus sweep``."""

from __future__ import annotations

import ast
import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from thorough import nightly

from friction_fmus import fmu
from friction_fmus.__main__ import main
from harness import CallablePart, ExperimentError, System, sweep

ROOT = Path(__file__).parents[2]

SYSTEM = """
wires = []

[experiment]
stop = 1.0
step = 0.25

[parts.mass]
model = "Mass"
start = { F_drive = 3.0, F_friction = 0.0 }
"""


@pytest.fixture
def system(tmp_path: Path) -> Path:
    path = tmp_path / "system.toml"
    path.write_text(SYSTEM, encoding="utf-8")
    return path


def swept(system: Path, *arguments: str) -> pd.DataFrame:
    out = system.parent / "out"
    assert main(["sweep", str(system), "-o", str(out), "--executor", "serial", *arguments]) == 0
    return pd.read_parquet(out).sort_values("run", ignore_index=True)


def test_grid_of_lists_and_ranges(system: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vary = ["--vary", "mass.m=0.5:2:4", "--vary", "mass.v0=1,-1", "--vary", "mass.F_drive=1:100:3:log"]
    table = swept(system, *vary, "--measure", "final(mass.v)", "--stop", "2")
    m, v0, force = np.meshgrid([0.5, 1.0, 1.5, 2.0], [1.0, -1.0], [1.0, 10.0, 100.0], indexing="ij")
    np.testing.assert_allclose(table["mass.F_drive"], force.ravel(), rtol=1e-12)
    np.testing.assert_allclose(table["final(mass.v)"], (v0 + 2.0 * force / m).ravel(), rtol=1e-12)
    assert capsys.readouterr().out.strip().endswith("out: 24 runs")


def test_the_first_runs_are_shown_with_parameters_and_results(
    system: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("friction_fmus.cli.console.console.width", 60)
    swept(system, "--vary", "mass.m=-1,0.5,1,2", "--vary", "mass.F_drive=1,2,3", "--measure", "final(*)")
    names, units, *rows, more, last = capsys.readouterr().out.splitlines()
    assert names.split() == ["mass.m", "mass.F_drive"]
    assert units.split() == ["run", "[kg]", "[N]", "final(mass.x)", "final(mass.v)"]
    assert len(rows) == 10
    assert [row.split() for row in rows[:4]] == [
        ["0", "-1", "1", "failed"],
        ["1", "-1", "2", "failed"],
        ["2", "-1", "3", "failed"],
        ["3", "0.5", "1", "1", "2"],
    ]
    assert all(len(row) <= 60 for row in rows)
    assert more == "... 2 more runs, 3 more results: use -o FILE.csv"
    assert last.startswith(f"{system.parent / 'out'}: 12 runs, 3 failed")


def test_values_may_have_a_unit(system: Path) -> None:
    varied = ("--vary", "mass.F_drive=1:3:2 N", "--vary", "mass.x0=0,10 mm", "--vary", "mass.m=500:2000:log g")
    table = swept(system, *varied, "--latin-hypercube", "4")
    assert table["mass.F_drive"].tolist() == [*[1.0] * 8, *[3.0] * 8]
    assert table["mass.x0"].tolist() == [*[0.0] * 4, *[0.01] * 4] * 2
    assert table["mass.m"].between(0.5, 2.0).all()
    np.testing.assert_allclose(table["final(mass.v)"], table["mass.F_drive"] / table["mass.m"], rtol=1e-12)


def test_random_points_with_a_grid_around_them(system: Path) -> None:
    table = swept(system, "--vary", "mass.m=0.5:2:log", "--vary", "master=jacobi,gauss-seidel", "--sobol", "4")
    assert list(table["master"]) == ["jacobi"] * 4 + ["gauss-seidel"] * 4
    assert len(set(table["mass.m"])) == 4
    assert table["mass.m"].between(0.5, 2.0).all()
    np.testing.assert_allclose(table["final(mass.v)"], 3.0 / table["mass.m"], rtol=1e-12)


def test_parameter_sets_of_a_file_and_runs_that_fail(system: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (system.parent / "sets.csv").write_text("mass.m,mass.x0\n2,0\n-1,0\n4,1\n", encoding="utf-8")
    table = swept(system, "--samples", str(system.parent / "sets.csv"))
    np.testing.assert_allclose(table["final(mass.x)"], [0.75, np.nan, 1.375], rtol=1e-12)
    assert "out: 3 runs, 1 failed; first error: mass rejected the start value -1" in capsys.readouterr().out


def test_a_sweep_of_which_no_run_succeeds_has_the_status_1(system: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = system.parent / "none"
    assert main(["sweep", str(system), "-o", str(folder), "--executor", "serial", "--vary", "mass.m=-1,-2"]) == 1
    assert "2 runs, 2 failed; first error: mass rejected the start value -1" in capsys.readouterr().out
    assert len(pd.read_parquet(folder)) == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "nothing is varied"),
        (["--vary", "mass.m"], "is not NAME=VALUES"),
        (["--vary", "mass.m=1:x:3"], "is not a range"),
        (["--vary", "mass.m=1:2:0"], "has 0 values"),
        (["--vary", "mass.m=0:2:3:log"], "logarithmic scale"),
        (["--vary", "mass.m=1:2"], "mass.m has no count of values"),
        (["--vary", "mass.m=1", "--vary", "mass.m=2"], "names mass.m twice"),
        (["--vary", "mass.mm=1"], "did you mean 'm'"),
        (["--vary", "mass.m=a"], "'a' is no value of mass.m"),
        (["--vary", "mass.m=1,2 N"], "mass.m is given in [N] but has the unit [kg]"),
        (["--vary", "mass.m=1:2", "--sobol", "5"], "give a power of 2"),
        (["--samples", "sets.xlsx"], "no known format"),
        (["--vary", "mass.m=1", "--scheduler", "tcp://127.0.0.1:9"], "no dask scheduler answers"),
    ],
)
def test_senseless_options_are_one_sentence(
    system: Path,
    arguments: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("friction_fmus.cli.inputs.PATIENCE", 0.2)
    assert main(["sweep", str(system), "-o", str(system.parent / "out"), *arguments]) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.err.count("\n") == 1


def test_scheduler_of_a_cluster(system: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=1, processes=False, dashboard_address=None, protocol="tcp") as cluster:
        out = str(system.parent / "out")
        options = ["--scheduler", cluster.scheduler_address, "--measure", "final(mass.v)"]
        assert main(["sweep", str(system), "-o", out, "--vary", "mass.m=1,2", *options]) == 0
    table = pd.read_parquet(out).sort_values("run")
    np.testing.assert_allclose(table["final(mass.v)"], [3.0, 1.5], rtol=1e-12)


@nightly
def test_page_of_sweeps_tells_the_truth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "sweeps.md").read_text(encoding="utf-8")
    (commands,) = re.findall(r"<!-- commands -->\n```sh\n(.*?)^```$", text, re.S | re.M)
    for command, runs in zip(commands.splitlines(), (12, 16), strict=True):
        assert main(shlex.split(command)[1:]) == 0
        assert capsys.readouterr().out.strip().endswith(f": {runs} runs")
    (program,) = re.findall(r"<!-- python -->\n```python\n(.*?)^```$", text, re.S | re.M)
    (tmp_path / "program.py").write_text(program, encoding="utf-8")
    done = subprocess.run([sys.executable, "program.py"], cwd=tmp_path, capture_output=True, text=True)
    slips, rows = done.stdout.splitlines()
    assert rows == "3", done.stderr
    # counted once more, in runs of one system without a sweep
    with System.from_toml(ROOT / "examples" / "stick_slip.toml", fmu) as system:
        for run, m in enumerate((0.5, 1.0, 2.0)):
            v = system.with_start({"mass.m": m}).run(stop=10.0)["mass.v"].to_numpy()
            assert ast.literal_eval(slips)[run] == int(((v[1:] > 1e-3) & (v[:-1] <= 1e-3)).sum()) > 0


def test_a_sweep_without_a_folder_prints_and_one_into_a_csv_file_is_a_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["sweep", str(ROOT / "examples" / "stick_slip.toml"), "--stop", "0.01", "--master", "newton"]
    command += ["--executor", "serial", "--vary", "friction.Fc=1,1.2", "--measure", "final(mass.x)"]
    assert main([*command, "-o", str(tmp_path / "t.csv")]) == 0
    assert "2 runs, workers: serial" in capsys.readouterr().err
    assert list(pd.read_csv(tmp_path / "t.csv")["friction.Fc"]) == [1.0, 1.2]
    assert main([*command, "--json"]) == 0
    assert [row["friction.Fc"] for row in json.loads(capsys.readouterr().out)] == [1.0, 1.2]
    assert [path.name for path in tmp_path.iterdir()] == ["t.csv"]


def test_settings_of_a_sweep_can_be_a_mapping_or_come_from_the_samples() -> None:
    def make() -> System:
        return System([CallablePart("p", lambda t, u, x: 2.0 * u[0], ["u"], ["y"])], start={"p.u": 1.0})

    for settings, samples in (
        ({"stop": 2.0, "step": 1.0}, [{"p.u": 3.0}]),
        (None, [{"p.u": 3.0, "stop": 2.0, "step": 1.0}]),
    ):
        found = sweep(make, samples, executor="serial", experiment=settings)
        assert found["final(p.y)"].to_numpy() == [6.0]
    with pytest.raises(ExperimentError, match="no setting 'stpe'"):
        sweep(make, [{}], executor="serial", experiment={"stop": 1.0, "stpe": 1.0})
