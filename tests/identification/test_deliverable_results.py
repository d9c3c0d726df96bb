"""Which results are delivered: a record of a simulated drive gives its truth, an absurd one is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from friction_fmus.identification import DataMapping, Estimate, Record, identify, read_measurement
from friction_fmus.identification.fit.first_look import first_look
from friction_fmus.identification.model_comparison import useless

J, FC, FV, OF, KT = 0.012, 0.8, 0.05, 0.04, 0.5


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive that follows two sines: J w' = kt i - Fc sgn(w) - Fv w - OF, current held for 1 ms, 4096 counts a turn.

    The friction is that of a bristle (Dahl), integrated with 50 steps in each millisecond.
    """
    h, inner, sigma = 1e-3, 50, 2e4
    q = w = z = 0.0
    rows = []
    for k in range(6000):
        t = k * h
        r = 1.5 * np.sin(3.0 * t) + 0.5 * np.sin(11.0 * t)
        dr = 4.5 * np.cos(3.0 * t) + 5.5 * np.cos(11.0 * t)
        i = np.clip((60.0 * J * (25.0 * (r - q) + dr - w)) / KT, -12.0, 12.0)
        rows.append((1e3 * t, np.round(q * 4096 / (2 * np.pi)), np.round(1e3 * i)))
        for _ in range(inner):
            dt = h / inner
            z += dt * w * (1.0 - np.sign(w) * sigma * z / FC)
            w += dt * (KT * i - sigma * z - FV * w - OF) / J
            q += dt * w
    path = tmp_path_factory.mktemp("drive") / "drive.csv"
    np.savetxt(path, np.array(rows), "%.10g", ";", header="t [ms];Position [qc];Current [mA]", comments="")
    return path


def test_a_simulated_drive_gives_its_parameters(log: Path) -> None:
    mapping = DataMapping(log, option="time=1 ms, position=2 1/4096 rev, current=3 mA", gain="0.5 N.m/A")
    held = read_measurement(log, mapping).mapping
    columns = {**held.columns, "force": replace(held.columns["force"], held=True)}
    records = read_measurement(replace(held, columns=columns)).records
    for found in (first_look(records), identify("Coulomb", records, viscous=True).parameters):
        assert found["M"].value == pytest.approx(J, rel=0.03)
        assert found["Fc"].value == pytest.approx(FC, rel=0.03)
        assert found["Fv"].value == pytest.approx(FV, rel=0.1)
        assert found["OF"].value == pytest.approx(OF, abs=0.02)


def test_a_viscous_force_beyond_ten_times_the_largest_one_is_refused() -> None:
    t = 1e-3 * np.arange(3001)
    v = 0.5 * np.cos(6.0 * t)
    a = -3.0 * np.sin(6.0 * t)
    result = identify("Viscous", Record("axis", t, q=0.5 / 6.0 * np.sin(6.0 * t), v=v, force=2.0 * a + 30.0 * v))
    assert useless(result) == ""
    # |v| is below 0.49994 m/s in 99 % of a sine of 0.5 m/s
    limit = 10.0 * float(np.max(np.abs(result.measured))) / 0.49994

    def with_coefficient(value: float) -> str:
        return useless(replace(result, parameters={**result.parameters, "Fv": Estimate("Fv", value, 1.0, "N.s/m")}))

    assert with_coefficient(0.99 * limit) == ""
    assert "check columns and units" in with_coefficient(1.01 * limit)
    assert "check columns and units" in with_coefficient(-1.01 * limit)
