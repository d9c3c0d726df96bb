"""Runs whose bits must not change: blocks of every kind, every master, sampled and continuous.

After a change of the numerics that is meant, `python tests/test_canonical_runs.py` prints the new hashes.

These blocks compute with + - * / sqrt and rounding to integers only, which IEEE 754 defines to the last bit. They and
the engine are compiled without fused operations. So the bits depend neither on the processor nor on the C library.
Those of exp, pow, sin and others do: glibc has several versions of each and selects one for the processor, with or
without FMA. Models with a Stribeck curve therefore have no hash here; `tests/models` compares them with closed forms.
"""

from __future__ import annotations

import hashlib
import platform
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from thorough import nightly

from friction_fmus import build, build_record
from harness import FmuPart, System

pytestmark = nightly
STEP, STOP = 1e-4, 0.5


@dataclass(frozen=True)
class Canon:
    """A system: models by part, connections, start values, and the master that runs it."""

    master: str
    parts: Mapping[str, str]
    connections: tuple[str, ...]
    start: Mapping[str, float] = field(default_factory=dict)


SERVO = (
    *(f"reference.{name} -> servo.{name}" for name in ("r", "rd", "rdd")),
    *("encoder.x_measured -> servo.x", "encoder.v_measured -> servo.v"),
    *("mass.x -> encoder.x", "mass.v -> encoder.v", "servo.u -> mass.F_drive"),
)
CONTACT = ("mass.v -> friction.v", "friction.F -> mass.F_friction")
AXIS = {"reference": "reference", "encoder": "Encoder", "mass": "Mass"}
FEEDFORWARD = {"reference": "reference", "law": "CoulombFeedforward"}
AHEAD = ("reference.rd -> law.rd", "reference.rdd -> law.rdd")
NOISE = {"encoder.jitter": 0.5, "encoder.q": 1e-6}

RUNS = {
    "elements in a spring-driven mass": Canon(
        "gauss-seidel",
        {"mass": "Mass", "friction": "MaxwellSlip"},
        CONTACT,
        {"mass.k": 200.0, "mass.v_support": 0.05, "mass.F_drive": 0.0},
    ),
    "a lag and a memory": Canon(
        "jacobi",
        {"mass": "Mass", "friction": "SevenParameter"},
        CONTACT,
        {"mass.k": 200.0, "mass.d": 1.0, "mass.v_support": 0.05, "mass.F_drive": 0.0},
    ),
    "a belt that sticks": Canon(
        "newton",
        {"mass": "Belt", "friction": "Stiction"},
        ("mass.v_rel -> friction.v", "friction.F -> mass.F_friction", "mass.F_ext -> friction.F_ext"),
        {"mass.k": 200.0, "mass.v_belt": 0.05},
    ),
    "two masses on two contacts": Canon(
        "adaptive",
        {"mass": "TwoMass", "motor": "ResetIntegrator", "load": "Bristle"} | FEEDFORWARD,
        (
            *("mass.v1 -> motor.v", "motor.F -> mass.F_friction1", "mass.v2 -> load.v"),
            *("load.F -> mass.F_friction2", "law.u -> mass.F_drive", *AHEAD),
        ),
        {"mass.k": 2e3, "mass.v1_0": 0.05, "motor.sigma0": 1e4},
    ),
    "a chain of blocks": Canon("jacobi", {"friction": "BurridgeKnopoff"}, (), {"friction.v": 5.0}),
    "a controller with an encoder": Canon(
        "gauss-seidel", AXIS | {"servo": "PID", "friction": "MaxwellSlip"}, (*SERVO, *CONTACT), NOISE
    ),
    "a resetting controller with a feedforward": Canon(
        "newton",
        AXIS | {"servo": "ResetPID", "friction": "SevenParameter"} | FEEDFORWARD,
        (*SERVO, *CONTACT, *AHEAD, "law.u -> servo.f"),
        NOISE | {"law.gain": 0.9},
    ),
    "a cascade with an observer": Canon(
        "adaptive",
        AXIS | {"servo": "CascadePPI", "friction": "Bristle", "law": "KalmanFriction"},
        (
            *(*SERVO, *CONTACT, "encoder.x_measured -> law.x", "encoder.v_measured -> law.v"),
            *("law.u -> servo.f", "mass.F_ext -> law.u_prev"),
        ),
        {"servo.ki": 6e3},
    ),
    "a sliding mode": Canon(
        "newton",
        AXIS | {"servo": "ImplicitSuperTwisting", "friction": "MaxwellSlip"},
        (*SERVO, *CONTACT),
        {"servo.L": 50.0},
    ),
}

