"""Joints of simulators: files that their readers accept, parameters by hand, and motion against the identified axis."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from lxml import etree
from thorough import landing, some

from friction_fmus import BuildError
from friction_fmus.__main__ import main
from friction_fmus.axis import simulator_joint
from friction_fmus.axis.position_map import Grid, PositionMap
from friction_fmus.axis.simulator_joint import coulomb_law, equivalence, simulator, stribeck_law
from friction_fmus.export.identified_axis import IdentifiedAxis
from friction_fmus.export.targets import mjcf, targets
from harness import ExperimentError

PAGE = Path(__file__).parents[2] / "docs" / "simulators.md"


def axis(
    name: str, model: str, mass: float, speed: float, *, viscous: float = 0.0, offset: float = 0.0, **parameters: float
) -> IdentifiedAxis:
    known = {"rotary": name in ("servo", "arm"), "label": model, "position": None, "viscous": viscous}
    return IdentifiedAxis(name, "", model=model, mass=mass, speed=speed, offset=offset, parameters=parameters, **known)


# `friction-fmus identify examples/identification/emps.toml --viscous` and `friction-fmus study demo`; the joint is the
# servo of docs/identification.md with load="M2", whose arm has 0.0049 kg.m2
EMPS = axis("EMPS", "Coulomb", 94.894, 0.1278, Fc=20.473, viscous=202.47, offset=-3.063)
JOINT = axis("servo", "Stribeck", 0.00736, 4.7, Fc=0.12299, Fs=0.17159, Fv=0.0037037, vs=0.24178, delta=2.2694)
LUGRE = axis(
    "demo", "LuGre", 1.0001, 0.0204, sigma0=99983.0, sigma1=316.76, sigma2=0.39827, Fc=1.00002, Fs=1.4996, vs=0.00099836
)
DAHL = axis("EMPS", "Dahl", 95.199, 0.1278, sigma=5.8938e6, Fc=20.914, n=3.4741, viscous=199.43, offset=-3.2365)
ELASTIC = axis(
    *("EMPS", "ElastoPlastic", 95.018, 0.1278),
    **{"sigma0": 397746.0, "sigma1": 2535.7, "sigma2": 191.73, "Fc": 21.601, "Fs": 18.224, "vs": 0.025744},
    **{"z_ba": 0.0017689, "offset": -3.0821},
)
AXES = (EMPS, JOINT, LUGRE, DAHL, ELASTIC)


def written(target: str, given: IdentifiedAxis, folder: Path) -> str:
    (path,) = targets("axis")[target].write(given, folder)
    return str(path.read_text(encoding="utf-8"))


@pytest.fixture
def uncompared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files without the simulations, which take most of the time."""
    monkeypatch.setattr(simulator_joint, "equivalence", lambda *_: (1.0, 0.0, np.zeros((2, 2))))


def bounded_constraint(mass: float, Fc: float, Fv: float) -> Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, ...]]:
    """Joint friction as physics engines document it: a force within +-Fc that takes the velocity to 0 in a step.

    JointCoulombFrictionConstraint of DART, which Gazebo fills with friction and damping of SDF; damping is implicit.
    """

    def run(t: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, ...]:
        h, x, v = t[1] - t[0], np.zeros_like(t), np.zeros_like(t)
        for k in range(len(t) - 1):
            free = (mass * v[k] + h * force[k]) / (mass + h * Fv)
            impulse = np.clip(-free * (mass + h * Fv), -h * Fc, h * Fc)
            v[k + 1] = free + impulse / (mass + h * Fv)
            x[k + 1] = x[k] + h * v[k + 1]
        return x, v

    return run


@pytest.mark.usefixtures("uncompared")
def test_friction_loss_and_damping_are_those_of_a_coulomb_axis(tmp_path: Path) -> None:
    model = mujoco.MjModel.from_xml_string(written("mjcf", EMPS, tmp_path))
    assert model.dof_frictionloss[0] == pytest.approx(20.473, rel=1e-5)
    assert model.dof_damping.ravel()[0] == pytest.approx(202.47, rel=1e-5)
    assert (model.body_mass[1], model.jnt_type[0]) == (94.894, mujoco.mjtJoint.mjJNT_SLIDE)
    assert model.dof_solref[0, 0] == 2.0 * model.opt.timestep
    assert list(model.dof_solimp[0, :2]) == [0.9999, 0.9999]


