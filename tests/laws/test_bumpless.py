"""Laws with the input u_track begin with this force, in casadi, in the FMU, and in C with double and float.

What a memory can carry is bounded in some laws: by the limits of u, or by the friction that a contact holds. The range
of u is therefore found with forces far beyond it; within it u must be u_track, and beyond it the nearest end.
"""

from __future__ import annotations

import ctypes
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from laws.draws import random_arguments
from shell.instance import Instance, load
from thorough import some

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.law_runs import LawC, casadi_by_rows, compile_, rows_of
from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.codegen.law_export import make_export, readme
from friction_fmus.codegen.servo_law import LoopFile, LoopLaw, loop_text
from friction_fmus.codegen.sources import header, implementation
from friction_fmus.lawkit.declarations import PARAMETERS
from friction_fmus.lawkit.law import Kind, Law, discover_laws

LAWS = {law.name: law for law in discover_laws(laws_folder())}
TRACKING = [name for name, law in LAWS.items() if any(v.name == "u_track" for v in law.variables)]
Ts = 1e-3
FAR = 1e6
START = {"CascadePPI": {"ki": 6e3}}
"""Parameters with which the memory acts."""


class Rows:
    """Arguments of a law by name, each row one sample.

    Parameters
    ----------
    law : Law
        The law.
    values : array, shape (n, arguments)
        The arguments.
    """

    def __init__(self, law: Law, values: np.ndarray) -> None:
        self.law = law
        self.values = values
        self._labels = [variable.name for variable in law.given for _ in variable.starts]

    def set(self, **values: np.ndarray | float) -> Rows:
        """The rows with other values."""
        found = self.values.copy()
        for name, value in values.items():
            found[:, [label == name for label in self._labels]] = np.reshape(value, (-1, 1))
        return Rows(self.law, found)

    def rounded(self, name: str) -> Rows:
        """The rows with a variable rounded to float."""
        columns = [label == name for label in self._labels]
        found = self.values.copy()
        found[:, columns] = found[:, columns].astype(np.float32)
        return Rows(self.law, found)

    def get(self, name: str) -> np.ndarray:
        """The column of a scalar."""
        return self.values[:, self._labels.index(name)]


def held_axis(law: Law, n: int, seed: int) -> Rows:
    """An axis somewhere within 10 m, near its reference, and states of anything."""
    random = np.random.default_rng(seed)
    rows = Rows(law, random_arguments(law, n, seed))
    names = {variable.name for variable in law.given}
    place = random.uniform(-10.0, 10.0, n)
    near = {
        "r": place + 1e-4 * random.normal(size=n),
        "x": place,
        "rd": 0.01 * random.normal(size=n),
        "v": 0.01 * random.normal(size=n),
        "rdd": random.normal(size=n),
        "jerk": 0.0,
        "last": place,
        "x_last": place,
        "x_hat": place,
        "v_hat": 0.01 * random.normal(size=n),
        "u_min": random.uniform(-200.0, -20.0, n),
        "u_max": random.uniform(20.0, 200.0, n),
        "Ts": Ts,
        "enable": 1.0,
        "track": 1.0,
        "u_prev": random.uniform(-60.0, 60.0, n),
    }
    rows = rows.set(**{name: value for name, value in near.items() if name in names})
    if law.name == "CascadePPI":
        rows = rows.set(ki=random.uniform(0.0, 1e4, n))
    if law.name == "ElastoPlasticFeedforward":  # requires a deflection below that of steady sliding
        rows = rows.set(z_ba=0.9 * np.minimum(rows.get("Fc"), rows.get("Fs")) / rows.get("sigma0"))
    return rows


