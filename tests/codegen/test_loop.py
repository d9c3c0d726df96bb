"""A servo with feedforward and compensator as one unit: the numbers of its laws, its limits, and what it refuses."""

from __future__ import annotations

import ctypes
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from codegen.test_numbers import same_numbers
from thorough import landing, nightly, some

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.law_runs import LawC, compile_, rows_of, run_casadi
from friction_fmus.__main__ import main
from friction_fmus.axis.position_map import Grid, PositionMap
from friction_fmus.blocks.axis_units import words_of
from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.blocks.macros import si_units
from friction_fmus.codegen.law_export import export_law, make_export, readme
from friction_fmus.codegen.layout import Export, equations_of
from friction_fmus.codegen.servo_law import LoopFile, LoopLaw, loop_law, loop_text, read_loop
from friction_fmus.codegen.sources import header, implementation
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.law import Kind, Law
from harness.compiling import toolchain

TS = 1e-3
EXAMPLE = Path(__file__).parents[2] / "examples" / "loop.toml"
CASCADE = LoopLaw("CascadePPI", {"kp": 30.0, "kv": 190.0, "ki": 400.0, "m": 1.0})
FEEDFORWARD = LoopLaw("StaticFeedforward", {"Fc": 2.0, "m": 0.0})
ELEMENTS = LoopLaw("GMSFeedforward", {"N": 3.0, "m": 0.0})
OBSERVER = LoopLaw("DisturbanceObserver", {"fq": 20.0, "gain": 0.8})
ESTIMATOR = LoopLaw("ExtendedStateObserver", {"wo": 200.0}, output="F_hat", factor=0.7)


def loop(limit: float = 20.0, **laws: LoopLaw) -> LoopFile:
    return LoopFile(laws, TS, -limit, limit, offset=0.3, window=2)


LOOPS = {
    "servo": loop(servo=CASCADE),
    "feedforward": loop(feedforward=FEEDFORWARD, servo=CASCADE),
    "observer": loop(compensator=OBSERVER, servo=CASCADE),
    "limited": loop(2.0, feedforward=FEEDFORWARD, compensator=OBSERVER, servo=CASCADE),
    "factor": loop(feedforward=FEEDFORWARD, compensator=ESTIMATOR, servo=CASCADE),
    "measured velocity": replace(loop(compensator=OBSERVER, servo=LoopLaw("PID", {"Kp": 9e3})), window=0, offset=None),
    "without motion": loop(servo=replace(CASCADE, connections={"rd": 0.0, "rdd": 0.0}), compensator=OBSERVER),
    "vectors": loop(
        feedforward=LoopLaw("GMSFeedforward", {"N": 3.0, "m": 0.0}),
        compensator=LoopLaw("KalmanFriction"),
        servo=CASCADE,
    ),
    "known force": replace(loop(feedforward=FEEDFORWARD, compensator=OBSERVER, servo=CASCADE), known_force=True),
    "rotary": replace(loop(servo=CASCADE, compensator=OBSERVER), rotary=True, v0=0.02),
    "load": loop(
        load=LoopLaw("LoadFeedforward", {"m": 0.0, "G_sin": 0.4, "G_cos": 2.0, "pitch": 0.01}),
        feedforward=FEEDFORWARD,
        compensator=OBSERVER,
        servo=CASCADE,
    ),
    "load of an observer": loop(load=LoopLaw("LoadFeedforward"), compensator=LoopLaw("LuGreObserver"), servo=CASCADE),
    "own limit": loop(
        compensator=replace(OBSERVER, parameters={"u_min": -0.5, "u_max": 0.5}), servo=LoopLaw("ResetPID")
    ),
}


