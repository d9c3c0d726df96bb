"""A friction model, a law and a target of one file each are known to every part of the project."""

from __future__ import annotations

import re
import sys
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from thorough import nightly

from friction_fmus import build
from friction_fmus.__main__ import main
from friction_fmus.blocks.catalogue import OWN_BLOCKS, catalogue
from friction_fmus.check import check
from friction_fmus.codegen.law_export import export_law
from friction_fmus.errors import BuildError, FrictionError
from friction_fmus.export import targets
from friction_fmus.identification import identifiable
from friction_fmus.study.config import load_config
from friction_fmus.study.study import run_study

STICK_SLIP = Path(__file__).parents[2] / "examples" / "stick_slip.toml"

MODEL = """\
/* Elastic contact that slips, with viscous friction: a test writes this model.

       dz/dt = v - kappa |v| z / F_max
       F     = kappa z + eta_v v

   Use it to test that one file is enough.

   Limits: no Stribeck effect. */

#define MODEL    SlippingSpring
#define SUMMARY  "Slipping spring with viscous friction"
#define SOURCE   "A test"
#define FEATURES "presliding, rate dependent"

/* clang-format off */
#define VARIABLES                                                          \\
    INPUT    (v,     VELOCITY,  0.0,             "sliding velocity")       \\
    OUTPUT   (F,     FORCE,                      "friction, opposes v")    \\
    STATE    (z,     LENGTH,    0.0,  1e-5,      "deflection")             \\
    PARAMETER(kappa, STIFFNESS, 1e5,  1e-9, INF, "stiffness")              \\
    PARAMETER(F_max, FORCE,     1.0,  1e-9, INF, "force of sliding")       \\
    PARAMETER(eta_v, DAMPING,   0.4,  0.0,  INF, "viscous coefficient")

#define CONTACT           \\
    COULOMB  (F_max)      \\
    VISCOUS  (eta_v)      \\
    STIFFNESS(kappa)      \\
    DAMPING  (0, eta_v)

#define IDENTIFIED                    \\
    FIT    (kappa, stiffness, small)  \\
    FIT    (F_max, level, sliding)    \\
    FIT    (eta_v, viscous, fast)     \\
    SLIDING(z, F_max / kappa)
/* clang-format on */

#include "block.h"

static void equations(Model *m)
{
    GIVEN(m)
    m->der_z = v - kappa * fabs(v) * z / F_max;
    m->F = kappa * z + eta_v * v;
}
"""

LAW = '''\
"""Feedforward of a slipping spring."""

from casadi import SX, tanh

from friction_fmus.lawkit.law import (
    ACCELERATION,
    DAMPING,
    FORCE,
    MASS,
    NO_UNIT,
    VELOCITY,
    Friction,
    Input,
    Output,
    Parameter,
    Use,
    law,
)


@law(
    "SlippingFeedforward",
    "Feedforward of sliding friction",
    source="A test",
    Ts=1e-3,
    friction=Friction("F_max", viscous="eta_v"),
    use=Use("feedforward", models=("SlippingSpring",), tuned={"m": "0", "v_t": "max(5 * v_noise, 1e-3 * speed, 1e-9)"}),
    outputs={"u": Output(FORCE, "feedforward force"), "F_hat": Output(FORCE, "friction of the model")},
)
def slipping_feedforward(
    rd: SX = Input(VELOCITY, 0.0, "reference velocity"),
    rdd: SX = Input(ACCELERATION, 0.0, "reference acceleration"),
    gain: SX = Parameter(NO_UNIT, 1.0, "share of the friction that is compensated", min=0.0, max=1.0),
    m: SX = Parameter(MASS, 1.0, "mass", min=0.0),
    F_max: SX = Parameter(FORCE, 1.0, "force of sliding", min=0.0),
    eta_v: SX = Parameter(DAMPING, 0.4, "viscous coefficient", min=0.0),
    v_t: SX = Parameter(VELOCITY, 1e-3, "velocity over which the sign is smoothed", min=1e-12),
) -> dict[str, SX]:
    """Force that moves a mass with sliding friction along the reference.

    F_hat = F_max tanh(rd/v_t) + eta_v rd

    Use it to test that one file is enough.
    """
    friction = F_max * tanh(rd / v_t) + eta_v * rd
    return {"u": m * rdd + gain * friction, "F_hat": friction}
'''


TARGET = """\
from friction_fmus.export.targets import Option, Target


def write(source, path, *, shout=False):
    text = f"{source.identifier} has {len(source.units)} C files"
    path.write_text(text.upper() if shout else text, encoding="utf-8")


TARGET = Target("a note", "fmu", write, ".txt", (Option("shout", "in capitals"),))
"""

LAW_TARGET = """\
from friction_fmus.export.targets import Option, Target


def write(model, folder, *, start, prefix, language="en"):
    folder.mkdir()
    (folder / "law.txt").write_text(f"{model} {start} {language}", encoding="utf-8")
    return (folder / "law.txt",)


TARGET = Target("a letter", "law", write, options=(Option("language", "of the letter", ("en", "fr")),))
"""


