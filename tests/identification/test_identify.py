"""Parameters of friction blocks from computed records whose parameters are known."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from contacts import LUGRE, dahl_force, lugre_force, lugre_motion, noise, reversals, stribeck_force
from thorough import nightly, some

import friction_fmus
from friction_fmus import identify
from friction_fmus.data import EMPS_PUBLISHED, load_emps
from friction_fmus.identification import (
    LINEAR,
    PUBLISHED_SETTINGS,
    ROTARY,
    FitError,
    IdentificationError,
    Record,
    RecordError,
    identifiable,
)
from friction_fmus.identification.fit.contact_model import contact_model
from harness import Drive, FmuPart, read_ssv

STEP = 1e-3
Truth = tuple[Record, np.ndarray]
OTHERS = [name for name in identifiable() if name not in ("LuGre", "Dahl", "Stribeck", "LoadDependentDahl")]
"""The last one needs a drive force, see test_transmitted_force.py."""


@pytest.fixture(scope="module")
def lugre() -> tuple[Record, np.ndarray]:
    t, v = lugre_motion(3000, STEP)
    force = lugre_force(t, v)
    return Record("LuGre", t, v=v, friction=force + noise(1, len(t))), force


def dahl_record(seed: int, begin: float = 0.0, samples: int = 300) -> Record:
    q = reversals(samples, 2e-4)
    force = dahl_force(q, 1e5, 2.0, begin)
    return Record("Dahl", STEP * np.arange(samples), q=q, friction=force + noise(seed, samples))


def sliding_record(outliers: int = 0, fastest: float = 0.05, slowest: float = 1e-3) -> Record:
    random = np.random.default_rng(5)
    speed = np.geomspace(slowest, fastest, 400)
    v = np.concatenate([speed, -speed])
    force = stribeck_force(v, 10.0, 15.0, 5e-3, 100.0) + 0.05 * random.standard_normal(len(v))
    force[random.choice(len(v), outliers, replace=False)] += 30.0
    return Record("sliding", STEP * np.arange(len(v)), v=v, friction=force)


@nightly
def test_lugre_is_found_within_a_fifth_of_a_percent_from_starts_three_times_off(
    lugre: Truth,
) -> None:
    record, _ = lugre
    random = np.random.default_rng(2)
    for _ in range(3):
        start = {name: value * 3.0 ** random.choice([-1, 1]) for name, value in LUGRE.items()}
        found = identify("LuGre", record, start=start).values()
        for name in ("sigma0", "sigma1", "Fc", "Fs", "vs"):
            assert found[name] == pytest.approx(LUGRE[name], rel=2e-3), name


@nightly
def test_without_start_values_the_data_give_them(lugre: Truth) -> None:
    record, force = lugre
    result = identify("LuGre", record)
    assert result.method == "output-error" and result.errors == "classic"
    assert result.values()["sigma0"] == pytest.approx(LUGRE["sigma0"], rel=2e-3)
    assert np.sqrt(np.mean((result.predicted - force) ** 2)) < 2e-3
    assert result.train.rms == pytest.approx(0.01, rel=0.05)
    assert set(result.weak) <= {"Fc", "sigma2", "sigma1"}


def test_the_inverse_model_of_the_emps_axis_is_the_published_one() -> None:
    result = identify("Stiction", load_emps(), settings=PUBLISHED_SETTINGS)
    assert result.method == "inverse" and result.signal == "force"
    for name, value in EMPS_PUBLISHED.items():
        assert result.values()[name] == pytest.approx(value, rel=1e-5), name
    assert "does not depend on it" in result.weak["Fs"]
    assert np.isnan(result.parameters["Fs"].standard_error)


@nightly
def test_intervals_cover_the_truth_in_95_of_100_records() -> None:
    hits = dict.fromkeys(("sigma", "Fc"), 0)
    for seed in range(200):
        result = identify("Dahl", dahl_record(seed), fixed={"n": 1.0}, start={"sigma": 1.2e5, "Fc": 1.8})
        for name, value in (("sigma", 1e5), ("Fc", 2.0)):
            estimate = result.parameters[name]
            hits[name] += abs(estimate.value - value) < 1.96 * estimate.standard_error
    assert all(0.90 * 200 <= count <= 0.99 * 200 for count in hits.values()), hits


def test_correlated_errors_make_the_standard_errors_robust_and_larger() -> None:
    record = dahl_record(3)
    slow = 0.1 * np.sin(2.0 * np.pi * np.arange(len(record)) / 150.0)
    drifting = Record("drifting", record.t, q=record.q, friction=record.column("friction") + slow)
    white, robust = (identify("Dahl", each, fixed={"n": 1.0}) for each in (record, drifting))
    assert (white.errors, robust.errors) == ("classic", "robust")
    assert robust.parameters["Fc"].standard_error > 3.0 * white.parameters["Fc"].standard_error


def test_a_robust_loss_makes_little_of_outliers() -> None:
    record = sliding_record(outliers=60)
    plain, robust = (identify("Stribeck", record, loss=loss).values() for loss in ("linear", "soft_l1"))
    assert robust["Fc"] == pytest.approx(10.0, rel=0.02)
    assert robust["Fs"] == pytest.approx(15.0, rel=0.02)
    assert abs(robust["OF"]) < 0.1 < abs(plain["OF"])


def test_a_record_without_slow_motion_leaves_the_stribeck_velocity_open_and_says_what_to_measure() -> None:
    result = identify("Stribeck", sliding_record(slowest=0.03))
    assert {"Fs", "vs"} & set(result.weak)
    assert all("; measure " in reason for reason in result.weak.values())


def test_fixed_parameters_stay_and_named_ones_are_freed() -> None:
    record = sliding_record()
    held = identify("Stribeck", record, fixed={"vs": 6e-3})
    assert "vs" not in held.parameters and held.values()["vs"] == 6e-3
    freed = identify("Stribeck", record, start={"delta": 1.5})
    assert freed.values()["delta"] == pytest.approx(2.0, rel=0.1)
    bounded = identify("Stribeck", record, bounds={"Fc": (11.0, 12.0)})
    assert bounded.values()["Fc"] == pytest.approx(11.0, rel=1e-6)
    assert "bound 11" in bounded.weak["Fc"]


def test_pieces_of_a_measurement_begin_each_in_a_state_of_its_own() -> None:
    records = [dahl_record(7, begin=1.5e-5), dahl_record(8, begin=-1e-5)]
    result = identify("Dahl", records, fixed={"n": 1.0})
    assert result.initial["z"].value == pytest.approx(1.5e-5, abs=4.0 * result.initial["z"].standard_error)
    assert result.initial["z (2)"].value == pytest.approx(-1e-5, abs=4.0 * result.initial["z (2)"].standard_error)
    assert result.values()["sigma"] == pytest.approx(1e5, rel=0.01)


def test_a_validation_record_is_predicted_with_its_own_initial_state() -> None:
    result = identify("Dahl", dahl_record(1), fixed={"n": 1.0}, validation=dahl_record(2, begin=1.2e-5))
    assert result.validation is not None
    assert result.validation.rms == pytest.approx(0.01, rel=0.15)


def test_friction_and_normal_force_give_the_coefficient_at_the_mean_load() -> None:
    q, t = reversals(400, 2e-4), STEP * np.arange(400)
    normal = 5.0 + np.sin(2.0 * np.pi * 7.0 * t)
    friction = dahl_force(q, 1e5, 2.0) * normal / 5.0
    result = identify("Dahl", Record("loaded", t, q=q, friction=friction, normal=normal), fixed={"n": 1.0, "Fn0": 5.0})
    assert (result.signal, result.unit) == ("mu", "1")
    assert result.values()["Fc"] == pytest.approx(2.0, rel=1e-4)
    lifted = Record("lifted", t, q=q, friction=friction, normal=normal - 4.5)
    with pytest.raises(RecordError, match="loaded"):
        identify("Dahl", lifted)


def test_a_rotary_axis_takes_the_rotational_twin() -> None:
    record = dahl_record(4)
    rotary = Record("rotary", record.t, q=record.q, friction=record.friction, units=ROTARY)
    result = identify("Dahl", rotary, fixed={"n": 1.0})
    assert (result.parameters["sigma"].unit, result.initial["z"].unit) == ("N.m/rad", "rad")
    assert result.values()["sigma"] == pytest.approx(1e5, rel=0.02)


def test_the_result_becomes_fmu_parameter_set_picture_and_prediction(tmp_path: Path) -> None:
    record = dahl_record(5)
    result = identify("Dahl", record, fixed={"n": 1.0})
    predicted = result.predict(record)
    np.testing.assert_allclose(predicted, result.predicted, atol=1e-6)
    bare = Record("bare", record.t, q=record.q)
    np.testing.assert_allclose(result.predict(bare), dahl_force(reversals(300, 2e-4), 1e5, 2.0), atol=0.05)

    fmu = result.to_fmu(tmp_path, "Contact")
    assert fmu == tmp_path / "Contact.fmu"
    drive = Drive(FmuPart("contact", fmu))
    v = np.append(np.diff(record.column("q")) / STEP, 0.0)
    rows = drive.run({"v": v}, ["F"], STEP, start={"z": result.initial["z"].value})
    drive.close()
    np.testing.assert_allclose(rows[:, 0] + result.values()["OF"], result.predicted, atol=1e-6)

    written = read_ssv(result.to_ssv(tmp_path / "contact.ssv")).parameters
    assert written["sigma"].value == result.values()["sigma"] and written["sigma"].unit == "N/m"
    assert "OF" not in written
    assert result.plot(tmp_path / "contact.png").stat().st_size > 10_000


@pytest.mark.parametrize("signal", ["friction", "force"])
def test_a_parameter_named_as_a_coefficient_of_the_load_is_that_of_the_model(signal: str) -> None:
    """ResetIntegrator: F = (1 + a) sigma0 z below z0, sigma0 z0 at it; on an axis with a mass too."""
    t = STEP * np.arange(3000)
    q = 3e-4 * np.sin(2.0 * np.pi * 0.7 * t) + 1e-4 * np.sin(2.0 * np.pi * 2.3 * t)
    z, deflection = 0.0, []
    for step in np.diff(q, prepend=0.0):
        deflection.append(z := min(max(z + step, -1e-4), 1e-4))
    at = np.array(deflection)
    friction = np.where(np.abs(at) < 1e-4, 1.4, 1.0) * 1e5 * at + noise(9, len(t))
    a = -4.0 * np.pi**2 * (0.49 * 3e-4 * np.sin(1.4 * np.pi * t) + 5.29 * 1e-4 * np.sin(4.6 * np.pi * t))
    given = {"friction": friction} if signal == "friction" else {"force": friction + 20.0 * a}
    record = Record("reset", t, q=q, **given)
    values = identify("ResetIntegrator", record, fixed={"beta": 0.0}, method="output-error").values()
    assert values["a"] == pytest.approx(0.4, abs=0.01)
    assert values["sigma0"] == pytest.approx(1e5, rel=0.01)
    assert values["z0"] == pytest.approx(1e-4, rel=0.01)


def test_a_term_with_the_name_of_a_parameter_is_refused() -> None:
    record = load_emps()
    with pytest.raises(FitError, match="ResetIntegrator has a parameter a of its own, as load has; omit load"):
        identify("ResetIntegrator", record, terms=("load",))


@pytest.mark.parametrize("model", some(OTHERS, ["GMS", "Stiction"]))
def test_every_model_that_is_offered_is_identified(model: str) -> None:
    q = reversals(400, 2e-4)
    record = Record("any", STEP * np.arange(400), q=q, friction=dahl_force(q, 1e5, 2.0) + noise(9, 400))
    result = identify(model, record, starts=1)
    assert result.train.relative_percent < 100.0
    assert all(np.isfinite(value) for value in result.values().values())
    assert result.correlation.shape == (len(result.parameters) + len(result.initial),) * 2
    assert np.isfinite(result.bic) and np.isfinite(result.aic)


@pytest.mark.parametrize(
    ("wishes", "message"),
    [
        ({"fixed": {"sigm": 1.0}}, "did you mean sigma"),
        ({"fixed": {"M": 1.0}}, "not a parameter of Dahl"),
        ({"fixed": {"n": -1.0}}, "outside"),
        ({"fixed": {"n": 1.0}, "start": {"n": 1.0}}, "fixed and also has bounds"),
        ({"bounds": {"Fc": (2.0, 1.0)}}, "give the lower one first"),
        ({"bounds": {"Fc": (1.0, 2.0)}, "start": {"Fc": 3.0}}, "outside its bounds"),
        ({"loss": "l1"}, "no loss"),
        ({"method": "inverse"}, "output-error"),
        ({"starts": -1}, "at least 1"),
    ],
)
def test_wishes_that_cannot_be_met_are_refused(wishes: dict[str, object], message: str) -> None:
    with pytest.raises(FitError, match=message):
        identify("Dahl", dahl_record(0), **wishes)  # type: ignore[arg-type]


def test_data_that_cannot_be_used_are_refused() -> None:
    record = dahl_record(0)
    with pytest.raises(RecordError, match="neither friction nor force"):
        identify("Dahl", Record("bare", record.t, q=record.q))
    with pytest.raises(RecordError, match="no motion"):
        identify("Dahl", Record("still", record.t, q=0.0 * record.column("q"), friction=record.friction))
    with pytest.raises(FitError, match="no records"):
        identify("Dahl", [])
    with pytest.raises(IdentificationError, match="cannot be identified"):
        identify("BurridgeKnopoff", record)
    with pytest.raises(friction_fmus.UnknownNameError, match=re.escape("LuGre")):
        identify("LuGr", record)


def test_an_asymmetric_law_has_parameters_for_either_direction(tmp_path: Path) -> None:
    v = sliding_record().column("v")
    forward, backward = stribeck_force(v, 10.0, 15.0, 5e-3, 100.0), stribeck_force(v, 8.0, 9.0, 8e-3, 60.0)
    force = np.where(v > 0.0, forward, backward) + noise(6, len(v))
    record = Record("asymmetric", STEP * np.arange(len(v)), v=v, friction=force)
    result = identify("Stribeck", record, fixed={"asymmetric": 1})
    assert "OF" not in result.parameters  # it would be the same as a difference of the two levels
    expected = {"Fc": 10.0, "Fs": 15.0, "vs": 5e-3, "Fv": 100.0}
    expected |= {"Fc_neg": 8.0, "Fs_neg": 9.0, "vs_neg": 8e-3, "Fv_neg": 60.0}
    for name, value in expected.items():
        assert result.values()[name] == pytest.approx(value, rel=0.01), name
    written = read_ssv(result.to_ssv(tmp_path / "law.ssv")).parameters
    assert written["asymmetric"].value is True
    drive = Drive(FmuPart("law", result.to_fmu(tmp_path)))
    rows = drive.run({"v": v}, ["F"], STEP, between="linear")
    drive.close()
    np.testing.assert_allclose(rows[:, 0], result.predicted, atol=1e-9)


@nightly
def test_a_block_that_names_a_method_that_does_not_exist(tmp_path: Path, lugre: Truth) -> None:
    source = Path(friction_fmus.catalogue()["MaxwellSlip"].path)
    text = source.read_text(encoding="utf-8")
    assert "METHOD(hysteresis)" in text
    mine = tmp_path / "Slips.c"
    mine.write_text(text.replace("METHOD(hysteresis)", "METHOD(hysteresiss)"), encoding="utf-8")
    with pytest.raises(FitError, match=r"names the unknown method 'hysteresiss' \(did you mean hysteresis"):
        identify(mine, lugre[0])


OWN = r"""
#define MODEL   OwnNames
#define SUMMARY "Smoothed Coulomb friction with names that mean something else in other models"
#define SOURCE  "A test"

