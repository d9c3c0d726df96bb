"""The sheets of drives against hand calculation, their ranges, and what they say of what they leave out."""

from __future__ import annotations

import csv
import itertools
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from drive_axis import COULOMB, rigid, rms, study_folder
from thorough import landing

from friction_fmus.axis.position_map import Grid, PositionMap
from friction_fmus.cli.main import main
from friction_fmus.errors import BuildError
from friction_fmus.export.axis_fit import AxisFit
from friction_fmus.export.identified_axis import IdentifiedAxis, ReferenceMotion, read_axis
from friction_fmus.export.targets import generic, minas, omron_1s, sinumerik, targets, tf5200
from harness.errors import UnitError


def values(folder: Path, name: str) -> dict[str, str]:
    """The values of a sheet, by parameter; the page has the same."""
    with (folder / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    page = (folder / f"{name}.md").read_text(encoding="utf-8")
    assert "not tried on the device" in page
    assert all(f"| {row['name']} | {row['value']} | {row['unit']} |" in page for row in rows)
    assert all("https://" in row["source"] for row in rows) or name == "generic"
    return {row["name"]: row["value"] for row in rows}


def flat(**changes: object) -> IdentifiedAxis:
    """The same axis without viscous friction."""
    return rigid(parameters=COULOMB | {"Fv": 0.0}, **changes)


def test_minas_and_g5_hold_whole_percents_of_the_rated_torque(tmp_path: Path) -> None:
    """0.5 N and 3 N of 12 N are 4.17 % and 25 %."""
    minas.write(flat(), tmp_path, rated="0.012 kN")
    found = values(tmp_path, "minas")
    assert [found[one] for one, _ in minas.NAMES] == ["4", "25", "-25"]
    assert [found[other] for _, other in minas.NAMES] == ["4", "25", "-25"]


def test_one_number_for_coulomb_and_viscous_friction_is_the_mean(tmp_path: Path) -> None:
    """All speeds up to 0.1 m/s are as frequent: 3 N + 20 N.s/m 0.05 m/s = 4 N."""
    minas.write(rigid(), tmp_path, rated="100 N")
    assert values(tmp_path, "minas")[minas.NAMES[1][0]] == "4"
    assert "Viscous friction, 20 N.s/m, is not compensated" in (tmp_path / "minas.md").read_text(encoding="utf-8")


def test_omron_1s_has_tenths_of_a_percent_and_viscous_friction(tmp_path: Path) -> None:
    omron_1s.write(rigid(), tmp_path, rated="12 N")
    found = list(values(tmp_path, "omron-1s").values())
    assert float(found[0]) == pytest.approx(20.0, rel=1e-3)
    assert found[1:] == ["4.2", "25.0", "-25.0"]


def test_generic_has_both_directions_and_the_table_over_position(tmp_path: Path) -> None:
    table = PositionMap(Grid(0.0, 0.1, 4), (1.0, 0.0, -1.0, 0.0), (0.2, 0.2, 0.2, 0.2), 1e-3)
    asymmetric = {"asymmetric": 1.0, "Fc_neg": 4.0, "Fs_neg": 4.0, "vs_neg": 1e-3, "Fv_neg": 10.0}
    generic.write(rigid(parameters=COULOMB | asymmetric, position=table), tmp_path)
    found = values(tmp_path, "generic")
    expected = {"Coulomb friction forward": 3.0, "Coulomb friction backward": 4.0, "viscous friction forward": 20.0}
    for name, value in {
        **expected,
        "viscous friction backward": 10.0,
        "moved mass": 2.0,
        "constant force": 0.5,
    }.items():
        assert float(found[name]) == pytest.approx(value, rel=1e-3), name
    rows = np.loadtxt(tmp_path / "generic-position.csv", delimiter=",", skiprows=1)
    assert rows == pytest.approx(np.array([[0, -0.8, -1.2], [0.1, 0.2, -0.2], [0.2, 1.2, 0.8], [0.3, 0.2, -0.2]]))


@pytest.mark.parametrize("rows", [2, 5])
def test_tf5200_has_the_force_over_the_velocity(tmp_path: Path, rows: int) -> None:
    """3 N at rest and 5 N at 100 mm/s, of 10 N."""
    tf5200.write(rigid(), tmp_path, rated="10 N", rows=str(rows))
    found = {name.removeprefix("frict_comp."): int(value) for name, value in values(tmp_path, "tf5200").items()}
    assert found["table_entries"] == rows
    v, out = (np.array([found[f"table[{i}].{name}"] for i in range(rows)]) for name in ("in", "out"))
    assert (v[0], v[-1]) == (0, 100000)
    assert np.all(np.diff(v) > 0)
    assert out == pytest.approx(300.0 + 200.0 * v / 1e5, abs=1.5)
    assert (found["mode"], found["scaling_factor"], found["position_delay"]) == (3, 1000, 0)


def test_the_rows_are_the_best_of_all() -> None:
    rng = np.random.default_rng(1)
    v, f, weights = np.sort(rng.uniform(size=10)), rng.normal(size=10), rng.uniform(0.1, 1.0, size=10)

    def cost(places: tuple[int, ...]) -> float:
        return float(np.sum(weights * (f - np.interp(v, v[list(places)], f[list(places)])) ** 2))

    for rows in range(2, 8):
        every = [(0, *inner, 9) for inner in itertools.combinations(range(1, 9), rows - 2)]
        found = tuple(tf5200.best_places(v, f, weights, rows))
        assert len(found) == rows
        assert cost(found) == pytest.approx(min(map(cost, every)), rel=1e-12)
    assert tf5200.best_places(v, f, weights, 30) == list(range(10))


class Moved(AxisFit):
    """A fit with a given motion."""

    @property
    def motion(self) -> ReferenceMotion:  # type: ignore[override]
        rd = np.array([0, 0, 1, 1, 1, 1, -1, -1, -1, 0, 1, 1], dtype=float)
        return ReferenceMotion(np.cumsum(rd) - rd, rd, np.zeros(12))


def test_the_current_builds_up_decays_and_is_late() -> None:
    fit, one = Moved(rigid()), np.ones(12)
    assert tf5200.shaped(fit, one, 0.0, 0, 0).tolist() == [1.0] * 12
    assert tf5200.shaped(fit, one, 2.0, 0, 0).tolist() == [0, 0, 0, 0.5, 1, 1, 0, 0.5, 1, 0, 0, 0.5]
    assert tf5200.shaped(fit, one, 0.0, 0, 1).tolist() == [
        1,
        1,
        1,
        1,
        1,
        0.5,
        1,
        1,
        1,
        1,
        1,
        1,
    ]  # before reversals only
    assert tf5200.shaped(fit, one, 0.0, 2, 0).tolist() == [0, 0] + [1.0] * 10
    assert fit.held.tolist() == [0, 0, 1, 1, 1, 1, -1, -1, -1, -1, 1, 1]


def test_the_pulse_of_sinumerik_in_closed_form() -> None:
    """exp(-t/T) from the begin of each motion, and its sum over the samples before for the integral action."""
    q = np.exp(-1e-3 / 5e-3)
    first = np.array([0, 0, *q ** np.arange(10)])
    second, third = -np.array([0] * 6 + [*q ** np.arange(6)]), np.array([0] * 10 + [1, q])
    w = first + second + third
    found = sinumerik.pulse(Moved(rigid()).motion, 5e-3, 1e-3, 7.0, 100.0)
    assert found == pytest.approx(7.0 * w + 0.1 * np.append(0.0, np.cumsum(w)[:-1]), abs=1e-12)


@pytest.fixture(scope="module", params=[False, True], ids=["linear", "rotary"])
def study(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bool]:
    return study_folder(tmp_path_factory.mktemp("study"), request.param)[0], request.param


@landing
def test_all_sheets_of_a_study(study: tuple[Path, bool], tmp_path: Path) -> None:
    """Each reduces the error of the servo, or says that it does not; the numbers are those of a run."""
    folder, rotary = study
    axis = read_axis(folder)
    assert axis.loop is not None
    assert axis.loop.fed is not None
    rated = "20 N.m" if rotary else "20 N"
    for name, target in targets("axis").items():
        if name not in {"generic", "minas", "omron-1s", "tf5200", "sinumerik"}:
            continue
        given = {option.name: {"rated": rated, "rows": "4"}[option.name] for option in target.options}
        paths = target.write(axis, tmp_path, **given)
        assert {path.name for path in paths} >= {f"{name}.md", f"{name}.csv"}
        values(tmp_path, name)
        page = paths[0].read_text(encoding="utf-8")
        assert "| as measured |" in page
        assert re.search(r"leaves [\d.]+ % of the error|do not use it", page), name
        assert "presliding" in page
    force = np.full(len(axis.loop.motion.r), axis.offset)
    assert rms(axis.loop.error(force)) == pytest.approx(axis.loop.fed, rel=1e-6)


def test_the_circle_begins_at_rest_and_stays_in_the_range_of_the_record() -> None:
    r = np.linspace(5.0, 1.0, 100)
    path = sinumerik.circle(ReferenceMotion(r, r, r), 1e-3, 1.0, 2.0 * np.pi)
    assert len(path.r) == 2000
    assert (path.r[0], path.rd[0]) == (5.0, 0.0)
    assert (np.min(path.r), np.max(path.r)) == (pytest.approx(3.0), 5.0)
    assert np.gradient(path.r, 1e-3)[1:-1] == pytest.approx(path.rd[1:-1], abs=1e-3)
    assert np.gradient(path.rd, 1e-3)[1:-1] == pytest.approx(path.rdd[1:-1], abs=1e-2)


@pytest.mark.parametrize(
    ("target", "axis", "options", "message"),
    [
        (minas, flat(), {}, "parts of its rated force: give it at the axis"),
        (minas, flat(), {"rated": "12"}, "give it at the axis"),
        (minas, flat(), {"rated": "-12 N"}, "give it at the axis"),
        (minas, flat(), {"rated": "12 s"}, r"--rated is given in \[s\] but has the unit \[N\]"),
        (
            minas,
            flat(),
            {"rated": "2 N"},
            "Pr6.08 .* would be 150 % of the rated force, but the device takes at most 100 %",
        ),
        (omron_1s, flat(offset=50.0), {"rated": "10 N"}, "02 Unbalanced Load .* would be 500"),
        (tf5200, rigid(), {"rated": "4 N"}, r"frict_comp.table\[\d+\].out would be 1\d\d"),
        (tf5200, rigid(), {"rated": "40 N", "rows": "21"}, "--rows 21: the table has 2 to 20 rows"),
        (tf5200, rigid(), {"rated": "40 N", "rows": "two"}, "--rows two"),
        (sinumerik, rigid(), {}, "SINUMERIK needs servo and mass"),
        (generic, rigid(speed=0.0), {}, "slide does not move, or has no position"),
    ],
)
def test_what_a_device_does_not_take(
    tmp_path: Path, target: ModuleType, axis: IdentifiedAxis, options: dict[str, str], message: str
) -> None:
    with pytest.raises((BuildError, UnitError), match=message):
        target.write(axis, tmp_path, **options)
    assert not list(tmp_path.iterdir())


def test_a_friction_that_follows_the_drive_force_needs_a_servo(tmp_path: Path) -> None:
    """Without one, it would be the friction under 1 N."""
    own = {"mu_avg": 0.2, "mu_dif": 0.05, "eps": 1e-3, "Fv": 0.0}
    axis = rigid(model="LoadDependentDahl", label="LoadDependentDahl", parameters=own)
    with pytest.raises(BuildError, match="follows the force of the drive"):
        generic.write(axis, tmp_path)


def test_what_is_lost_of_a_model(tmp_path: Path) -> None:
    lugre = {"sigma0": 1e5, "sigma1": 300.0, "sigma2": 0.4, "Fc": 1.0, "Fs": 1.5, "vs": 1e-3}
    table = PositionMap(Grid(0.0, 0.1, 4), (1.0, 0.0, -1.0, 0.0), (0.0,) * 4, 1e-3)
    minas.write(rigid(model="LuGre", label="LuGre", parameters=lugre, position=table), tmp_path, rated="10 N")
    page = (tmp_path / "minas.md").read_text(encoding="utf-8")
    for lost in ("Static friction, 1.5 N", "builds up over 15 µm", "The force over position is not", "0.4 N.s/m"):
        assert lost in page
    assert "Unknown: this needs a study" in page


def test_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, _ = study_folder(tmp_path)
    assert main(["export", str(folder), "--to", "minas", "--rated", "20 N", "-o", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().out.splitlines() == [str(tmp_path / "out" / f"minas.{end}") for end in ("md", "csv")]
    for arguments, message in {
        ("--to", "minas"): "generic needs RESULT",
        (str(folder), "--to", "modelica"): "leave out RESULT",
        (
            str(folder),
            "--to",
            "generic",
            "--rows",
            "3",
        ): "the target generic has no option rows: choose the target tf5200",
        (str(tmp_path / "nowhere"), "--to", "generic"): "is no result",
        (str(folder), "--to", "generic", "--model", "Lugre"): "did you mean LuGre",
    }.items():
        assert main(["export", *arguments]) == 2
        assert message.replace("generic needs", "minas needs") in " ".join(capsys.readouterr().err.split())


def test_a_study_without_its_archive_has_no_simulated_error(tmp_path: Path) -> None:
    folder, _ = study_folder(tmp_path)
    (folder / "recommended" / "axis.ssp").unlink()
    axis = read_axis(folder)
    assert axis.loop is None
    page = generic.write(axis, tmp_path / "out")[0].read_text(encoding="utf-8")
    assert "Unknown: this needs a study" in page