@pytest.fixture
def own_targets(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    folder = tmp_path_factory.mktemp("targets")
    (folder / "short_note.py").write_text(TARGET, encoding="utf-8")
    (folder / "letter.py").write_text(LAW_TARGET, encoding="utf-8")
    targets.targets.cache_clear()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(targets, "__path__", [*targets.__path__, str(folder)])
        yield
    targets.targets.cache_clear()


@pytest.mark.usefixtures("own_targets")
def test_a_target_of_one_file_is_a_choice_of_every_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["build", "Viscous", "--target", "short-note", "-o", str(tmp_path)]) == 0
    assert (tmp_path / "Viscous.txt").read_text() == "Viscous has 1 C files"
    build("Viscous", tmp_path, target="short-note", shout=True, domain="rotational")
    assert (tmp_path / "ViscousRotational.txt").read_text() == "VISCOUSROTATIONAL HAS 1 C FILES"
    out = str(tmp_path / "axis.txt")
    assert main(["compose", str(STICK_SLIP), "--target", "short-note", "--shout", "-o", out]) == 0
    assert (tmp_path / "axis.txt").read_text() == "AXIS HAS 3 C FILES"
    law = ["codegen", "PID", "--target", "letter", "--language", "fr", "--set", "Kp=2", "-o", str(tmp_path / "c")]
    assert main(law) == 0
    assert (tmp_path / "c" / "law.txt").read_text() == "PID {'Kp': 2.0} fr"
    capsys.readouterr()
    with pytest.raises(SystemExit):
        main(["codegen", "--help"])
    assert "letter: a letter" in " ".join(capsys.readouterr().out.split())


@pytest.mark.usefixtures("own_targets")
@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"clocks": True}, "the target fmi2 has no option clocks: choose the target fmi3, or leave it out"),
        ({"shout": True, "fmi": 3}, "the target fmi3 has no option shout: choose the target short-note"),
        ({"clox": False}, "the target fmi2 has no option clox: leave it out"),
        ({"target": "fmi4"}, "there is no target 'fmi4': give one of fmi2"),
    ],
)
def test_an_option_of_another_target_is_refused(given: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(BuildError, match=re.escape(message)):
        build("Viscous", tmp_path, **given)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("own")
    (folder / "SlippingSpring.c").write_text(MODEL, encoding="utf-8")
    (folder / "slipping_feedforward.py").write_text(LAW, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(OWN_BLOCKS, str(folder))
        yield folder


@pytest.mark.parametrize("name", ["SlippingSpring", "SlippingFeedforward"])
def test_they_are_built_checked_and_documented(name: str, folder: Path, tmp_path: Path) -> None:
    path = build(name, tmp_path)
    assert check(path) == []
    page = zipfile.ZipFile(path).read("documentation/index.html").decode()
    assert catalogue()[name].summary in page and "<h2>Variables</h2>" in page


@nightly
def test_they_stand_in_lists_and_tables(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["list"]) == 0
    listed = capsys.readouterr().out
    assert "SlippingSpring" in listed and "SlippingFeedforward" in listed
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "docs"))
    tables = import_module("tables")
    sys.modules.pop("tables")
    assert "## SlippingSpring" in tables.models()
    rows = {row.name: row for row in tables.MOTIONS}
    assert "SlippingSpring" in tables.suited_models(rows["presliding"])
    (presliding,) = (line for line in tables.motions().splitlines() if "**[Dahl](" in line)
    assert "[SlippingSpring](models.md#slippingspring)" in presliding.split("|")[6]
    assert "**SlippingFeedforward**" in tables.compensators()


def test_the_law_is_exported_as_c(folder: Path, tmp_path: Path) -> None:
    files = {path.name for path in export_law("SlippingFeedforward", tmp_path / "c")}
    assert {"law.c", "law.h", "law.hpp", "law_test.c", "README.md"} <= files


@nightly
def test_a_study_identifies_the_model_tries_the_law_and_evaluates_its_conditions(folder: Path, tmp_path: Path) -> None:
    assert "SlippingSpring" in identifiable()
    demo = load_config("demo")
    wanted = replace(demo.compensation, compensators=("SlippingFeedforward",), gains=(0.5, 1.0))
    result = run_study(replace(demo, models=("SlippingSpring",), compensation=wanted), tmp_path)
    model = next(row for row in result.models if row.name == "SlippingSpring")
    assert model.rank is not None and result.plant == "SlippingSpring"
    assert {"kappa", "F_max", "eta_v", "M"} <= {parameter.name for parameter in model.parameters}
    none, law = sorted(result.compensators, key=lambda row: row.name != "none")
    assert law.name == "SlippingFeedforward" and law.applies and law.metrics is not None and none.metrics is not None
    assert law.metrics.rms < 0.7 * none.metrics.rms
    assert result.recommendation.name == "SlippingFeedforward"
    assert "over-compensation" in {condition.name for condition in result.conditions}


def test_two_blocks_of_one_name_are_refused(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "again.c").write_text(MODEL.replace("SlippingSpring", "LuGre"), encoding="utf-8")
    monkeypatch.setenv(OWN_BLOCKS, str(tmp_path))
    with pytest.raises(FrictionError, match=r"Two blocks are called LuGre: .*LuGre\.c and .*again\.c"):
        catalogue()


def test_a_folder_that_does_not_exist_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(OWN_BLOCKS, str(tmp_path / "nowhere"))
    with pytest.raises(FrictionError, match=r"names the folder .*nowhere, which does not exist"):
        catalogue()
