"""A selection of blocks and composites under sanitizers, libFuzzer and valgrind; nightly.sh has all, for longer."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from native_checks import (
    ADDRESS,
    COMPILERS,
    HERE,
    LEVELS,
    THREAD,
    FoundError,
    check_warnings,
    compiled,
    corpus,
    fuzz,
    run_threads,
    targets,
)
from shell.selection import COMPOSITES
from slow.platforms.foreign import case, host
from thorough import nightly, some

from friction_fmus import catalogue

SELECTION = ("LuGre", "GenericAsperity", "Leuven", "Actuator", "PID", "RepetitiveController")
"""Exact, event-driven and with a stack; a plant with a memory; a law; a controller with a ring."""
CHAINS = ("BurridgeKnopoff", "FrenkelKontorova", "FrenkelKontorovaTomlinson")
"""Blocks with large local arrays, of which an optimising compiler says most."""
SAMPLED = ("Differentiator",)
FIRST = (SELECTION[0], *SAMPLED, COMPOSITES[0])
"""What is compiled with all warnings before a landing: a model, a sampled block, the engine in a composite."""
SECONDS = 2
SELECTION_3 = ("GMS:3", "PID:3")
"""The same in FMI 3.0: with arrays, and with a clock."""
PAIRS = [(name, target) for name in (*SELECTION, *COMPOSITES, SELECTION_3[0]) for target in targets(name)]

needs_clang = pytest.mark.skipif(shutil.which("clang") is None, reason="clang is not installed")
THREADED = (*SELECTION, *COMPOSITES, *SELECTION_3, "compensated_axis:3")


@nightly
@needs_clang
@pytest.mark.parametrize(("name", "target"), some(PAIRS, PAIRS[:1]))
def test_fuzzing_finds_nothing(name: str, target: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    fuzz(name, target, SECONDS, tmp_path)


@needs_clang
@pytest.mark.parametrize("sanitizer", [ADDRESS, THREAD], ids=lambda flags: str(flags[0]))
@pytest.mark.parametrize("name", some(THREADED, (SELECTION[0],)))
def test_threads_with_an_instance_each_under_a_sanitizer(name: str, sanitizer: tuple[str, ...], tmp_path: Path) -> None:
    run_threads(name, sanitizer, tmp_path)


@pytest.mark.skipif(not all(map(shutil.which, COMPILERS)), reason="gcc and clang are not both installed")
@pytest.mark.parametrize("name", some((*SELECTION, *CHAINS, *SAMPLED, *COMPOSITES, *SELECTION_3), FIRST))
def test_no_level_of_optimisation_brings_out_a_warning(name: str, tmp_path: Path) -> None:
    check_warnings(name, tmp_path, some(LEVELS, ("-O0", "-O2")))


@needs_clang
def test_the_checks_find_a_fault_that_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A write behind the end of an instance, a variable that threads share, a check that does not hold."""
    monkeypatch.chdir(tmp_path)
    text = (HERE / "threads.c").read_text(encoding="utf-8")
    for flags, line, word in (
        (ADDRESS, "((char *)c)[sizeof *c + 4 + k] = 1;", "heap-buffer-overflow"),
        (THREAD, "static volatile int shared; shared = shared + k;", "data race"),
    ):
        (tmp_path / "faulty.c").write_text(
            text.replace("        advance_instance(c", f"        {line}\n        advance_instance(c")
        )
        program = compiled("Viscous", str(tmp_path / "faulty.c"), flags, tmp_path)
        run = subprocess.run([program], capture_output=True, text=True, check=False)
        assert run.returncode != 0 and word in run.stderr
    copy = tmp_path / "copy"
    shutil.copytree(HERE, copy)
    target = copy / "fuzz_state.c"
    target.write_text(target.read_text(encoding="utf-8").replace("HOLDS(memcmp(", "HOLDS(count < 3 && memcmp("))
    monkeypatch.setattr("native_checks.HERE", copy)
    with pytest.raises(FoundError, match="reading a state changes the instance"):
        fuzz("Viscous", "state", 1, tmp_path)


@nightly
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
def test_valgrind_finds_nothing(build_fmu: Callable[..., Path], tmp_path: Path) -> None:
    """The whole call sequence of a selection of blocks: no invalid access, nothing uninitialised, nothing lost."""
    program = host("linux64", tmp_path)
    cases = [case(build_fmu(name), "linux64", tmp_path) for name in (*SELECTION, *COMPOSITES)]
    command = ["valgrind", "-q", "--leak-check=full", "--errors-for-leak-kinds=definite", "--error-exitcode=9"]
    run = subprocess.run(
        [*command, str(program), *(each.name for each in cases)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")


def test_corpora_are_small_and_of_blocks_that_exist() -> None:
    files = [path for path in (HERE / "corpus").rglob("*") if path.is_file()]
    assert files
    assert sum(path.stat().st_size for path in files) < 200_000
    assert {path.parent for path in files} <= {
        corpus(target, name) for name in (*catalogue(), *COMPOSITES) for target in targets(name)
    }