def test_parameters_are_the_least_squares_over_the_speeds() -> None:
    """For Fc + D exp(-v/vs) at uniformly distributed speeds up to V, the normal equations have closed integrals."""
    D, vs, V = 10.0, 0.02, 0.1
    given = axis("curve", "Stribeck", 5.0, V, Fc=20.0, Fs=20.0 + D, Fv=90.0, vs=vs, delta=1.0)
    rest = math.exp(-V / vs)
    moments = [D * vs * (1.0 - rest), D * (vs**2 - rest * (vs**2 + V * vs))]
    more = np.linalg.solve([[V, V**2 / 2.0], [V**2 / 2.0, V**3 / 3.0]], moments)
    law = coulomb_law(given).values
    assert [law["Fc"] - 20.0, law["Fv"] - 90.0] == pytest.approx(more, rel=5e-3)
    assert law["Fs"] == law["Fc"]


def test_parameters_are_the_mean_of_both_directions() -> None:
    both = {"Fc": 2.0, "Fs": 2.0, "Fv": 5.0, "vs": 0.01, "asymmetric": 1.0}
    both |= {"Fc_neg": 3.0, "Fs_neg": 3.0, "Fv_neg": 7.0, "vs_neg": 0.01}
    law = coulomb_law(axis("two", "Stribeck", 1.0, 0.1, **both)).values
    assert (law["Fc"], law["Fv"]) == pytest.approx((2.5, 6.0), rel=2e-3)


@pytest.mark.parametrize("given", [LUGRE, DAHL, ELASTIC], ids=lambda each: each.model)
@pytest.mark.usefixtures("uncompared")
def test_bristles_of_a_model_with_presliding(given: IdentifiedAxis, tmp_path: Path) -> None:
    p = given.parameters
    model = mujoco.MjModel.from_xml_string(written("mjcf", given, tmp_path))
    stiffness = p.get("sigma0", p.get("sigma"))
    # Dahl is LuGre without damping (Canudas de Wit 1995); a fifth of the critical one, 2 sqrt(sigma m), stands for it
    damping = p.get("sigma1", 0.4 * math.sqrt(stiffness * given.mass))
    own = model.actuator_dynprm[1, 5:7], model.actuator_biasprm[1, 3:6], model.actuator_damping.ravel()
    assert own[0] == pytest.approx([stiffness, damping], rel=1e-5)
    assert own[1][:2] == pytest.approx([p["Fc"], p.get("Fs", p["Fc"])], rel=1e-5)
    if "vs" in p:
        assert own[1][2] == pytest.approx(p["vs"], rel=1e-5)
    assert p.get("sigma2", given.viscous) == pytest.approx(max(own[2]), rel=1e-5)
    assert model.dof_frictionloss[0] == 0.0
    # the explicit step damps the bristles: below (sigma1 + sigma2)/sigma0
    assert model.opt.timestep < 0.5 * (damping + max(own[2])) / stiffness


@landing
def test_bristles_that_are_too_stiff_are_softened_and_the_file_says_so(tmp_path: Path) -> None:
    given = replace(LUGRE, parameters={**LUGRE.parameters, "sigma0": 1e8})
    text = written("mjcf", given, tmp_path)
    model = mujoco.MjModel.from_xml_string(text)
    assert model.opt.timestep == 1e-4
    assert model.actuator_dynprm[1, 5] == pytest.approx(given.mass * (0.2 / 1e-4) ** 2, rel=1e-5)
    assert "- presliding with a stiffness of 1e+08 N/m" in text
    (numbers,) = re.findall(r"^- break-away: (\S+) N, joint (\S+) N$", text, re.M)
    own, level = map(float, numbers)
    assert level == pytest.approx(own, rel=0.01)


