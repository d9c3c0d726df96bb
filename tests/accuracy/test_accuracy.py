"""The error that a run states: against closed forms, and in what it refuses, keeps and writes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from accuracy.known import decay, driven, free, sampled
from thorough import landing, nightly, some

from friction_fmus.__main__ import main
from friction_fmus.cli.inputs import open_system
from harness import Experiment, ExperimentError, Noise, System, load_result, plot, sweep
from harness.errors import Interrupted

EXAMPLE = Path(__file__).parents[2] / "examples" / "stick_slip.toml"


@pytest.mark.parametrize(
    ("master", "step", "order"),
    some(
        [("newton", 0.02, 2.0), ("gauss-seidel", 2e-3, 1.0), ("jacobi", 2e-3, 1.0)],
        [("newton", 0.02, 2.0)],
    ),
)
def test_a_decay_has_the_error_of_its_closed_form(master: str, step: float, order: float) -> None:
    with decay() as system:
        result = system.run(stop=2.0, step=step, master=master, record=["mass.v"], accuracy=True)
    error = np.abs(result["mass.v"].to_numpy() - np.exp(-2.0 * result["time"].to_numpy()))
    bound = result["mass.v.bound"].to_numpy()
    assert error.max() > 1e-6
    assert (error <= bound).all()
    assert bound.max() < 3.0 * error.max()
    assert result["mass.v"].attrs["observed_order"] == pytest.approx(order, abs=0.1)
    assert result["mass.v"].attrs["verdict"] == "within tolerance"
    assert result.attrs["accuracy"] == "within tolerance"
    assert "suggested_step" not in result.attrs


@pytest.mark.parametrize("part", ["mass", "friction"])
def test_how_long_a_continuous_part_holds_its_inputs_is_part_of_the_error(part: str) -> None:
    """One of both steps every fifth communication step, in the repetitions too."""
    with decay() as system:
        system.parts[part].every = 5
        result = system.run(stop=2.0, step=1e-3, master="newton", record=["mass.v"], accuracy=True)
    error = np.abs(result["mass.v"].to_numpy() - np.exp(-2.0 * result["time"].to_numpy()))
    bound = result["mass.v.bound"].to_numpy()
    assert error.max() > 1e-3
    assert (error <= bound).all()
    assert bound.max() < 10.0 * error.max()


def test_the_suggested_step_reaches_what_is_required() -> None:
    with decay() as system:
        coarse = system.run(stop=2.0, step=2e-3, master="gauss-seidel", accuracy=1e-4)
        assert coarse.attrs["accuracy"] == "step too long"
        step = coarse.attrs["suggested_step"]
        assert coarse.attrs["step"] / step == pytest.approx(round(coarse.attrs["step"] / step), abs=1e-9)
        fine = system.run(stop=2.0, step=step, master="gauss-seidel", accuracy=1e-4)
    assert fine.attrs["accuracy"] == "within tolerance"
    assert np.abs(fine["mass.v"].to_numpy() - np.exp(-2.0 * fine["time"].to_numpy())).max() < 1e-4


def test_no_step_is_suggested_where_tolerances_leave_more_than_is_required() -> None:
    """A loop tolerance of 1e-4 moves the decay by more than 1e-5; with the suggested one, the decay is right."""
    with decay() as system:
        settings = {"stop": 2.0, "step": 1e-3, "master": "newton", "record": ["mass.v"], "accuracy": 1e-5}
        coarse = system.run(**settings, loop_tolerance=1e-4)  # type: ignore[arg-type]
        assert coarse.attrs["accuracy"] == "step too long"
        assert coarse.attrs["tolerance_source"] == "loop_tolerance"
        assert coarse.attrs["tolerance_error"] > 1e-5
        assert "suggested_step" not in coarse.attrs
        fine = system.run(**settings, loop_tolerance=1e-8)  # type: ignore[arg-type]
    assert fine.attrs["accuracy"] == "within tolerance"
    assert np.abs(fine["mass.v"].to_numpy() - np.exp(-2.0 * fine["time"].to_numpy())).max() < 1e-5


def test_the_command_names_the_tolerance_to_lower(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["run", str(EXAMPLE), "--stop", "2", "--master", "newton", "-o", str(tmp_path / "out.nc")]
    assert main([*command, "--require", "1e-7"]) == 1
    shown = capsys.readouterr().out
    assert "loop_tolerance limits the accuracy to about 3e-07 of the range" in shown
    assert "set loop_tolerance = 4e-09 in [experiment]" in shown


def test_the_run_itself_is_the_one_without_accuracy() -> None:
    with driven("LuGre") as system:
        plain = system.run(stop=0.2, step=1e-3, master="newton", record=["mass.*"])
        told = system.run(stop=0.2, step=1e-3, master="newton", record=["mass.*"], accuracy=True)
    bounds = {f"{name}.bound" for name in plain.data_vars}
    assert set(told.data_vars) == set(plain.data_vars) | bounds
    for name in plain.data_vars:
        assert np.array_equal(told[name], plain[name])
        assert told[f"{name}.bound"].attrs.get("units") == plain[name].attrs.get("units")
    assert plain.attrs.items() <= told.attrs.items()


@nightly
def test_parts_sample_as_before_and_afterwards() -> None:
    """Four steps for each sample leave room for longer ones; one step does not, so that shorter ones are tried."""
    for every, observed in ((4, True), (1, False)):
        with sampled(every) as system:
            before = [part.every for part in system.parts.values()]
            result = system.run(stop=0.4, step=0.5e-3 / every, master="newton", accuracy=True)
            assert [part.every for part in system.parts.values()] == before
        assert result.attrs["accuracy"] == "within tolerance"
        assert math.isfinite(result["axis.v"].attrs["observed_order"]) == observed


def test_a_slip_that_comes_late_is_an_error_of_time() -> None:
    with open_system(EXAMPLE) as system:
        result = system.run(stop=9.5, step=1e-3, master="gauss-seidel", accuracy=True)
        right = system.run(stop=9.5, step=2e-5, master="newton")
    force = result["friction.F"]
    late = force.attrs["event_error"]
    assert 1e-3 < late < 0.02
    slips = [float(each["time"][int(np.argmax(each["friction.F"].to_numpy()))]) for each in (result, right)]
    assert abs(slips[0] - slips[1]) <= late


def followed(K: float = 3e4) -> tuple[System, float]:
    """A mass whose spring is pulled at 1 mm/s, on a spring K for its contact, and its velocity k/(k + K) 1 mm/s.

    Its period is a tenth of 0.1 ms. While the force of the contact is held, the mass is as fast as the support, K/k too
    fast, whichever the step.
    """
    m, k, d, pulled = 4e-6, 2e6, 2.0, 1e-3
    start = {"mass.m": m, "mass.k": k, "mass.d": d, "mass.v_support": pulled}
    system = free("MaxwellSlip", start | {"friction.N": 1, "friction.k[1]": K, "friction.W[1]": 1e9})
    experiment = Experiment(stop=0.02, step=1e-4, record=("mass.v",))
    return System(system.parts.values(), system.wires, system.start, experiment), pulled * k / (k + K)


@pytest.mark.parametrize(("K", "verdict"), [(3e4, "not certain"), (7e4, "invalid")])
@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi"])
def test_a_motion_that_no_step_resolves_is_not_called_right(master: str, K: float, verdict: str) -> None:
    system, v = followed(K)
    with system:
        result = system.run(master=master, accuracy=True)
        newton = system.run(master="newton")
    assert newton["mass.v"].to_numpy()[20:] == pytest.approx(v, rel=1e-3)
    error = np.abs(result["mass.v"].to_numpy() - v)[2:]
    assert error.max() > 0.01 * v
    assert result.attrs["accuracy"] == verdict or master == "jacobi"
    assert result.attrs["accuracy"] != "within tolerance"
    assert (error <= result["mass.v.bound"].to_numpy()[2:]).all()


def test_a_measure_of_a_motion_that_no_step_resolves_has_a_bound() -> None:
    system, v = followed()
    experiment = Experiment(stop=0.02, step=1e-4, master="gauss-seidel")
    with system:
        table = sweep(system, [{}], measure="final(mass.v)", experiment=experiment, executor="serial", accuracy=True)
    error = abs(float(table["final(mass.v)"][0]) - v)
    assert 0.01 * v < error <= float(table["final(mass.v).bound"][0])


def test_the_command_says_what_to_do_where_newton_differs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    system, _ = followed()
    with system:
        system.to_toml(tmp_path / "followed.toml")
    command = ["run", str(tmp_path / "followed.toml"), "-o", str(tmp_path / "out.nc"), "--master", "gauss-seidel"]
    assert main([*command, "--accuracy"]) == 0
    shown = capsys.readouterr().out
    assert "not certain" in shown and "use --master newton" in shown
    assert main([*command, "--require", "1e-2"]) == 1


def test_what_cannot_be_told_is_refused_before_the_run(tmp_path: Path) -> None:
    with driven("LuGre") as system:
        for settings, reason in (
            ({"manipulators": [Noise("friction.v", 1e-6)]}, "draws a random number in each step"),
            ({"checkpoint": tmp_path / "state"}, "run it as a whole"),
            ({"accuracy": 2.0}, "required accuracy is 2.0"),
            ({"stop": 0.004}, "too short to tell its accuracy"),
        ):
            with pytest.raises(ExperimentError, match=reason):
                system.run(**{"stop": 0.2, "step": 1e-3, "accuracy": True, **settings})  # type: ignore[arg-type]
    assert not [*tmp_path.iterdir()]


@landing
def test_the_command_shows_a_table_and_its_status_is_that_of_the_requirement(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = ["run", str(EXAMPLE), "--stop", "10", "-o", str(tmp_path / "out.nc")]
    assert main([*run, "--accuracy", "--plot", str(tmp_path / "out.png")]) == 0
    shown = capsys.readouterr().out
    assert "error bound" in shown and "largest coupling error: " in shown
    assert "3 variables" in shown
    assert main([*run, "--require", "1e-6"]) == 1
    assert "the required accuracy of 1e-06 is not reached" in capsys.readouterr().out
    assert main([*run, "--require", "1e-6", "--allow-inaccurate"]) == 0
    kept = load_result(tmp_path / "out.nc")
    assert kept["mass.x"].attrs["verdict"] in {"within tolerance", "step too long"}
    plot(kept, tmp_path / "again.png")
    assert (tmp_path / "again.png").stat().st_size > 10_000


class Impatient:
    """Progress that interrupts when the run itself is over."""

    def update(self, done: int, total: int) -> None:
        """As Ctrl-C does."""
        if done > 0.7 * total:
            raise KeyboardInterrupt


def test_an_interrupted_estimate_keeps_the_run() -> None:
    with driven("LuGre") as system:
        plain = system.run(stop=0.2, step=1e-3, master="newton")
        with pytest.raises(Interrupted) as interrupted:
            system.run(stop=0.2, step=1e-3, master="newton", accuracy=True, progress=Impatient())
    kept = interrupted.value.result
    assert kept is not None
    assert np.array_equal(kept["mass.x"], plain["mass.x"])
