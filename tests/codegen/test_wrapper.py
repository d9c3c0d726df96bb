"""The C++ class of an exported law computes what the C functions compute, and its objects are values."""

from __future__ import annotations

import shutil
import subprocess
from itertools import product
from pathlib import Path
from typing import Literal

import pytest
from thorough import landing, some

from friction_fmus.codegen.law_export import class_name, make_export, wrapper
from friction_fmus.codegen.layout import Export
from friction_fmus.codegen.sources import header, implementation
from friction_fmus.codegen.unit_test import unit_test
from friction_fmus.codegen.vectors import vectors

REALS: tuple[Literal["double", "float"], ...] = ("double", "float")

LOOP = """
[loop]
Ts = 1e-3
u_min = -1000
u_max = 1000
window = 2

[servo]
law = "PID"

[feedforward]
law = "KarnoppFeedforward"
parameters = { m = 0.0 }

[compensator]
law = "PredictiveFilter"
"""

PROGRAM = """
#include "law.hpp"
#include "law.hpp"
#include "law_test.c"
#include <cmath>
#include <cstring>
#include <type_traits>

static_assert(std::is_trivially_copyable<Law>::value, "a value");
static_assert(noexcept(Law().step(Law::start())), "no exception");

template <class T> static bool equal(const T &a, const T &b) { return std::memcmp(&a, &b, sizeof a) == 0; }
static bool equal(const law_states &a, const law_states &b) { return MEMBERS; }

int main()
{
    law_parameters parameters; law_states states; law_inputs inputs; law_outputs outputs;
    std::memset(&outputs, 0, sizeof outputs);
    law_init(&parameters, &states, &inputs, &outputs);
    Law law, early;
    if (!equal(law.parameters, parameters) || law.check() != 0)
        return 1;
    if (Law::start().enable != inputs.enable || Law::start().r != 0)
        return 1;
    for (int k = 0; k < SAMPLES; k++) {
        law_step(&parameters, &states, &given[k], &outputs);
        const Law::Outputs found = law.step(given[k]);
        if (found.u != outputs.u || found.fault != outputs.fault || !equal(law.states(), states))
            return 2;
        if (k == 20)
            early = law;
    }
    for (int k = 21; k < SAMPLES; k++)  /* the copy goes its own way */
        if (early.step(given[k]).fault || (k == SAMPLES - 1 && !equal(early.states(), law.states())))
            return 3;

    law.parameters.Kp = -1;
    if (law.check() == 0)
        return 4;
    law.parameters.Kp = 5;
    law.reset();  /* keeps the parameters */
    Law::Parameters other = Law().parameters;
    other.Kp = 5;
    Law second(other);
    if (!equal(law.parameters, second.parameters) || !equal(law.states(), second.states()))
        return 5;
    Law::Inputs far = Law::start();
    far.r = 1;
    if (law.step(far).u != second.step(far).u || law.step(far).u == Law().step(far).u)
        return 6;

    Law taken;
    const Law::Outputs first = taken.take_over(far, 30);
    if (std::fabs(first.u - 30) > 1e-2 || std::fabs(first.u - law.step(far).u) < 100)
        return 7;
    far.track = true;  /* the same by the inputs */
    far.u_track = 30;
    if (Law().step(far).u != first.u)
        return 8;
    return law_test();
}
"""


def equal_members(export: Export) -> str:
    """The comparison of all states, without the bytes between the members of the struct."""
    names = [v.name for v in export.groups["states"]]
    names += [f"{name}_low" for name in names if name in export.pairs]
    return " && ".join(f"equal(a.{name}, b.{name})" for name in names)