def test_creep_of_friction_loss_is_what_muJoCo_documents(tmp_path: Path) -> None:
    """Its constraint a + d b v = (1 - d) a0 has b = 2/(dw timeconst), and a0 = (F - Fv v)/m without friction loss."""
    _, _, (_, (level, creep)) = equivalence(EMPS, mjcf.mujoco_simulator(written("mjcf", EMPS, tmp_path)))
    constant = 1e-4 * 0.9999 * 0.002 / (2.0 * 0.9999) / EMPS.mass
    assert creep == pytest.approx(0.9 * level * constant / (1.0 + EMPS.viscous * constant), rel=1e-3)
    text = re.sub(r'solreffriction.*"', "", written("mjcf", EMPS, tmp_path))  # MuJoCo's defaults
    _, _, (_, (level, creep)) = equivalence(EMPS, mjcf.mujoco_simulator(text))
    constant = 0.1 * 0.95 * 0.02 / (2.0 * 0.9) / EMPS.mass
    assert creep == pytest.approx(0.9 * level * constant / (1.0 + EMPS.viscous * constant), rel=1e-3)


@pytest.mark.parametrize("given", [EMPS, JOINT], ids=lambda each: each.model)
@pytest.mark.usefixtures("uncompared")
def test_urdf(given: IdentifiedAxis, tmp_path: Path) -> None:
    text = written("urdf", given, tmp_path)
    model, law = mujoco.MjModel.from_xml_string(text), coulomb_law(given).values
    assert model.dof_frictionloss[0] == pytest.approx(law["Fc"], rel=1e-5)
    assert model.dof_damping.ravel()[0] == pytest.approx(law["Fv"], rel=1e-5)
    kinds = mujoco.mjtJoint
    inertia = model.body_inertia[1, 0] if given.rotary else model.body_mass[1]
    assert (inertia, model.jnt_type[0]) == (given.mass, kinds.mjJNT_HINGE if given.rotary else kinds.mjJNT_SLIDE)
    unit = "[N.m.s/rad] and friction [N.m]" if given.rotary else "[N.s/m] and friction [N]"
    assert f"damping {unit}" in text


@pytest.mark.parametrize("given", [EMPS, JOINT], ids=lambda each: each.model)
@pytest.mark.usefixtures("uncompared")
def test_sdf_has_the_elements_of_its_specification(given: IdentifiedAxis, tmp_path: Path) -> None:
    root, law = etree.fromstring(written("sdf", given, tmp_path).encode()), coulomb_law(given).values
    assert (root.tag, root.get("version")) == ("sdf", "1.6")
    (link, joint) = root.find("model")
    assert (joint.findtext("parent"), joint.findtext("child")) == ("world", link.get("name"))
    assert joint.get("type") == ("revolute" if given.rotary else "prismatic")
    found = {each: float(joint.findtext(f"axis/dynamics/{each}")) for each in ("friction", "damping")}
    assert found == pytest.approx({"friction": law["Fc"], "damping": law["Fv"]}, rel=1e-5)
    moved = link.findtext("inertial/inertia/ixx") if given.rotary else link.findtext("inertial/mass")
    assert float(moved) == given.mass
    # the elements that sdf/1.6/joint.sdf and inertial.sdf require
    needed = ("axis/xyz", "axis/limit/lower", "axis/limit/upper", "axis/dynamics/spring_reference")
    assert all(joint.find(each) is not None for each in (*needed, "axis/dynamics/spring_stiffness"))
    assert [each.tag for each in link.find("inertial/inertia")] == ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]


@pytest.mark.parametrize("given", [EMPS, JOINT], ids=lambda each: each.model)
def test_the_law_of_a_joint_is_the_constraint_of_physics_engines(given: IdentifiedAxis) -> None:
    law = coulomb_law(given)
    engine = bounded_constraint(law.mass, law.values["Fc"], law.values["Fv"])
    travel, difference, (_, joint) = equivalence(given, simulator(law, given.rotary))
    again, other, (_, documented) = equivalence(given, engine)
    assert again == travel
    assert other == pytest.approx(difference, abs=1e-3 * travel)  # its steps are of first order
    assert documented[0] == pytest.approx(joint[0], rel=2e-3)
    assert abs(documented[1]) < 1e-12
    assert abs(joint[1]) < 1e-12


