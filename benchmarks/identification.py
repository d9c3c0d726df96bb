"""How near identification comes to known parameters, how fast, and what it makes of the two measured records.

``--page FILE`` writes the table in Markdown.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:1] = [str(ROOT), str(ROOT / "benchmarks"), str(ROOT / "tests" / "identification")]

import argparse
import time

import numpy as np
from contacts import LUGRE, lugre_force, lugre_motion, maxwell_force, noise, reversals
from page import tables
from rows import Row, report

from friction_fmus import fmu, identify
from friction_fmus.data import load_tribometer
from friction_fmus.identification import Record
from friction_fmus.identification.fit.contact_model import contact_model
from friction_fmus.identification.fit.simulation_data import prepare
from friction_fmus.identification.methods.hysteresis import coarse, fit_grid
from harness import Drive, FmuPart

NOISE = 0.01  # [N]
NEAR = ("sigma0", "sigma1", "Fc", "Fs", "vs")
STEP = 5e-4  # [s]


def lugre(short: bool) -> list[Row]:
    """Random starts three times off either way, and the coverage of the intervals."""
    t, v = lugre_motion(6000, STEP)
    force = lugre_force(t, v)
    random = np.random.default_rng(11)
    errors, seconds, processor = [], [], []
    for seed in range(10):
        record = Record("LuGre", t, v=v, friction=force + noise(seed, len(t), NOISE))
        start = {name: value * 3.0 ** random.choice([-1, 1]) for name, value in LUGRE.items()}
        begin = time.process_time()
        found = identify("LuGre", record, start=start)
        processor.append(time.process_time() - begin)
        seconds.append(found.seconds)
        errors.append(float(max(100.0 * abs(found.values()[name] / LUGRE[name] - 1.0) for name in NEAR)))
    rows = [
        Row(
            f"LuGre, {len(t)} samples with 10 mN of noise: worst parameter of 10 starts three times off",
            max(errors),
            "%",
            0.2,
        ),
        Row(
            "the same: starts of 10 that end further than 0.2 % from the truth",
            float(sum(e > 0.2 for e in errors)),
            "",
            0.0,
        ),
        Row("the same: slowest", max(seconds), "s", 1.0),
        Row("the same: slowest, processor time", max(processor), "s", 1.0),
        Row("the same: median time", float(np.median(seconds)), "s"),
    ]
    count = 20 if short else 200
    hits = dict.fromkeys(LUGRE, 0)
    for seed in range(count):
        record = Record("LuGre", t, v=v, friction=force + noise(1000 + seed, len(t), NOISE))
        estimates = identify("LuGre", record, start=dict(LUGRE)).parameters
        for name, value in LUGRE.items():
            hits[name] += abs(estimates[name].value - value) < 1.96 * estimates[name].standard_error
    cover = [100.0 * hit / count for hit in hits.values()]
    rows.append(
        Row(f"95 % intervals of {count} records that miss: most often missed parameter", 100.0 - min(cover), "%", 10.0)
    )
    rows.append(Row("the same: least often missed one covered", max(cover), "%", 99.0))
    return rows


def hysteresis() -> list[Row]:
    """Twenty grid points on distributions that are not on the grid."""
    q = reversals(5000, 1e-4)
    times = 1e-3 * np.arange(5000)
    distance = np.geomspace(2e-6, 6e-5, 200)
    k = 1e3 * np.exp(-distance / 2e-5)
    smooth = maxwell_force(q, k, k * distance, 0.3 * k * distance)
    drive = Drive(FmuPart("gms", fmu("GMS")))
    v = np.append(np.diff(q) / 1e-3, 0.0)
    generalised = drive.run({"v": v}, ["F"], 1e-3, start={"Fs": 1.02, "C": 1e4, "sigma2": 0.0})[:, 0]
    drive.close()
    rows = []
    for name, force in (("Maxwell slip, 200 elements", smooth), ("GMS, 10 elements", generalised)):
        record = Record(name, times, q=q, friction=force)
        segment = prepare(record, contact_model("MaxwellSlip", record.units), "friction")
        begin = time.perf_counter()
        grid = fit_grid(segment, 1.0, coarse(segment, 20), viscous=False)
        seconds = time.perf_counter() - begin
        rows.append(Row(f"{name}, 5000 samples, on 20 grid points: rms error", grid.relative_percent, "%", 1.0))
        rows.append(Row("the same: time", seconds, "s", 0.2))
    return rows


def tribometer() -> list[Row]:
    """The window 60 to 90 s, and the prediction of 120 to 150 s."""
    record = load_tribometer()
    window, later = record.window(60.0, 90.0), record.window(120.0, 150.0)
    rows = []
    for label, model, fixed, target in (
        ("Dahl, n = 1", "Dahl", {"n": 1.0}, 12.2),
        ("Dahl, n free", "Dahl", {}, 6.4),
        ("MaxwellSlip, N = 4", "MaxwellSlip", {"N": 4.0}, 4.4),
        ("LuGre", "LuGre", {}, None),
    ):
        for offset, given in ((", with the offset of the sensor", {}), (", without", {"OF": 0.0})):
            found = identify(model, window, fixed=fixed | given, validation=later)
            assert found.validation is not None
            name = f"Tribometer, {label}{offset}: rms error of mu"
            rows.append(Row(name, found.train.relative_percent, "%", target))
            rows.append(Row(f"{name}, 120 to 150 s predicted", found.validation.relative_percent, "%"))
    return rows


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--short", action="store_true", help="fewer repetitions")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows to a file")
    parser.add_argument("--page", type=Path, metavar="FILE", help="also write the table in Markdown")
    options = parser.parse_args()
    rows = [*lugre(options.short), *hysteresis(), *tribometer()]
    report("Identification", rows, options.json)
    if options.page:
        found = [{"name": r.name, "value": r.value, "unit": r.unit, "target": r.target, "ok": r.ok} for r in rows]
        options.page.write_text(f"{tables(found)}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