@landing
@pytest.mark.skipif(not shutil.which("g++"), reason="g++ not installed")
@pytest.mark.parametrize("model", some(["PID", "loop"], ["loop"]))
@pytest.mark.parametrize(("real", "standard"), list(product(REALS, some(("c++11", "c++20"), ("c++11",)))))
def test_the_class_computes_what_the_functions_compute(
    model: str, real: Literal["double", "float"], standard: str, tmp_path: Path
) -> None:
    """Of a law, and of a loop with this law as its servo."""
    (tmp_path / "loop.toml").write_text(LOOP, encoding="utf-8")
    export = make_export(model if model == "PID" else tmp_path / "loop.toml", real=real, prefix="law")
    texts = {
        "law.h": header(export),
        "law.c": implementation(export),
        "law.hpp": wrapper(export),
        "law_test.c": unit_test(export, vectors(export)),
        "program.cpp": (PROGRAM if model == "PID" else PROGRAM.replace("Kp", "servo_Kp")).replace(
            "MEMBERS", equal_members(export)
        ),
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    subprocess.run(["gcc", "-std=c99", "-O2", "-ffp-contract=off", "-c", "law.c"], cwd=tmp_path, check=True)
    warnings = ["-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Wshadow", "-Werror"]
    command = ["g++", f"-std={standard}", "-O2", *warnings, "program.cpp", "law.o", "-o", "program"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "program"], check=False).returncode == 0


def test_the_class_has_the_name_of_the_prefix() -> None:
    assert [class_name(prefix) for prefix in ("law", "inner_loop", "_x", "PID")] == ["Law", "InnerLoop", "X", "PID"]
    assert "class InnerLoop {" in wrapper(make_export("PID", prefix="inner_loop"))


def test_only_a_law_with_a_memory_of_force_takes_over() -> None:
    assert "take_over" in wrapper(make_export("LuGreObserver"))
    assert "take_over" not in wrapper(make_export("StaticFeedback"))


@pytest.mark.skipif(not shutil.which("g++"), reason="g++ not installed")
@pytest.mark.parametrize("prefix", ["outputs", "parameters", "states_", "disable"])
def test_a_prefix_may_be_a_word_of_the_code(prefix: str, tmp_path: Path) -> None:
    export = make_export("PID", prefix=prefix)
    for suffix, text in ((".h", header), (".c", implementation), (".hpp", wrapper)):
        (tmp_path / f"{prefix}{suffix}").write_text(text(export), encoding="utf-8")
    warnings = ["-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Wshadow", "-Werror"]
    subprocess.run(["gcc", "-std=c99", *warnings, "-fsyntax-only", f"{prefix}.c"], cwd=tmp_path, check=True)
    (tmp_path / "use.cpp").write_text(f'#include "{prefix}.hpp"\n', encoding="utf-8")
    subprocess.run(["g++", "-std=c++11", *warnings, "-fsyntax-only", "use.cpp"], cwd=tmp_path, check=True)


COUNTER = """
from casadi import SX
from friction_fmus.lawkit.law import *

@law("Count", "No inputs", source="none", Ts=1e-3, outputs={"u": Output(FORCE, "ramp")})
def count(n: SX = State(FORCE, 0.0, "ramp"), Ts: SX = SampleTime()) -> dict[str, SX]:
    '''A ramp.'''
    return {"u": n, "n": n + Ts}
"""


@pytest.mark.skipif(not shutil.which("g++"), reason="g++ not installed")
@pytest.mark.parametrize("real", REALS)
def test_a_law_without_inputs_gives_no_warning(real: Literal["double", "float"], tmp_path: Path) -> None:
    path = tmp_path / "count.py"
    path.write_text(COUNTER, encoding="utf-8")
    export = make_export(path, real=real)
    samples = unit_test(export, vectors(export))
    for name, text in (("h", header(export)), ("c", implementation(export)), ("hpp", wrapper(export))):
        (tmp_path / f"law.{name}").write_text(text, encoding="utf-8")
    (tmp_path / "law_test.c").write_text(samples, encoding="utf-8")
    warnings = ["-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Wshadow", "-Werror"]
    command = ["gcc", "-std=c99", *warnings, "-DLAW_TEST_MAIN", "law.c", "law_test.c", "-lm", "-o", "program"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "program"], check=False).returncode == 0
    (tmp_path / "use.cpp").write_text('#include "law.hpp"\nint main() { Law law; return int(law.step({}).u); }\n')
    subprocess.run(["g++", "-std=c++11", *warnings, "-fsyntax-only", "use.cpp"], cwd=tmp_path, check=True)