def budget(p: dict[str, Any], motor: float, external: float, v: float) -> float:
    """The friction that M1 to M5 allow (Duclusaud and others, ICRA 2025), from a file of BAM."""
    s = math.exp(-(abs(v / p["dtheta_stribeck"]) ** p["alpha"])) if "alpha" in p else 0.0
    found = p["friction_base"] + s * p.get("friction_stribeck", 0.0)
    load = abs(external - motor)
    found += p.get("load_friction_base", 0.0) * load + s * p.get("load_friction_stribeck", 0.0) * load
    for end, part in (("", 1.0), ("_stribeck", s)):
        sides = (p.get(f"load_friction_{side}{end}", 0.0) for side in ("external", "motor"))
        found += part * abs(next(sides) * external - next(sides) * motor)
    return float(found + p["friction_viscous"] * abs(v))


@pytest.mark.parametrize(
    ("model", "static", "terms"),
    [
        ("m1", 0.3, {}),
        ("m2", 0.5, {}),
        ("m3", 0.3, {"a": 0.1}),
        ("m4", 0.5, {"a": 0.1, "G_sin": 0.4}),
        ("m5", 0.5, {"a_drive": 0.1, "a_external": 0.2}),
        ("m5", 0.3, {"a_drive": 0.1, "a_external": 0.2}),
    ],
)
def test_bam(model: str, static: float, terms: dict[str, float], tmp_path: Path) -> None:
    """The level of the friction is that of the equations in `friction_fmus.identification.fit.axis_terms`."""
    given = axis("arm", "Stribeck", 0.01, 4.0, Fc=0.3, Fs=static, Fv=0.02, vs=0.5, delta=1.4)
    p = json.loads(written("bam", replace(given, terms=terms), tmp_path))
    assert (p["model"], p["armature"]) == (model, 0.01)
    sides = terms.get("a_drive", terms.get("a", 0.0)), terms.get("a_external", terms.get("a", 0.0))
    for v, motor, external in ((0.1, 0.2, -0.3), (1.0, 0.5, 0.4), (4.0, -0.6, 0.1)):
        load = abs(sides[1] * external - sides[0] * motor)
        curve = 0.3 + (static - 0.3) * math.exp(-((v / 0.5) ** 1.4))
        assert budget(p, motor, external, v) == pytest.approx((1.0 + load / 0.3) * curve + 0.02 * v, rel=1e-12)
    said = "\n".join(p["about"])
    assert ("G_sin = 0.4" in said) == ("G_sin" in terms)
    assert "does not load the file without the name of an actuator" in said
    assert "rms difference 0 nrad" in said  # without load, the law is that of the axis


@pytest.mark.usefixtures("uncompared")
def test_what_a_joint_does_not_have_is_said(tmp_path: Path) -> None:
    table = PositionMap(Grid(-0.1, 0.1, 4), cogging=(1.0, 0.0, 1.0, 0.0), friction=(0.0,) * 4, v_sign=1e-4)
    given = replace(ELASTIC, position=table, terms={"a": 0.05})
    for target, kept in (("urdf", ()), ("sdf", ()), ("mjcf", ("18.22 N at rest", "presliding with"))):
        text = written(target, given, tmp_path)
        for part in ("18.22 N at rest instead of 21.6 N", "presliding with a stiffness of 3.977e+05 N/m", "a = 0.05"):
            assert (f"{part}" in text) != any(each in part for each in kept), (target, part)
        assert "constant force -3.082 N" in text
        assert "force over position" in text
    assert "Not in this joint" not in written("mjcf", replace(EMPS, offset=0.0), tmp_path)


def test_the_axis_is_simulated_as_it_was_identified() -> None:
    """With its own values for v < 0, and at the normal force of the record, Fn0, which the joint does not have."""
    p = {**JOINT.parameters, "asymmetric": 1.0, "Fn0": 5.0} | {f"{name}_neg": v for name, v in JOINT.parameters.items()}
    found = equivalence(replace(JOINT, parameters=p), simulator(stribeck_law(JOINT), True))
    assert found[1] < 1e-9 * found[0]
    p["Fc_neg"] = p["Fs_neg"] = 0.1
    found = equivalence(replace(JOINT, parameters=p), simulator(stribeck_law(JOINT), True))
    assert found[1] > 0.05 * found[0]