SHA256 = {
    ("linux", "x86_64"): {
        "elements in a spring-driven mass": "e3e63666d07755e1d65efa214ac57f9bd3f4c0534ad8a5f0311ab920d4837e7e",
        "a lag and a memory": "a1a8c15ca7ce21de4af9a3d97771e26cc640579cf8c41cb0b28ec337002e849b",
        "a belt that sticks": "304589aa61140e9ae0a5907a52eb18bf625a611ed42f51c4a3b8d023abe42a11",
        "two masses on two contacts": "735023f735825e82fdb190658b12546209d75329cdcb69da8abd466399a01ec3",
        "a chain of blocks": "6d08a4cd95ecaafb93bc1f1a8464035b102643ce384b2c52457a0ed4212fa451",
        "a controller with an encoder": "10013bd55e43625c857aeafdcbe585c20888331f97746fbb7147746c9837d652",
        "a resetting controller with a feedforward": "0afb4e8be9504d68e3ca3bbc02aac7f667f003d886e65aa13102208748e68ad8",
        "a cascade with an observer": "6c065c16b9080be252b6bef517501b04e9b3d0684335b3468ae9a98ed931d48e",
        "a sliding mode": "2cde5a63b66dd8bb6799906a241af24261cc3fcccc58bccaab44452963cf27d2",
    }
}
"""By operating system and machine."""


def reference(folder: Path) -> Path:
    """Two steps of 10 mm there and back, with polynomials of the fifth degree."""
    t = np.arange(501) * 1e-3
    s = np.clip(np.abs(8.0 * t - 2.0) - 0.5, 0.0, 1.0)  # falls, waits and rises again
    way = np.where(8.0 * t < 2.0, -1.0, 1.0)
    r = 0.01 * s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
    rd = 0.08 * way * 30.0 * s * s * (1.0 - 2.0 * s + s * s)
    rdd = 0.64 * 60.0 * s * (1.0 - 3.0 * s + 2.0 * s * s)
    return build_record(t, r, rd, rdd, folder)


def bits(canon: Canon, folder: Path) -> str:
    """SHA-256 of the names and the values of all variables, at all times, as little-endian doubles."""
    fmus = {
        part: reference(folder) if model == "reference" else build(model, folder) for part, model in canon.parts.items()
    }
    with System([FmuPart(part, fmu) for part, fmu in fmus.items()], canon.connections, canon.start) as system:
        result = system.run(stop=STOP, step=STEP, master=canon.master)
    found = hashlib.sha256()
    for name in sorted(map(str, result.data_vars)):
        values = result[name].to_numpy()
        assert np.isfinite(values).all(), name
        found.update(name.encode() + b"\0" + values.astype("<f8").tobytes())
    return found.hexdigest()


@pytest.mark.skipif(
    (sys.platform, platform.machine()) not in SHA256,
    reason="no hashes for this platform: add those that `python tests/test_canonical_runs.py` prints",
)
@pytest.mark.parametrize("name", RUNS)
def test_a_canonical_run_has_the_same_bits(name: str, tmp_path: Path) -> None:
    assert bits(RUNS[name], tmp_path) == SHA256[sys.platform, platform.machine()][name]


def test_every_master_is_in_a_canonical_run() -> None:
    assert {canon.master for canon in RUNS.values()} == {"gauss-seidel", "jacobi", "newton", "adaptive"}


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        for each, canon in RUNS.items():
            sys.stdout.write(f'        "{each}": "{bits(canon, Path(scratch))}",\n')
