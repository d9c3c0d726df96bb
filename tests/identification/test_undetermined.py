"""Parameters that a record does not determine keep values that an axis can have."""

from __future__ import annotations

import numpy as np
from thorough import nightly

from friction_fmus.identification import Record, identify

FC, FV, M, TS = 20.0, 200.0, 95.0, 1e-3


def rigid_axis() -> Record:
    """A mass on Coulomb and viscous friction without presliding, at rest for no moment; force in closed form."""
    t = TS * np.arange(6001.0)
    w = 2.0 * np.pi * np.array([0.4, 1.3])
    size = np.array([30e-3, 4e-3])
    q = (size * (1.0 - np.cos(np.outer(t, w)))).sum(axis=1)
    v = (size * w * np.sin(np.outer(t, w))).sum(axis=1)
    a = (size * w**2 * np.cos(np.outer(t, w))).sum(axis=1)
    force = M * a + FV * v + FC * np.sign(v)
    noise = np.random.default_rng(3).normal(0.0, 0.2, len(t))
    return Record("rigid", t, q=1e-7 * np.round(q / 1e-7), force=force + noise)


@nightly
def test_a_rigid_contact_gets_no_stiffness_beyond_all_bounds() -> None:
    """The record has a kink where presliding would be; the stiffness may be any large value."""
    found = identify("LuGre", rigid_axis())
    values = found.values()
    assert values["Fc"] == np.clip(values["Fc"], 0.98 * FC, 1.02 * FC)
    assert values["M"] == np.clip(values["M"], 0.99 * M, 1.01 * M)
    assert 1e6 < values["sigma0"] < 1e11
    assert "sigma0" in found.weak
    # static friction is that of the truth, or no longer claimed: without errors at the ends of the record, it is found
    assert "Fs" in found.weak or abs(values["Fs"] - FC) < 2.0 * found.parameters["Fs"].standard_error
    assert 0.2 * FC < values["Fs"] < 5.0 * FC