def motion(n: int) -> dict[str, np.ndarray]:
    """A reference with three reversals, followed with a lag and noise; the laws are disabled and reset once."""
    t = TS * np.arange(n)
    phase = 2.0 * np.pi * 2.0 * t
    r = 5e-3 * np.sin(phase)
    x = 5e-3 * np.sin(phase - 0.1) + 1e-6 * np.random.default_rng(1).normal(size=n)
    rd, rdd = 5e-3 * 4.0 * np.pi * np.cos(phase), -5e-3 * (4.0 * np.pi) ** 2 * np.sin(phase)
    enable, reset = np.ones(n), np.zeros(n)
    enable[n // 3 : n // 3 + 5], reset[n // 2] = 0.0, 1.0
    return {
        "r": r,
        "rd": rd,
        "rdd": rdd,
        "x": x,
        "v": np.gradient(x, TS),
        "enable": enable,
        "reset": reset,
        "f_known": 3.0 * np.sin(3.0 * phase),
    }


class Separate:
    """The laws of a loop, evaluated one after the other with connections written out by hand."""

    def __init__(self, description: LoopFile) -> None:
        self.loop = description
        self.laws = {name: self._law(entry) for name, entry in description.laws.items()}
        self.values = {name: self._values(name) for name in description.laws}
        self.positions: list[float] = []
        self.u = self.known = self.f_known = self.load = 0.0

    def _law(self, entry: LoopLaw) -> Law:
        return make_export(entry.law).law

    def _values(self, name: str) -> dict[str, float]:
        limits = {"Ts": TS, "u_min": self.loop.u_min, "u_max": self.loop.u_max}
        own = {v.name for v in self.laws[name].given}
        return {key: v for key, v in {**limits, **self.loop.laws[name].parameters}.items() if key in own}

    def sample(self, given: dict[str, float]) -> float:
        if self.loop.window:
            v0 = self.loop.v0 or 0.0
            before = [given["x"] - 2.0 * v0 * TS, given["x"] - v0 * TS]
            self.positions = [*(self.positions or before), given["x"]][-3:]
            given = {**given, "v": (self.positions[2] - self.positions[0]) / (2.0 * TS)}
        offset = self.loop.offset or 0.0
        loaded = self._one("load", given) if "load" in self.laws else {"u": 0.0}
        given = {**given, **({"Fn": loaded["Fn"]} if "load" in self.laws else {})}
        last_load, self.load = self.load, loaded["u"]
        forces = {"feedforward": 0.0, "compensator": 0.0}
        for name in forces:
            if name in self.laws:
                fed_back = self.u - offset - (self.known if name == "compensator" else 0.0)
                fed_back -= last_load if name == "compensator" else 0.0
                fed_back -= self.f_known if name == "compensator" else 0.0
                output = self.loop.laws[name].output
                forces[name] = (self.loop.laws[name].factor or 1.0) * self._one(name, {**given, "u_prev": fed_back})[
                    output
                ]
        f_known = given["f_known"] if self.loop.known_force else 0.0
        f = forces["feedforward"] + forces["compensator"] + loaded["u"] + f_known + offset
        self.known, self.f_known = forces["feedforward"], f_known
        self.u = self._one("servo", {**given, "f": f})["u"]
        return self.u

    def _one(self, name: str, given: dict[str, float]) -> dict[str, float]:
        law, values = self.laws[name], self.values[name]
        inputs = {v.name for v in law.select(Kind.INPUT, Kind.OPTIONAL, Kind.COMMAND)} - {"f_prev"}
        constant = {key: v for key, v in self.loop.laws[name].connections.items() if isinstance(v, float)}
        found = law.evaluate({**values, **{key: v for key, v in {**given, **constant}.items() if key in inputs}})
        values.update({v.name: found[v.name] for v in law.select(Kind.STATE, Kind.STATES)})
        return found


@pytest.mark.parametrize("name", some([*LOOPS], [*LOOPS][::4]))
def test_the_unit_computes_its_laws_one_after_the_other(name: str) -> None:
    """With the same bits: its laws are evaluated one by one, and connected here."""
    law, given = loop_law(LOOPS[name]), motion(600)
    labels = [v.name for v in law.given for _ in v.starts]
    start = [s for v in law.given for s in v.starts]
    rows = np.array([given.get(label, np.full(600, value)) for label, value in zip(labels, start, strict=True)]).T
    found = run_casadi(law, rows)[:, 0]
    separate = Separate(LOOPS[name])
    expected = [separate.sample({key: float(column[k]) for key, column in given.items()}) for k in range(600)]
    np.testing.assert_array_equal(found, expected)
    assert np.ptp(found) > 1.0


def test_the_c_code_has_the_numbers_of_the_law(tmp_path: Path) -> None:
    export = make_export(EXAMPLE)
    given = motion(3000)
    rows = rows_of(export, {v.name: given.get(v.name, np.full(3000, v.start)) for v in export.groups["inputs"]})
    assert same_numbers(LawC(export, tmp_path).run(rows, feeds_back=True), run_casadi(export.law, rows))


def test_the_limits_hold_for_the_sum_and_stop_the_integral() -> None:
    """An error of 1 mm is 5.7 N, the offset is 0.3 N: with the limit 2 N, the integral never starts."""
    law = loop_law(loop(2.0, compensator=OBSERVER, servo=CASCADE))
    names = [v.name for v in law.given for _ in v.starts]
    values = {v.name: v.start for v in law.given} | {"r": 1e-3, "x": 0.0}
    for _ in range(50):
        found = law.evaluate(values)
        values |= {v.name: found[v.name] for v in law.results if v.kind is not Kind.OUTPUT}
        assert found["u"] == 2.0
        assert found["u_sat"] == 1.0
        assert found["servo_integral"] == 0.0
        assert found["u_last"] == 2.0
    assert "servo_integral" in names


def test_a_law_may_be_in_a_file_beside_that_of_the_loop(tmp_path: Path) -> None:
    law = laws_folder() / "static_feedforward.py"
    (tmp_path / "own.py").write_text(law.read_text(encoding="utf-8").replace("StaticFeedforward", "Own"), "utf-8")
    path = tmp_path / "loop.toml"
    path.write_text(loop_text(loop(feedforward=LoopLaw("own.py"), servo=CASCADE), "A loop"), encoding="utf-8")
    export = make_export(path)
    assert export.law.summary == "CascadePPI with Own"
    assert "computed in the order feedforward, servo," in " ".join(header(export).split())


def test_variables_without_effect_are_omitted() -> None:
    """The output F_hat of ExtendedStateObserver does not depend on its limits."""
    law = loop_law(loop(compensator=ESTIMATOR, servo=replace(CASCADE, connections={"rd": 0.0, "rdd": 0.0})))
    names = {v.name for v in law.variables}
    assert {"compensator_wo", "compensator_m", "factor_compensator", "offset", "x_past"} <= names
    assert not {"compensator_u_min", "compensator_u_max", "servo_m"} & names


def test_the_equations_stand_at_the_operations_of_their_law() -> None:
    export = make_export(EXAMPLE)
    text = implementation(export)
    for equation in equations_of(export.law.documentation, export.law.prefixes):
        assert text.count(f"/* ({equation.number}) ") == 1
    at = text.index(") F_m = u_prev - f_prev - m (v - v_last)/Ts")
    assert "compensator_F_m = " in text[at : at + 200]
    at = text.index(") w = kp (r - x) + (rd - v)")
    assert "servo_w = " in text[at : at + 100]
    assert "feedforward is LuGreFeedforward" in header(export)


def test_a_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    for number, description in enumerate(LOOPS.values()):
        path = tmp_path / f"{number}.toml"
        path.write_text(loop_text(description, "A loop"), encoding="utf-8")
        assert read_loop(path) == replace(description, laws=dict(description.laws), path=path)


NODES = 9
TABLE = PositionMap(Grid(-0.01, 0.004, NODES), tuple(np.sin(np.arange(9.0))), tuple(0.1 * np.cos(np.arange(9.0))), 1e-3)


@landing
@pytest.mark.parametrize("real", some(["double", "float"], ["float"]))
@pytest.mark.parametrize("periodic", some([False, True], [True]))
@pytest.mark.parametrize("place", some([0.0, 10.0], [10.0]))
def test_the_table_is_that_of_the_axis(
    place: float, periodic: bool, real: Literal["double", "float"], tmp_path: Path
) -> None:
    """Inside, at the nodes, and beyond both ends; in float at 10 m as near zero, as a position is a pair."""
    begin = TABLE.grid.begin + (0.0 if periodic else place)
    table = replace(TABLE, grid=replace(TABLE.grid, begin=begin, periodic=periodic))
    path = tmp_path / "loop.toml"
    path.write_text(loop_text(replace(LOOPS["servo"], table=table), "A loop"), encoding="utf-8")
    assert read_loop(path).table == table
    files = export_law(path, tmp_path, real=real)
    assert {"loop_table.h", "loop_table.c"} <= {file.name for file in files}
    warnings = ["-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Wshadow", "-Werror"]
    command = [*toolchain.compiler(), "-std=c99", "-O1", *warnings, "main.c", "loop.c", "loop_table.c", "-lm"]
    subprocess.run([*command, "-o", "program"], cwd=tmp_path, check=True)
    x = place + np.concatenate([np.linspace(-0.05, 0.06, 400), -0.01 + 0.004 * np.arange(NODES)])
    v = 2e-3 * np.cos(np.arange(x.size))
    kind = ctypes.c_double if real == "double" else ctypes.c_float
    function = compile_(tmp_path / "loop_table.c").loop_table
    high = x.astype(np.float32).astype(float)
    columns = (x, v) if real == "double" else (high, x - high, v)
    function.restype, function.argtypes = kind, [kind] * len(columns)
    found = np.array([function(*values) for values in zip(*columns, strict=True)])
    np.testing.assert_allclose(found, -table.force(x, v), atol=1e-12 if real == "double" else 1e-5)
    text = " ".join((tmp_path / "README.md").read_text(encoding="utf-8").split())
    arguments = "r, rd" if real == "double" else "r, r_low, rd"
    assert f"assign `loop_table({arguments})` to `f_known` before each `loop_step`" in text


def test_a_rotary_loop_has_the_same_code_in_its_units() -> None:
    linear, rotary = (make_export(EXAMPLE, real="float"), rotary_export("float"))
    assert rotary.pairs == linear.pairs
    assert implementation(rotary) == implementation(linear)
    text, page = header(rotary), readme(rotary, ())
    for unit in ("N.m", "rad", "rad/s", "rad/s2", "N.m.s/rad", "N.m/rad", "kg.m2", "Hz"):
        assert f"[{unit}]" in text
    linear_units = [line for line in text.splitlines() if re.search(r"\[(N|m|m/s|m/s2|kg|N/m|N\.s/m)\]", line)]
    assert all("normal force" in line for line in linear_units)  # which is one in both kinds
    assert "control torque" in text
    assert "the sum of all torques" in " ".join(text.split())
    assert "around 0, 0.1, 1 and 10 rad" in page


def test_the_nouns_of_the_c_code_are_those_of_the_messages() -> None:
    for rotary in (False, True):
        found, words = si_units(rotary=rotary), words_of(rotary)
        nouns = [found[name] for name in ("FORCE_NOUN", "MASS_NOUN", "MOVING_MASS")]
        assert nouns == [words.force, words.mass, words.moving_mass]
        quantities = [found[name] for name in ("LENGTH", "VELOCITY", "FORCE", "MASS", "STIFFNESS", "DAMPING")]
        assert quantities == [words.m, words.m_s, words.N, words.kg, words.N_m, words.Ns_m]


def rotary_export(real: Literal["float", "double"]) -> Export:
    """The example with `rotary = true`; its path is the same, so that the comments are, too."""
    law = loop_law(replace(read_loop(EXAMPLE), rotary=True))
    return replace(make_export(EXAMPLE, real=real), law=law, rotary=True)


@nightly
def test_the_command_writes_all_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["codegen", str(EXAMPLE), "-o", str(tmp_path), "--real", "float", "--set", "servo_kp=25"]) == 0
    names = {"loop.h", "loop.c", "loop_test.c", "loop.hpp", "main.c", "README.md"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert "parameters->servo_kp = 25.0f;" in (tmp_path / "loop.c").read_text(encoding="utf-8")


SETTINGS = "[loop]\nTs = 1e-3\nu_min = -20\nu_max = 20\nwindow = 2\n"
SERVO = '[servo]\nlaw = "CascadePPI"\n'
GRID = "[table]\nbegin = 0\nspacing = 1\nperiodic = false\nv_sign = 1\n"
WRONG = {
    "unknown law": (
        SETTINGS + '[servo]\nlaw = "CascadePI"\n',
        "There is no model 'CascadePI' (did you mean CascadePPI?)",
    ),
    "a block in C": (
        SETTINGS + SERVO + '[compensator]\nlaw = "RepetitiveController"\n',
        "RepetitiveController is written in C and cannot be joined with the laws",
    ),
    "unknown connection": (
        SETTINGS + SERVO + "[servo.connections]\nrdx = 0.0\n",
        "connects rdx, but CascadePPI has no such input to connect (did you mean rd?)",
    ),
    "unknown signal": (
        SETTINGS + SERVO + '[servo.connections]\nrd = "speed"\n',
        "connects rd to 'speed', which is not an input of the loop",
    ),
    "unknown parameter": (SETTINGS + SERVO + "[servo.parameters]\nkq = 1.0\n", "CascadePPI has no parameter 'kq'"),
    "value outside its limits": (SETTINGS + SERVO + "[servo.parameters]\nkp = -1.0\n", "kp = -1 lies outside [0, inf]"),
    "no force": (
        SETTINGS + SERVO + '[compensator]\nlaw = "ExtendedStateObserver"\noutput = "v_est"\n',
        "the outputs of ExtendedStateObserver with a force are u, F_hat",
    ),
    "no load": (
        SETTINGS + SERVO + '[load]\nlaw = "InverseDynamics"\n',
        "[load], names InverseDynamics, which has no output Fn; choose LoadFeedforward",
    ),
    "factor of a load": (SETTINGS + SERVO + '[load]\nlaw = "LoadFeedforward"\nfactor = 2.0\n', "unknown key 'factor'"),
    "no input for forces": (
        SETTINGS + '[servo]\nlaw = "AdaptiveSlidingMode"\n[compensator]\nlaw = "DisturbanceObserver"\n',
        "AdaptiveSlidingMode, which has no input f for the force of other laws",
    ),
    "no servo": (SETTINGS, "has no table [servo]; add it"),
    "no sample time": ("[loop]\nu_min = -20\nu_max = 20\n" + SERVO, "[loop], has no Ts; add it"),
    "exchanged limits": ("[loop]\nTs = 1e-3\nu_min = 20\nu_max = -20\n" + SERVO, "has u_min above u_max"),
    "a text in place of a number": (
        SETTINGS + 'offset = "none"\n' + SERVO,
        "has offset = 'none'; give a finite number",
    ),
    "unknown table": (SETTINGS + SERVO + "[estimator]\n", "has the unknown table 'estimator'"),
    "a study": (
        '[data]\nfile = "axis.csv"\n[servo]\nlaw = "PID"\n',
        "describes a study, not a loop; run `friction-fmus",
    ),
    "a short table": (
        SETTINGS
        + SERVO
        + "[table]\nbegin = 0\nspacing = 1\nperiodic = false\nv_sign = 1\ncogging = [1]\nfriction = [1]\n",
        "give one of each for at least 4 nodes",
    ),
    "no table": (SETTINGS + SERVO + "[table]\nbegin = 0\n", "[table], has no spacing; add it"),
    "no Boolean": (SETTINGS + "rotary = 1\n" + SERVO, "has rotary = 1; give true or false"),
    "no toml": ("[loop", "cannot be read as TOML"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_file_is_refused(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In one sentence, with the status of wrong input, before anything is written."""
    text, message = WRONG[name]
    path = tmp_path / "loop.toml"
    path.write_text(text, encoding="utf-8")
    assert main(["codegen", str(path), "-o", str(tmp_path / "c")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert not (tmp_path / "c").exists()


def test_a_study_without_a_recommendation_writes_no_loop(tmp_path: Path) -> None:
    with pytest.raises(FrictionError, match=r"of a study that recommends a compensation"):
        make_export(tmp_path / "recommended" / "loop.toml")


def test_zeros_are_written(tmp_path: Path) -> None:
    """A factor, a limit, an offset and a first velocity of 0 are not missing."""
    laws = {
        "feedforward": LoopLaw("StaticFeedforward", {"Fc": 0.0}, {"Ff": 0.0}, factor=0.0),
        "servo": LoopLaw("PID", {"Kp": 30.0}),
    }
    for low, high in ((0.0, 20.0), (-20.0, 0.0)):
        loop = LoopFile(laws, 1e-3, low, high, offset=0.0, window=2, v0=0.0, path=tmp_path / "loop.toml")
        loop.path.write_text(loop_text(loop, "A loop"), encoding="utf-8")
        assert read_loop(loop.path) == loop