#define VARIABLES                                                       \
    INPUT    (v,     VELOCITY, 0.0,              "sliding velocity")    \
    OUTPUT   (F,     FORCE,                      "friction")            \
    PARAMETER(k,     FORCE,    1.0,  1e-9,  INF, "Coulomb friction")    \
    PARAMETER(sigma, DAMPING,  0.4,  0.0,   INF, "viscous coefficient") \
    PARAMETER(alpha, NO_UNIT,  0.0,  -1.0,  1.0, "excess for v < 0")    \
    PARAMETER(vs,    VELOCITY, 1e-4, 1e-12, INF, "width of the smoothing")

#define CONTACT    COULOMB(k) VISCOUS(sigma)
#define IDENTIFIED FIT(alpha, 0, directions) HELD(vs, 1e-4, slow)

#include "block.h"

static void equations(Model *m)
{
    GIVEN(m)
    m->F = k * (v < 0.0 ? 1.0 + alpha : 1.0) * tanh(v / vs) + sigma * v;
}
"""


def own_names(folder: Path, old: str = "", new: str = "") -> Path:
    source = folder / "OwnNames.c"
    source.write_text(OWN.replace(old, new), encoding="utf-8")
    return source


def test_the_file_of_a_model_says_how_its_parameters_are_identified_not_their_names(tmp_path: Path) -> None:
    v = sliding_record().column("v")
    force = 10.0 * np.tanh(v / 1e-4) * np.where(v < 0.0, 1.2, 1.0) + 100.0 * v + noise(3, len(v))
    record = Record("own names", STEP * np.arange(len(v)), v=v, friction=force)
    result = identify(own_names(tmp_path), record, starts=1, fixed={"OF": 0.0})
    assert {*result.values()} - {"OF"} == {"k", "sigma", "alpha"}
    for name, value in {"k": 10.0, "sigma": 100.0, "alpha": 0.2}.items():
        assert result.values()[name] == pytest.approx(value, rel=0.01), name
    model = contact_model(own_names(tmp_path), LINEAR)
    assert [model.fit_of(name).start for name in ("k", "sigma")] == ["level", "viscous"]
    assert not model.lacks_viscous


def test_a_parameter_without_a_statement_and_a_name_of_the_drive_are_errors(tmp_path: Path) -> None:
    with pytest.raises(FitError, match=r"does not state how vs is identified.*HELD\(vs, "):
        identify(own_names(tmp_path, "HELD(vs, 1e-4, slow)", ""), sliding_record())
    with pytest.raises(FitError, match=r"OwnNames has a parameter OF, .* rename"):
        identify(own_names(tmp_path, "alpha", "OF"), sliding_record())


@pytest.mark.parametrize("name", identifiable())
def test_each_model_states_how_its_parameters_are_identified(name: str) -> None:
    model = contact_model(name, LINEAR)
    numbers = {each.split("[")[0].removesuffix("_neg") for each, p in model.parameters.items() if p.real} - {"Fn0"}
    assert numbers == {*model.identified_by.fits}
