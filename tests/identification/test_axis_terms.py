"""Terms beside a friction model: gravity, load, direction and drift, with the truth from an integrator of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from arms import drawn, moved, temperature
from thorough import landing, nightly

from friction_fmus.errors import FitError, RecordError
from friction_fmus.identification import LINEAR, ROTARY, Record, identify, read_measurement
from friction_fmus.identification.fit.first_look import first_look
from friction_fmus.identification.plant_candidates import plant_findings

ARM = replace(drawn(7), direction=0.0)  # with gravity and load


def thinned(whole: Record) -> Record:
    """Every fourth sample, with which the fits take half the time."""
    return replace(whole, t=whole.t[::4], q=whole.column("q")[::4], force=whole.column("force")[::4])


@pytest.fixture(scope="module")
def whole() -> Record:
    """The motion of this ARM."""
    return moved(ARM, 7)


@pytest.fixture(scope="module")
def record(whole: Record) -> Record:
    """A part of its samples."""
    return thinned(whole)


@landing
def test_gravity_and_load_are_found_and_nothing_else(record: Record) -> None:
    found = identify("Stribeck", record, terms="auto")
    values = found.values()
    assert {"G_sin", "G_cos", "a"} <= values.keys()
    assert not {"direction", "drift"} & values.keys()
    for name, within in (("M", 0.05), ("Fc", 0.05), ("G_sin", 0.05), ("a", 0.1)):
        assert values[name] == pytest.approx(getattr(ARM, name), rel=within)
    # at rest, a quarter of the time, friction is what the drive gives
    moving = np.abs(np.gradient(record.column("q"), record.Ts)) > 0.05
    error = (found.predict(record) - record.column("force"))[moving]
    assert float(np.std(error)) < 0.05 * float(np.std(record.column("force")))


@landing
def test_an_arm_without_terms_has_none() -> None:
    found = identify("Stribeck", thinned(moved(drawn(0), 0)), terms="auto")
    assert not {"G_sin", "a", "direction", "drift"} & found.values().keys()


@landing
def test_gravity_of_short_strokes_is_found() -> None:
    """Strokes of 0.14 rad about 1 rad: gravity is needed, although no part of it differs clearly from an offset."""
    t = 1e-3 * np.arange(12000)
    parts = ((0.05, np.pi, 0.0), (0.02, 3.4 * np.pi, 1.0))
    q = np.asarray(1.0 + sum(A * np.sin(w * t + p) for A, w, p in parts), dtype=np.float64)
    v, a = (sum(A * w**n * f(w * t + p) for A, w, p in parts) for n, f in ((1, np.cos), (2, lambda x: -np.sin(x))))
    gravity = 2.9 * np.sin(q) + 0.2 * np.cos(q)
    needed, force = 0.09 * a + 0.05 * v + gravity, np.zeros(len(t))
    for _ in range(200):  # the friction is 0.15 times both torques, more than without load
        force = needed + np.sign(v) * (0.3 + 0.15 * np.abs(gravity + force))
    force += np.random.default_rng(0).normal(0.0, 0.01, len(t))
    record = Record("short", t, q=q, force=force, units=ROTARY)
    values = identify("Stribeck", record, terms="auto").values()
    assert {"G_sin", "a"} <= values.keys()
    assert values["M"] == pytest.approx(0.09, rel=0.02)


@landing
def test_known_gravity_gives_the_gain_of_the_drive(record: Record) -> None:
    """The drive force in percent of 0.02 N.m: friction, mass and gain follow from the torque of gravity."""
    given = identify(
        "Stribeck",
        replace(record, force=record.column("force") / 0.02),
        terms=("gravity", "load", "gain"),
        fixed={"G_sin": ARM.G_sin},
        start={"gain": 0.01},
    ).values()
    assert given["gain"] == pytest.approx(0.02, rel=0.05)
    assert given["M"] == pytest.approx(ARM.M, rel=0.05)
    assert given["a"] == pytest.approx(ARM.a, rel=0.1)


@landing
def test_a_known_load_replaces_gravity_and_its_sign_is_checked(record: Record) -> None:
    load = -(ARM.G_sin * np.sin(record.column("q")) + ARM.G_cos * np.cos(record.column("q")))
    found = identify("Stribeck", replace(record, load=load), terms=("load",)).values()
    assert found["a"] == pytest.approx(ARM.a, rel=0.1)
    assert found["M"] == pytest.approx(ARM.M, rel=0.05)
    with pytest.raises(RecordError, match=r"shows -\d.* times the load; correct its sign"):
        identify("Coulomb", replace(record, load=-load))
    with pytest.raises(RecordError, match=r"shows 0\.0\d+ times the load"):
        identify("Coulomb", replace(record, load=20.0 * load))
    with pytest.raises(FitError, match="column load"):
        identify("Stribeck", replace(record, load=load), method="free-run")


@landing
def test_a_constant_load_only_moves_the_offset(record: Record) -> None:
    loaded = replace(record, load=np.full(len(record), 0.1))
    without, found = (identify("Coulomb", each, terms=("gravity", "load")).values() for each in (record, loaded))
    assert found.pop("OF") == pytest.approx(without.pop("OF") + 0.1, abs=1e-3)
    assert found == pytest.approx(without, rel=1e-2)


def test_gravity_of_an_arm_needs_an_angle(record: Record) -> None:
    with pytest.raises(FitError, match="needs an angle"):
        identify("Coulomb", replace(record, units=LINEAR), terms="gravity")


@pytest.mark.parametrize(
    ("model", "terms", "what"),
    [
        ("Stribeck", ("lode",), "load"),
        ("Viscous", ("load",), "no input Fn"),
        ("Stribeck", ("load", "sides"), "describe the same"),
        ("Stribeck", ("gain",), "fix G_sin"),
    ],
)
def test_terms_that_cannot_be_identified_are_refused(model: str, terms: tuple[str, ...], what: str) -> None:
    with pytest.raises(FitError, match=what):
        identify(model, thinned(moved(drawn(0), 0)).window(0.0, 4.0), terms=terms)


@nightly
def test_findings_and_first_look_consider_a_known_load(whole: Record) -> None:
    """Without the load, gravity counts as friction that depends on the direction, and hides the mass."""
    load = -(ARM.G_sin * np.sin(whole.column("q")) + ARM.G_cos * np.cos(whole.column("q")))
    known = replace(whole, load=load)
    one, other = (abs(first_look([each])["M"].value / ARM.M - 1.0) for each in (known, whole))
    assert one < 0.25 < 0.9 < other
    names = [{finding.name for finding in plant_findings([each])[0]} for each in (known, whole)]
    assert "direction-dependent-friction" in names[1] - names[0]


@nightly
def test_auto_chooses_from_given_terms(record: Record) -> None:
    found = identify("Stribeck", record, terms=("auto", "gravity")).values()
    assert "G_sin" in found
    assert "a" not in found


@landing
def test_a_friction_that_falls_with_the_temperature_is_found() -> None:
    """Not as a drift, as the gear cools down again."""
    arm = replace(drawn(0), warming=-0.02)
    warm = moved(arm, 0)
    warm = replace(warm, temperature=np.array([temperature(t) for t in warm.t]))
    found = identify("Stribeck", warm, terms="auto").values()
    assert found["warming"] == pytest.approx(-0.02, rel=0.05)
    assert found["Fc"] == pytest.approx(arm.Fc, rel=0.05)
    assert not {"drift", "direction"} & found.keys()
    later = warm.window(9.0, 15.9)
    predicted = identify("Stribeck", warm.window(0.0, 9.0), validation=later, terms=("temperature",)).validation
    assert predicted is not None
    assert predicted.relative_percent < 3.0
    with pytest.raises(FitError, match="needs the column temperature"):
        identify("Stribeck", replace(warm, temperature=None), terms=("temperature",))


def test_temperatures_are_read_in_degrees_celsius(tmp_path: Path) -> None:
    t = 1e-3 * np.arange(2000)
    rows = np.column_stack([t, 1e-2 * np.sin(6.0 * t), np.sign(np.cos(6.0 * t)), 20.0 + t])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header="time,position,force,gearbox", comments="")
    columns = {"time": ("time", "s"), "position": ("position", "m"), "force": ("force", "N")}
    columns["temperature"] = ("gearbox", "degC")
    entries = {role: {"column": heading, "unit": unit} for role, (heading, unit) in columns.items()}
    (record,) = read_measurement(tmp_path / "log.csv", {"columns": entries}).records
    assert record.temperature is not None
    assert record.temperature[-1] - record.temperature[0] == pytest.approx(1.999)
