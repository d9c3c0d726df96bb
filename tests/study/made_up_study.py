"""A synthetic study with every element that a report can show."""

from __future__ import annotations

import math

import numpy as np

from friction_fmus.identification import LINEAR
from friction_fmus.study.study_result import (
    CompensatorResult,
    ConditionResult,
    Corner,
    Fit,
    IdentifiedParameter,
    Limits,
    LoopMargins,
    Metrics,
    ModelResult,
    Picture,
    Recommendation,
    Rung,
    ServoCheck,
    StudyCurve,
    StudyFinding,
    StudyResult,
    Trial,
    WrittenFile,
)

T = np.arange(0.0, 20.0, 5e-3)
REFERENCE = 0.1 * np.sin(0.2 * np.pi * T)
LAWS = ("LuGreFeedforward", "StaticFeedforward", "GMSFeedforward", "DisturbanceObserver", "Dither")


def curve(x: np.ndarray, y: np.ndarray) -> StudyCurve:
    return StudyCurve(tuple(map(float, x)), tuple(map(float, y)))


def noise(seed: int, like: np.ndarray, size: float) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal(like.shape)


def error(size: float, seed: int) -> np.ndarray:
    """A tracking error that peaks at the reversals [m]."""
    return size * np.exp(-((np.cos(0.2 * np.pi * T) / 0.1) ** 2)) + noise(seed, T, 0.1 * size)


def model(name: str, rank: int, percent: float) -> ModelResult:
    parameters = (
        IdentifiedParameter("M", 95.1089, 0.1, "kg", "moved mass", 95.2),
        IdentifiedParameter("sigma0", 1.234e6, 4.5e4, "N/m", "bristle stiffness"),
        IdentifiedParameter(
            "vs", 0.0123, 0.0031, "m/s", "Stribeck velocity", weak="Few samples move slowly; record 1 mm/s."
        ),
        IdentifiedParameter("delta", 2.0, None, "1", "Stribeck exponent"),
    )
    return ModelResult(
        name,
        f"{name} friction of a contact",
        "output-error",
        parameters,
        Fit(0.5, 0.9 * percent, "force", "N"),
        Fit(0.5, percent, "force", "N"),
        (Fit(1.4e-6, 12.0, "position", "m"), Fit(1.1, 3.9, "force", "N")),
        aic=-1000.0 + 40.0 * rank,
        bic=-980.0 + 38.0 * rank,
        rank=rank,
        warnings=("The record has one speed only.",) if rank == 2 else (),
        seconds=1.2,
        simulations=40,
    )


def compensator(name: str, rank: int) -> CompensatorResult:
    rms = 3e-6 + 1.2e-6 * rank

    def metrics(factor: float) -> Metrics:
        return Metrics(factor * rms, 4.0 * factor * rms, 20.3, 1.2 + 0.1 * rank, 400.0, 0.05, 0.02)

    corners = [("friction x 1.1, mass x 1.1", 1.3), ("friction x 0.9, mass x 1.1", 1.1), ("2 more samples", 0.95)]
    margins = LoopMargins(1.5 + 0.1 * rank, 40.0 - rank, 3.0, 30.0 + rank)
    estimator = name == "DisturbanceObserver"
    return CompensatorResult(
        name,
        f"{name} of the friction force",
        "feedforward",
        True,
        model="LuGre",
        gain=0.75 if rank % 2 else 1.0,
        metrics=metrics(1.0),
        bandwidth=30.0 if estimator else None,
        margins=margins,
        trials=tuple(
            Trial(gain, 30.0 * gain if estimator else None, margins, metrics(1.0 + 2.0 * (gain - 0.8) ** 2))
            for gain in (0.25, 0.5, 0.75, 1.0, 1.25)
        ),
        corners=tuple(Corner(case, metrics(factor), counts="2" not in case) for case, factor in corners),
        worst=1.3 * rms,
        best=0.95 * rms,
        cycles=100.0 + 230.0 * ((7 * rank) % 5),
        flash=1000.0,
        rank=rank,
        improves=rank < 5,
        error=curve(T[::2], error(rms, rank)[::2]),
    )


def without() -> CompensatorResult:
    metrics = Metrics(12e-6, 55e-6, 20.1, 0.8, 300.0, 0.3, 0.01)
    return CompensatorResult(
        "none",
        "the servo alone",
        "none",
        True,
        metrics=metrics,
        margins=LoopMargins(1.5, 42.0, 4.0),
        worst=14e-6,
        best=11e-6,
        error=curve(T[::2], error(12e-6, 9)[::2]),
    )


def record() -> tuple[Picture, ...]:
    q = REFERENCE + error(12e-6, 1)
    force = 20.0 * np.tanh(np.gradient(REFERENCE, T) / 1e-3)
    return (
        Picture(
            "time",
            "position",
            "s",
            "m",
            {"reference": curve(T, REFERENCE), "measured": curve(T, q)},
            {"LuGre": curve(T, q + noise(2, T, 1e-6))},
        ),
        Picture(
            "time", "force", "s", "N", {"measured": curve(T, force + noise(3, T, 1.0))}, {"LuGre": curve(T, force)}
        ),
    )


