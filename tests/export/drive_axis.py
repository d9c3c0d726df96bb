"""Axes for the sheets of drives: with rigid friction and without a servo, and a folder as a study writes it."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from friction_fmus.axis.position_map import gravity_map
from friction_fmus.axis.servo_loop import accurate, closed_loop
from friction_fmus.export.identified_axis import AxisLoop, IdentifiedAxis
from friction_fmus.listings import plain
from friction_fmus.study.evaluation import AxisBench, Scheme, evaluate
from friction_fmus.study.study_files import with_tracking_error

sys.path.append(str(Path(__file__).parents[1] / "study"))

from small_axis import LAW, bench_of, rotary_bench_of

COULOMB = {"Fc": 3.0, "Fs": 3.0, "vs": 1e-3, "Fv": 20.0}


def rigid(**changes: Any) -> IdentifiedAxis:
    """3 N, 20 N.s/m, 0.5 N always, up to 0.1 m/s, of which no record is known."""
    about: dict[str, Any] = {"name": "slide", "citation": "", "rotary": False, "label": "Stribeck", "model": "Stribeck"}
    about |= {"parameters": COULOMB, "viscous": 0.0, "mass": 2.0, "offset": 0.5, "position": None, "speed": 0.1}
    return IdentifiedAxis(**about | changes)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def arm_of(folder: Path) -> AxisBench:
    """The small rotary axis as an arm with gravity, which the study feeds forward with its constant torque."""
    bench, terms = rotary_bench_of(folder), {"G_sin": 0.3, "G_cos": 0.1}
    plant = replace(bench.plant, offset=0.02, position=gravity_map(**terms), terms=terms)
    return replace(bench, plant=plant)


def study_folder(folder: Path, rotary: bool = False, arm: bool = False) -> tuple[Path, AxisBench]:
    """What `export` reads of the folder of a study, with the law of the small axis as the recommendation."""
    bench = arm_of(folder) if arm else (rotary_bench_of if rotary else bench_of)(folder)
    rotary = rotary or arm
    law = None if rotary else LAW
    (folder / "recommended").mkdir()
    with closed_loop(bench.servo, bench.plant, bench.trajectory, law) as system:
        whole, _ = accurate(with_tracking_error(system))
        whole.to_ssp(folder / "recommended" / "axis.ssp")
    fed, recommended = (
        evaluate(bench, [Scheme(bench.servo, compensator=each)], (), False).metrics for each in (None, law)
    )
    assert fed is not None
    assert recommended is not None
    name = "none" if law is None else law.model
    loop = AxisLoop("recommended/axis.ssp", bench.servo.gains, name, 2.0 * fed.rms, fed.rms, recommended.rms)
    plant, words = bench.plant, bench.trajectory.words
    axis = IdentifiedAxis(
        "small axis",
        "",
        words.m == "rad",
        "LuGre",
        "LuGre",
        plant.values,
        0.0,
        plant.mass,
        plant.offset,
        plant.position,
        0.1,
        bench.servo.force_limit,
        loop,
        plant.terms,
    )
    (folder / "study.json").write_text(json.dumps({"axes": [plain(axis)]}), encoding="utf-8")
    return folder, bench
