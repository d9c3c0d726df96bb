"""Gravity and load along a reference, and the laws whose friction the load multiplies."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from friction_fmus import build
from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import discover_laws
from harness import FmuPart, System

LAWS = {law.name: law for law in discover_laws(laws_folder())}
LOAD = LAWS["LoadFeedforward"]
signed, positive, shares = st.floats(-5.0, 5.0), st.floats(0.0, 5.0), st.floats(0.0, 0.5)


@given(signed, signed, signed, signed, signed, positive, positive, positive, shares, shares)
def test_the_load_solves_its_equation(r, rd, rdd, sine, offset, mass, Fv, Fc, a_drive, a_external):
    """The normal force loads the contact with the friction that it makes: solved here by bisection."""
    parameters = {"m": 0.5, "G_sin": sine, "G_cos": 0.7, "offset": offset, "m_moved": mass, "Fv": Fv, "Fc": Fc}
    parameters |= {"a_drive": a_drive, "a_external": a_external, "pitch": 3.0}
    found = LOAD.evaluate({"r": r, "rd": rd, "rdd": rdd, **parameters})
    angle = 2.0 * math.pi * r / 3.0
    gravity = sine * math.sin(angle) + 0.7 * math.cos(angle) + offset
    assert found["u"] == pytest.approx(0.5 * rdd + gravity, rel=1e-12, abs=1e-12)
    way = (rd > 0.0) - (rd < 0.0)

    def missing(Fn: float) -> float:
        drive = gravity + mass * rdd + Fv * rd + way * Fn
        return Fc + abs(a_external * -gravity - a_drive * drive) - Fn

    expected = brentq(missing, 0.0, 1e4, xtol=1e-13, rtol=1e-14)
    assert found["Fn"] == pytest.approx(expected, rel=1e-9, abs=1e-10)


def test_it_is_the_load_of_a_transmission_in_sliding(tmp_path: Path) -> None:
    """An arm that the exact forces move along the reference has the normal force of TransmissionLoad."""
    w, m, torque, share = 2.0 * math.pi, 0.09, 2.9, 0.15
    t = np.linspace(0.05, 0.45, 9)
    for r, rd, rdd in zip(np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t), strict=True):
        values = {"m": m, "G_sin": torque, "m_moved": m, "Fc": 0.1, "a_drive": share, "a_external": 0.05, "Fv": 0.05}
        law = LOAD.evaluate({"r": r, "rd": rd, "rdd": rdd, **values})
        drive = law["u"] + 0.05 * rd + math.copysign(law["Fn"], rd)
        start = {"base": 0.1, "a_drive": share, "a_external": 0.05, "v": rd, "F_drive": drive}
        start |= {"F_external": -torque * math.sin(r)}
        part = FmuPart("load", build("TransmissionLoad", tmp_path, domain="rotational"))
        with System([part], [], {f"load.{name}": value for name, value in start.items()}) as system:
            found = system.run(stop=1e-3, step=1e-3)["load.Fn"].to_numpy()[-1]
        assert law["Fn"] == pytest.approx(found, rel=1e-12)


def test_a_disabled_load_is_friction_without_load() -> None:
    found = LOAD.evaluate({"r": 1.0, "rd": 1.0, "Fc": 0.4, "enable": 0.0})
    assert (found["u"], found["Fn"]) == (0.0, 0.4)


@pytest.mark.parametrize("name", ["StaticFeedforward", "LuGreFeedforward", "LuGreObserver"])
@pytest.mark.parametrize("load", [0.0, 0.5, 3.0])
def test_the_load_multiplies_friction_but_its_viscous_part(name: str, load: float) -> None:
    """F - Fv v is proportional to the normal force, as in the blocks, and zero for a contact that opens."""
    law, viscous = LAWS[name], "Fv" if name == "StaticFeedforward" else "sigma2"
    motion = {"r": 2e-6, "rd": 3e-3, "x": 0.0, "v": 3e-3, "m": 0.0, viscous: 7.0, "z": 2e-6, "started": 1.0}
    motion |= {"Fn0": 4.0, "u_min": -100.0, "u_max": 100.0}
    inputs = {variable.name for variable in law.given}
    motion = {key: value for key, value in motion.items() if key in inputs}
    one, found = (law.evaluate({**motion, "Fn": 4.0 * factor}) for factor in (1.0, load))
    beside = 7.0 * 3e-3
    assert one["u"] - beside > 0.5
    assert found["u"] - beside == pytest.approx(load * (one["u"] - beside), rel=1e-12, abs=1e-14)
    assert law.evaluate({**motion, "Fn": -1.0})["u"] == pytest.approx(beside, rel=1e-12)


@pytest.mark.parametrize("name", ["LuGreFeedforward", "LuGreObserver"])
def test_a_loaded_law_takes_over(name: str) -> None:
    """With track, u is what was applied, whatever the load is."""
    motion = {"r": 0.0, "rd": 1e-4, "x": 0.0, "v": 1e-4, "m": 0.0, "track": 1.0, "u_track": 0.6, "Fn": 2.5, "Fn0": 2.0}
    law = LAWS[name]
    inputs = {variable.name for variable in law.given}
    assert law.evaluate({k: v for k, v in motion.items() if k in inputs})["u"] == pytest.approx(0.6, rel=1e-12)