def friction() -> Picture:
    v = np.linspace(-0.06, 0.06, 800)
    models = {
        name: curve(v, np.sign(v) * (20.0 - 3.0 * i * np.exp(-np.abs(v) / 0.01)) + 200.0 * v)
        for i, name in enumerate(("LuGre", "Stribeck", "Coulomb", "Dahl", "GMS"))
    }
    samples = curve(v, np.array(models["Stribeck"].y) + noise(4, v, 1.0))
    medians = curve(v[20::40], np.array(models["Stribeck"].y)[20::40])
    return Picture("velocity", "friction", "m/s", "N", {"record": samples, "medians of the record": medians}, models)


def hysteresis() -> Picture:
    phase = np.linspace(0.0, 4.0 * math.pi, 1500)
    x = 40e-6 * np.sin(phase)
    loop = 20.0 * np.tanh(np.sin(phase - 0.6) * 2.0)
    models = {"LuGre": curve(x, loop), "GMS": curve(x, 0.95 * loop)}
    return Picture("displacement", "friction", "m", "N", {"record": curve(x, loop + noise(5, x, 0.4))}, models)


def servo_check() -> ServoCheck:
    force = 20.0 * np.tanh(np.gradient(REFERENCE, T) / 1e-3)
    return ServoCheck(
        Fit(1.2, 6.1, "force", "N"),
        2.0,
        (StudyFinding("wrong-gains", "it fits kp = 40 instead of kp = 30.", "Set kp = 40 in [servo].", stops=False),),
        (IdentifiedParameter("kp", 40.0, 0.2, "1/s", "gain of the servo"),),
        curve(T, force + noise(6, T, 1.2)),
        curve(T, force),
    )


def made_up_study() -> StudyResult:
    """A study with all elements."""
    return StudyResult(
        name="bench",
        citation="A. Author, B. Author: Data of a bench, 2020. https://example.org/data/of/a/bench/with/a/very/long/address",
        units=LINEAR,
        overview={"record": "4000 samples of 5 ms", "servo": "kp 160 1/s, kv 243 N·s/m, encoder 100 nm"},
        record=record(),
        friction=friction(),
        hysteresis=hysteresis(),
        residuals=(
            Picture("velocity", "simulated − measured force", "m/s", "N", {}, {"LuGre": curve(T, noise(6, T, 1.0))}),
        ),
        models=(
            model("LuGre", 1, 3.4),
            model("GMS", 2, 3.9),
            model("Stribeck", 3, 4.4),
            ModelResult("Leuven", "Leuven friction", reason="The record has no reversal in presliding."),
        ),
        plant="LuGre",
        no_compensation="",
        ladder=(
            Rung("as measured", "", Metrics(340e-6, 900e-6, 20.0, 0.7, 300.0)),
            Rung("with velocity and acceleration feedforward", "none", Metrics(12e-6, 55e-6, 20.1, 0.8, 300.0)),
            Rung("with friction feedforward", "LuGreFeedforward", Metrics(4.2e-6, 17e-6, 20.3, 1.3, 400.0)),
        ),
        limits=Limits(2.0, 1.5, 24.0, 24.0),
        compensators=(
            without(),
            *(compensator(name, rank) for rank, name in enumerate(LAWS, start=1)),
            CompensatorResult("IterativeLearning", "learning", "learning", False, "The reference does not repeat."),
        ),
        recommendation=Recommendation(
            "LuGreFeedforward",
            "LuGreFeedforward makes the tracking error 2.9 times smaller, 12.0 to 4.2 µm rms. It also does so when "
            "friction and mass are 10 % off.",
            0.75,
            "StaticFeedforward",
            "StaticFeedforward has 1.3 times the error.",
            ("Switch on the feedforward of velocity.", "Add LuGreFeedforward: recommended/c."),
            ("Record the axis with its largest load.",),
        ),
        conditions=(
            ConditionResult("no_hunting", False, "The loop hunts.",
                            "The integral winds up.", "Set a dead-band.", "Hensen 2002", 1.2, 1.0),
            ConditionResult("sampling_fast_enough", True, value=0.1, bound=0.3),
        ),
        files=(WrittenFile("report.html", "this page"), WrittenFile("fmus/bench_LuGre.fmu", "friction of the axis")),
        command="friction-fmus study bench.toml -o out",
        versions={"friction-fmus": "0.1.0", "python": "3.11.7"},
        seconds=93.4,
        servo_check=servo_check(),
        findings=servo_check().findings,
        turn=Picture(
            "time after the reversal", "tracking error", "s", "m", {},
            {
                "LuGreFeedforward": curve(T[:400], 4e-6 * np.exp(-T[:400])),
                "as measured": curve(T[:400], 900e-6 * np.exp(-T[:400])),
                "with velocity and acceleration feedforward": curve(T[:400], 55e-6 * np.exp(-T[:400])),
            },
        ),
    )  # fmt: skip