def range_of(evaluate: Callable[[np.ndarray], np.ndarray], rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    ends = [evaluate(rows.set(u_track=end).values)[:, 0] for end in (-FAR, FAR)]
    return np.minimum(*ends), np.maximum(*ends)


def in_double(law: Law) -> Callable[[np.ndarray], np.ndarray]:
    return lambda values: casadi_by_rows(law, values)[0]


@pytest.mark.parametrize("name", TRACKING)
def test_the_first_output_is_the_given_force(name: str) -> None:
    """Random parameters, positions and states; most forces are within the range, the others up to a fifth beyond it."""
    law = LAWS[name]
    rows = held_axis(law, 4000, 1)
    evaluate = in_double(law)
    low, high = range_of(evaluate, rows)
    force = low + np.random.default_rng(2).uniform(-0.2, 1.2, 4000) * (high - low)
    found = evaluate(rows.set(u_track=force).values)[:, 0]
    free = evaluate(rows.set(track=0.0, u_min=-1e300, u_max=1e300).values)[:, 0]
    wrong = np.abs(found - np.clip(force, low, high)) > 1e-9 * (np.abs(force) + np.abs(free))
    assert not wrong.any(), rows.values[wrong][0]
    assert np.count_nonzero((low < force) & (force < high)) > 2000


@pytest.mark.parametrize("name", some(TRACKING, TRACKING[::5]))
def test_the_first_output_in_float_is_the_given_force(name: str, tmp_path: Path) -> None:
    """The start values of the parameters, random positions within 10 m, states and forces."""
    export = make_export(name, real="float", start=START.get(name))
    law, rows = export.law, held_axis(export.law, 1000, 3)
    kept = {"u_min", "u_max", "Ts"}
    parameters = {v.name: export.start[v.name] for v in law.select(*PARAMETERS) if v.name not in kept}
    rows = rows.set(**{key: values[0] for key, values in parameters.items() if len(values) == 1})
    for key in (v.name for v in law.given if v.name not in export.pairs):
        rows = rows.rounded(key)
    low, high = range_of(in_double(law), rows)
    rows = rows.set(u_track=low + np.random.default_rng(4).uniform(-0.2, 1.2, 1000) * (high - low)).rounded("u_track")
    force = rows.get("u_track")
    free = in_double(law)(rows.set(track=0.0, u_min=-1e30, u_max=1e30).values)[:, 0]
    found = LawC(export, tmp_path).run(rows.values, feeds_back=False)[:, 0]
    assert (np.abs(found - np.clip(force, low, high)) <= 1e-5 * (1.0 + np.abs(force) + np.abs(free))).all()
    assert np.count_nonzero((low < force) & (force < high)) > 500


HELD = {"AdaptiveLuGre", "ANDFC", "DahlFeedforward", "ElastoPlasticEstimator", "ElastoPlasticFeedforward"}
HELD |= {"GMSFeedforward", "GMSObserver", "LuGreFeedforward", "LuGreObserver"}
"""Laws whose memory is the friction of a contact, at most Fc = 1 N."""

HANDOVERS = {
    "in the sample of enable": ((0, 0), (1, 1), (1, 0)),
    "while enabled": (*[(1, 0)] * 1000, (1, 1), (1, 0)),
    "for some time": ((1, 1), (1, 1), (1, 1), (1, 0)),
    "with a reset": ((1, 1, 1), (1, 0)),
}
"""Values of enable, track and reset in successive samples; the last stay."""


def force_of(name: str) -> float:
    return 0.6 if name in HELD else 30.0


def at_rest(name: str, place: float, case: str) -> list[dict[str, float]]:
    """Inputs of an axis that rests on its reference and is held by a force; 30 samples after the hand-over."""
    force = force_of(name)
    calm = {"r": place, "x": place, "u_prev": force, "u_track": force}
    commands = [*HANDOVERS[case], *[HANDOVERS[case][-1]] * 30]
    return [
        calm | dict(zip(("enable", "track", "reset"), map(float, (*values, 0)[:3]), strict=True)) for values in commands
    ]


def check_held(name: str, inputs: list[dict[str, float]], found: list[float], tolerance: float) -> None:
    """u is the force from the hand-over on, and 0 while the law is not enabled."""
    begun = False
    for values, u in zip(inputs, found, strict=True):
        begun = begun or bool(values["track"] and values["enable"])
        if not values["enable"]:
            assert u == 0.0
        elif begun:
            assert u == pytest.approx(force_of(name), rel=tolerance)
    assert begun


@pytest.mark.parametrize("name", some(TRACKING, TRACKING[::5]))
def test_an_fmu_holds_a_resting_axis(name: str, build_fmu: Callable[..., Path]) -> None:
    """However long the law tracks; the force stays, as friction or a load balance it."""
    library = load(build_fmu(name, Ts=Ts))
    for case in HANDOVERS:
        inputs = at_rest(name, 1.7, case)
        with Instance(library) as run:
            run.initialise(**START.get(name, {}))
            found = []
            for k, values in enumerate(inputs):
                run.set({key: value for key, value in values.items() if key in library.variables})
                run.step(k * Ts, Ts)
                found.append(run.get1("u"))
        check_held(name, inputs, found, 1e-9)


@pytest.mark.parametrize("real", some(["double", "float"], ["float"]))
@pytest.mark.parametrize("name", some(TRACKING, TRACKING[::5]))
def test_c_holds_a_resting_axis(name: str, real: Literal["double", "float"], tmp_path: Path) -> None:
    """Up to 10 m from zero, in float within its resolution."""
    export = make_export(name, real=real, start=START.get(name))
    law = LawC(export, tmp_path)
    moved = export.law.select(Kind.INPUT, Kind.OPTIONAL, Kind.COMMAND)
    for place in (0.0, 0.1, 1.0, 10.0):
        inputs = at_rest(name, place, "in the sample of enable")
        given = {v.name: np.array([values.get(v.name, v.starts[0]) for values in inputs]) for v in moved}
        found = law.run(rows_of(export, given), feeds_back=True)[:, 0]
        check_held(name, inputs, list(found), 1e-9 if real == "double" else 1e-5)


@pytest.mark.parametrize("name", some([*LAWS], [*LAWS][::5]))
def test_the_readme_of_an_export_says_how_a_law_starts(name: str) -> None:
    text = " ".join(readme(make_export(name), ()).split("## Start without a jump")[1].split("##")[0].split())
    assert ("inputs.u_track = force;" in text) == (name in TRACKING)
    assert ("no memory that could carry a force" in text) == (name not in TRACKING)


def test_the_readme_is_right(tmp_path: Path) -> None:
    """Its piece of C: u is the force, and stays near it."""
    export = make_export("PID")
    (piece,) = re.findall(r"```c\n(.*?)```", readme(export, ()).split("## Start without a jump")[1], re.S)
    for file, text in (("law.h", header(export)), ("law.c", implementation(export))):
        (tmp_path / file).write_text(text, encoding="utf-8")
    source = tmp_path / "take_over.c"
    source.write_text(
        f"""#include "law.c"
        void take_over(double force, double *u)
        {{
            law_parameters parameters; law_states states; law_inputs inputs; law_outputs outputs;
            law_init(&parameters, &states, &inputs, &outputs);
            inputs.r = 1e-3;
            {piece}
            u[0] = outputs.u;
            law_step(&parameters, &states, &inputs, &outputs);
            u[1] = outputs.u;
        }}
        """,
        encoding="utf-8",
    )
    u = (ctypes.c_double * 2)()
    compile_(source).take_over(ctypes.c_double(30.0), u)
    # Kp e = 12 N would be the first output without the start; each sample adds Ki Ts e
    assert list(u) == pytest.approx([30.0, 30.0 + 250e3 * 1e-3 * 1e-3], rel=1e-12)


def test_the_integral_of_pid_follows_from_its_equation() -> None:
    """u = Kp e + Kd (rd - v) + Ki I + m rdd + f; the next sample adds Ki Ts e."""
    law = LAWS["PID"]
    values = {"r": 1e-3, "rd": 0.1, "v": 0.08, "rdd": 2.0, "f": 1.5, "m": 3.0, "track": 1.0, "u_track": 30.0}
    found = law.evaluate(values)
    I = (30.0 - 12e3 * 1e-3 - 190.0 * 0.02 - 3.0 * 2.0 - 1.5) / 250e3  # noqa: E741
    assert found["u"] == pytest.approx(30.0, rel=1e-12)
    assert found["integral"] == pytest.approx(I + 1e-3 * 1e-3, rel=1e-12)
    after = law.evaluate(values | {"track": 0.0, "integral": found["integral"]})
    assert after["u"] == pytest.approx(30.0 + 250e3 * 1e-6, rel=1e-12)


def test_the_memory_of_a_contact_holds_no_more_than_friction() -> None:
    """The deflection of LuGre at rest is at most Fs/sigma0, so u is at most Fs = 1.5 N."""
    found = LAWS["LuGreObserver"].evaluate({"track": 1.0, "u_track": 30.0})
    assert found["u"] == pytest.approx(1.5, rel=1e-12)
    assert found["z"] == pytest.approx(1.5e-5, rel=1e-12)


@pytest.mark.parametrize(("name", "gain"), [("PID", "Ki"), ("CascadePPI", "ki"), ("KalmanFriction", "gain")])
def test_without_a_gain_the_memory_is_not_touched(name: str, gain: str) -> None:
    law = LAWS[name]
    one, two = (law.evaluate({gain: 0.0, "track": track, "u_track": 30.0, "x": 1e-4}) for track in (0.0, 1.0))
    assert one == two


def test_every_law_says_whether_it_starts_without_a_jump() -> None:
    """In its documentation: with track, or why not; a law that cannot be enabled has no start."""
    for name, law in LAWS.items():
        if all(variable.name != "enable" for variable in law.variables):
            continue
        text = " ".join(law.documentation.split())
        assert re.search(r"\btrack\b" if name in TRACKING else "when enabled|starts without a jump", text), name


def test_a_whole_loop_takes_over(tmp_path: Path) -> None:
    """The servo absorbs the jump of feedforward and observer; with the same inputs, only the integral changes u."""
    laws = {
        "feedforward": LoopLaw("StaticFeedforward", {"Fc": 2.0, "m": 1.0}),
        "compensator": LoopLaw("DisturbanceObserver", {"fq": 20.0}),
        "servo": LoopLaw("CascadePPI", {"kp": 30.0, "kv": 190.0, "ki": 400.0}),
    }
    path = tmp_path / "loop.toml"
    path.write_text(loop_text(LoopFile(laws, Ts, -50.0, 50.0, offset=0.3), "A loop"), encoding="utf-8")
    export = make_export(path)
    law = export.law
    values = {"r": 1.0, "x": 0.999, "rd": 0.05, "v": 0.04, "rdd": 2.0}
    without = law.evaluate(values)
    assert without["u"] == pytest.approx(190.0 * (30.0 * 1e-3 + 0.01) + 2.0 + 0.4 * 0.05 + 2.0 + 0.3, rel=1e-9)
    found = law.evaluate(values | {"track": 1.0, "u_track": 12.0})
    assert found["u"] == pytest.approx(12.0, rel=1e-12)
    states = {v.name: found[v.name] for v in law.select(Kind.STATE)}
    after = law.evaluate(values | states)
    # the observer begins with 12 N less the feedforward and the offset, and sees the same, without acceleration
    assert found["compensator_u"] == pytest.approx(12.0 - 2.0 - 0.4 * 0.05 - 2.0 - 0.3, rel=1e-12)
    assert after["u"] - 12.0 == pytest.approx(400.0 * Ts * (30.0 * 1e-3 + 0.01), rel=1e-9)
    assert "inputs.u_track = force;" in readme(export, ())


@pytest.mark.parametrize(
    ("estimator", "output"),
    [
        ("DisturbanceObserver", "u"),
        ("PredictiveFilter", "u"),
        ("KalmanFriction", "u"),
        ("ExtendedStateObserver", "F_hat"),
    ],
)
@pytest.mark.parametrize("window", [0, 2])
def test_a_loop_with_an_estimator_holds_a_loaded_axis(estimator: str, output: str, window: int, tmp_path: Path) -> None:
    """A mass rests under a load of 5 N while the loop takes over: equilibrium, so nothing may change."""
    gain = 0.7
    laws = {
        "feedforward": LoopLaw("StaticFeedforward", {"m": 0.0, "offset": 0.4}),
        "compensator": LoopLaw(estimator, {"gain": gain}, output=output),
        "servo": LoopLaw("PID"),
    }
    path = tmp_path / "loop.toml"
    path.write_text(loop_text(LoopFile(laws, Ts, -50.0, 50.0, offset=0.3, window=window), "A loop"), encoding="utf-8")
    law = make_export(path).law
    states = {v.name: v.start for v in law.select(Kind.STATE, Kind.STATES)}
    x = v = 0.0
    for k in range(300):
        taking = {"track": float(k == 0), "u_track": 5.0}
        given = {"r": 0.2, "x": 0.2 + x, "v": v} | taking
        found = law.evaluate({name: value for name, value in given.items() if name != "v" or not window} | states)
        states = {name: found[name] for name in states}
        assert found["u"] == pytest.approx(5.0, rel=1e-9), k
        assert found["compensator_F_hat"] == pytest.approx(5.0 - 0.4 - 0.3, rel=1e-9), k
        acceleration = found["u"] - 5.0
        x, v = x + Ts * v + 0.5 * Ts**2 * acceleration, v + Ts * acceleration
    assert abs(x) < 1e-12


@pytest.mark.parametrize("name", [name for name in TRACKING if name not in HELD])
def test_a_limit_while_tracking_is_not_decided_by_rounding(name: str) -> None:
    """u is the force to the last bit, and limited only if the force is beyond the limit."""
    law = LAWS[name]
    rows = held_axis(law, 2000, 5)
    memory = {v.name for v in law.variables} & {"gain", "Ki", "ki"}
    rows = rows.set(**dict.fromkeys(memory, np.random.default_rng(6).uniform(0.1, 1.0, 2000)))
    saturation = [v.name for v in law.results].index("u_sat")
    for end, beyond, limited in (
        ("u_max", 0.0, 0.0),
        ("u_max", 1e-9, 1.0),
        ("u_min", 0.0, 0.0),
        ("u_min", -1e-9, -1.0),
    ):
        found = in_double(law)(rows.set(u_track=rows.get(end) + beyond).values)
        assert (found[:, 0] == rows.get(end)).all()
        assert (found[:, saturation] == limited).all()