def test_an_axis_that_cannot_be_simulated_is_exported_without_a_comparison(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def fail(*_: object) -> None:
        raise ExperimentError("no solution")

    monkeypatch.setattr(simulator_joint, "equivalence", fail)
    assert "which could not be simulated: no solution" in written("urdf", EMPS, tmp_path)


def test_without_muJoCo_the_file_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    text = written("mjcf", EMPS, tmp_path)
    assert "Not compared with the axis: MuJoCo 4 is not installed." in text
    assert 'frictionloss="20.473"' in text


@pytest.mark.parametrize("target", ["mjcf", "urdf", "sdf", "bam"])
@pytest.mark.parametrize("mass", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.usefixtures("uncompared")
def test_a_joint_needs_a_mass(target: str, mass: float, tmp_path: Path) -> None:
    with pytest.raises(BuildError, match="needs a positive mass, but that of EMPS"):
        written(target, replace(EMPS, mass=mass), tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("uncompared")
def test_models_without_a_declared_or_exponential_curve(tmp_path: Path) -> None:
    for given in (replace(EMPS, label="RateAndState", model="RateAndState"), replace(JOINT, parameters={"shape": 1.0})):
        for target in ("mjcf", "urdf", "sdf", "bam"):
            with pytest.raises(BuildError, match=f"{given.label} states no exponential Stribeck curve; choose another"):
                written(target, given, tmp_path)


@pytest.mark.parametrize("name", ['x -- <axis> & "y" \x00\x1b[1m', "---", "world", "Achse für Öl", "1::2"])
@pytest.mark.usefixtures("uncompared")
def test_any_name(name: str, tmp_path: Path) -> None:
    given = replace(EMPS, name=name, citation="A -- B -> C")
    for target in ("mjcf", "urdf"):
        assert mujoco.MjModel.from_xml_string(written(target, given, tmp_path)).njnt == 1
    root = etree.fromstring(written("sdf", given, tmp_path).encode())
    names = [each.get("name") for each in root.iter() if each.get("name")]
    assert all(re.fullmatch(r"\w+", each, re.ASCII) and each != "world" for each in names)
    assert json.loads(written("bam", given, tmp_path))["model"] == "m1"


@pytest.mark.parametrize("given", some(AXES, (JOINT, LUGRE)), ids=lambda each: f"{each.name}-{each.model}")
def test_joint_in_muJoCo_against_the_axis_as_identified(given: IdentifiedAxis, tmp_path: Path) -> None:
    """The numbers of the table on the page, at 10 %."""
    text = written("mjcf", given, tmp_path)
    step = float(re.findall(r'timestep="(\S+)"', text)[0])
    travel, difference, ((own, still), (level, creep)) = equivalence(given, mjcf.mujoco_simulator(text), step)
    found = [1e3 * step, 100.0 * difference / travel, own, level, 1e9 * still, 1e9 * creep]
    travel, difference, (_, (level, _)) = equivalence(given, simulator(coulomb_law(given), given.rotary))
    found += [100.0 * difference / travel, level]
    (row,) = re.findall(rf"^\| {given.name}.*\| {given.model} \|(.*)\|$", PAGE.read_text(encoding="utf-8"), re.M)
    said = [float(each) for each in row.split("|")]
    assert found == pytest.approx(said, rel=0.1, abs=5e-3)


@pytest.mark.usefixtures("uncompared")
def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [vars(each) | {"terms": {}} for each in (EMPS, DAHL)]
    (tmp_path / "identification.json").write_text(json.dumps({"axes": rows}), encoding="utf-8")
    for target, file in (("mjcf", "mjcf.xml"), ("urdf", "joint.urdf"), ("sdf", "joint.sdf"), ("bam", "bam.json")):
        assert main(["export", str(tmp_path), "--to", target, "-o", str(tmp_path / "out")]) == 0
        assert capsys.readouterr().out.splitlines() == [str(tmp_path / "out" / file)]
    assert "20.473" in (tmp_path / "out" / "mjcf.xml").read_text(encoding="utf-8")
    assert main(["export", str(tmp_path), "--model", "Dahl", "--to", "mjcf", "-o", str(tmp_path / "out")]) == 0
    assert "dcmotor" in (tmp_path / "out" / "mjcf.xml").read_text(encoding="utf-8")
