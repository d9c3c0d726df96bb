"""A study of a rotary axis speaks of angles, torques and moments of inertia, in their units."""

from __future__ import annotations

import html
import json
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
from thorough import nightly

from friction_fmus.axis.servo import AxisPlant, Servo, Trajectory
from friction_fmus.axis.servo_loop import closed_loop, run_loop
from friction_fmus.cli.main import main
from friction_fmus.identification import compare_models, identify, read_measurement
from friction_fmus.identification.model_comparison import IdentificationTask
from friction_fmus.study.data import build_reference
from friction_fmus.study.model_ranking import identify_model

LUGRE = {"sigma0": 50.0, "sigma1": 0.3, "sigma2": 0.01, "Fc": 0.05, "Fs": 0.075, "vs": 0.02, "delta": 2.0}
INERTIA = 2e-3
SERVO = Servo("CascadePPI", {"kp": 30.0, "kv": 0.4, "ki": 0.0}, 1e-3, 5.0, quantum=2.0 * np.pi / 2**17)

SETTINGS = f"""
[data]
file = "joint.csv"
[servo]
law = "CascadePPI"
kp = 30.0
kv = 0.4
Ts = 1e-3
force_limit = 5.0
quantum = {SERVO.quantum!r}
[identify]
models = ["Coulomb", "MaxwellSlip"]
[compensation]
compensators = ["StaticFeedforward", "DisturbanceObserver"]
gains = [1.0]
duration = 1.0
"""

LINEAR = re.compile(
    r"\bforces?\b(?!-)|\bmass(?:es)?\b|\b[mk]?N(?:/m|[.·]s|/\(m)(?![\w.·]*rad)|(?<=\d )[mk]?N\b(?![.·])|\[[mk]?N\]"
    r"|(?<=[\d.] )[mµn]?m(?:/s[2²]?)?\b(?![.·])|\[[mµn]?m(?:/s)?\]|\bkg\b(?![.·]m)|nrad",
    re.IGNORECASE,
)
"""Words and units of a linear axis."""

pytestmark = nightly


def linear_words(text: str) -> list[str]:
    text = re.sub(r"normal force", "", text, flags=re.IGNORECASE)
    return [text[max(0, match.start() - 40) : match.end() + 20] for match in LINEAR.finditer(text)]


@pytest.fixture(scope="module")
def joint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log of a simulated joint in degrees, and the settings of its study."""
    folder = tmp_path_factory.mktemp("joint")
    t = SERVO.Ts * np.arange(2500.0)
    r = 0.5 * (1.0 - np.cos(np.pi * t)) + 0.05 * (1.0 - np.cos(5.0 * np.pi * t))
    reference = build_reference(t, r, folder, "JointReference", rotary=True)
    with closed_loop(
        SERVO, AxisPlant("LuGre", LUGRE, INERTIA), Trajectory(reference, len(t), 0.0, 0.0, rotary=True)
    ) as loop:
        trace = run_loop(loop)
    q = SERVO.quantum * np.round(trace.q / SERVO.quantum)
    rows = [
        f"{a:.3f};{np.degrees(b):.9g};{np.degrees(c):.9g};{d:.9g}"
        for a, b, c, d in zip(t, q, r, trace.force, strict=True)
    ]
    heading = "t [s];phi [deg];phi_ref [deg];M [Nm]"
    (folder / "joint.csv").write_text("\n".join([heading, *rows]) + "\n", encoding="utf-8")
    (folder / "joint.toml").write_text(SETTINGS, encoding="utf-8")
    return folder


def test_no_text_of_a_rotary_study_has_linear_words_or_units(joint: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = joint / "out"
    assert main(["study", str(joint / "joint.toml"), "-o", str(out), "--workers", "1"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert linear_words(printed) == []
    assert "drive torque" in printed
    assert "friction, inertia, delay, encoder and reference" in printed

    page = (out / "report.html").read_text(encoding="utf-8")
    plots = re.findall(r'<script type="application/json".*?</script>', page, re.S)
    assert plots
    assert linear_words(" ".join(re.findall(r'"text":"([^"]*)"', " ".join(plots)))) == []
    labels = " ".join(re.findall(r'aria-label="([^"]*)"', page))
    text = re.sub(r"<script.*?</script>|<style.*?</style>", " ", page, flags=re.S)
    text = html.unescape(re.sub(r"<[^>]+>", " ", text)).replace("\u00a0", " ")
    assert linear_words(f"{labels} {text}") == []
    assert "kg·m²" in text
    assert "47.9 µrad" in text  # the step of the encoder

    described = []
    for path in out.rglob("*.ssv"):
        described += re.findall(r'description="([^"]*)"', path.read_text(encoding="utf-8"))
    with zipfile.ZipFile(out / "recommended" / "axis.ssp") as archive:
        described += re.findall(r'description="([^"]*)"', archive.read("SystemStructure.ssd").decode())
    assert "moment of inertia" in described
    assert linear_words(" . ".join(described)) == []

    code = (out / "recommended" / "c" / "loop.h").read_text(encoding="utf-8")
    assert linear_words(" ".join(re.findall(r"/\* (.*?) \*/", code, re.S))) == []
    assert "[N.m] control torque" in code

    result = json.loads((out / "study.json").read_text(encoding="utf-8"))
    texts = [text for row in result["conditions"] for text in (row["wrong"], row["change"])]
    texts += [result["recommendation"]["reason"], *result["overview"].values()]
    texts += [p["meaning"] for model in result["models"] for p in model["parameters"]]
    assert linear_words(" . ".join(texts)) == []


def test_no_text_of_a_rotary_identification_has_them(joint: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--model", "Coulomb", "--model", "Stribeck", "--workers", "1", "-o", str(joint / "identified")]
    assert main(["identify", str(joint / "joint.toml"), *arguments]) == 0
    printed = " ".join(capsys.readouterr().out.split()).replace("force column 4 'M' [Nm]", "")  # role and heading
    assert linear_words(printed) == []
    assert "of the drive torque" in printed


def test_static_friction_that_the_record_does_not_determine_does_not_run_away(joint: Path) -> None:
    """The joint passes its Stribeck velocity within a sample: any product of a huge Fs and a tiny vs fits."""
    train = read_measurement(joint / "joint.csv").window(0.0, 2.4)
    (compared,) = compare_models(["LuGre"], IdentificationTask(train, options={"starts": 1})).results
    for found in (identify("LuGre", train, starts=1), compared):
        assert found.parameters["Fc"].value == pytest.approx(LUGRE["Fc"], rel=0.02)
        assert found.parameters["Fs"].value <= 10.0 * np.abs(train[0].column("force")).max()
        assert {"Fs", "vs"} <= set(found.weak)
    in_study = identify_model("LuGre", train, (), {}, None)
    assert in_study.values["Fs"] == found.parameters["Fs"].value
