"""Each rule of the binary finds the fault that it is for, in an FMU with that fault only."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import fmpy
import pytest
from check.broken import XML, zipped
from check.libraries import BINARY, HERE, Library
from check.test_check_exchange import FAULTS as OF_MODEL_EXCHANGE
from thorough import some

from friction_fmus.check import RULES, check
from friction_fmus.check.probes.lifecycle import report_accepted

# fault, as in faulty.c -> rule, what its message must name, rules that cannot but speak too
FAULTS = {
    "start": ("start-differs", "gain starts at 3.0, but at 2.0", set()),
    "unreadable": ("variable-not-readable", "der(x) fails; it logged 'this is secret'", set()),
    "unsettable": ("variable-not-settable", "gain rejects its start value 2.0", {"call-refused"}),
    "crash": ("binary-crashes", "fmi2DoStep ends its process: SIGSEGV", {"misuse-crashes"}),
    "quit": ("binary-crashes", "fmi2DoStep ends its process: exit status 3", {"misuse-crashes"}),
    "loop": ("binary-hangs", "fmi2DoStep does not return", set()),
    "refuse_step": ("step-refused", "odd step", set()),
    "refuse_rounded": ("step-rounding", "not where I am", set()),
    "drift": ("time-wrong", "s after a step from 0.0 s", set()),
    "own_grid": ("time-own-grid", "s after a step from 0.0 s", {"time-rounded"}),
    "rounded_time": ("time-rounded", "s after a step from 0.0 s", set()),
    "static": ("instances-interfere", "y is", set()),
    "single": ("second-instance", "canBeInstantiatedOnlyOncePerProcess", set()),
    "random": ("not-reproducible", "y is", {"call-order-accepted", "reset-incomplete", "state-not-serialized"}),
    "reset": ("reset-incomplete", "x is", set()),
    "refuse_reset": ("call-refused", "fmi2Reset is rejected in the state instantiated; it logged 'no way back'", set()),
    "no_init": ("call-refused", "fmi2EnterInitializationMode returned fmi2Error; it logged 'not today'", set()),
    "state": ("state-not-restored", "x is", {"state-not-serialized"}),
    "pointer": ("state-pointer", "set it to NULL", set()),
    "serial": ("state-not-serialized", "x is", set()),
    "nan": ("value-not-finite", "y is not finite", set()),
    "order": ("call-order-accepted", "fmi2DoStep in the state instantiated", set()),
    "misuse": ("misuse-crashes", "fmi2Instantiate with a null pointer as logger ends its process", set()),
    "no_instance": ("instantiate-fails", "no instance; it logged 'no instance'", set()),
    "leak_instance": ("memory-grows", "every instance leaks", set()),
    "leak_step": ("memory-grows", "every step allocates", set()),
    "category": ("log-category", "'logSecrets'", set()),
    "print": ("prints", "stdout", set()),
    "locale": ("process-changed", "the working directory", set()),
    "directional": ("capability", "fmi2GetDirectionalDerivative", set()),
}
DEPENDENCIES = {
    "Outputs": ('<Unknown index="3" dependencies="2"/>', '<Unknown index="3" dependencies=""/>', "y follows u at once"),
    "Derivatives": ('<Unknown index="6" dependencies="2"/></D', '<Unknown index="6" dependencies="4"/></D', "der(x)"),
    "InitialUnknowns": (
        '<Unknown index="3" dependencies="2 5"/>',
        '<Unknown index="3" dependencies="5"/>',
        "y follows",
    ),
}
COMPILED = {
    "WRONG_VERSION": ("version-answer", "b'2.0.5'"),
    "FEW_FUNCTIONS": ("function-missing", "fmi2CancelStep, fmi2GetStatus"),
    "UNLOADABLE": ("binary-not-loadable", "nowhere_defined"),
    "ANY_GUID": ("guid-not-checked", "compare it"),
    "FREE_NULL": ("free-null", "fmi2FreeInstance ends its process: SIGSEGV"),
}


@pytest.fixture
def faulty(library: Library, tmp_path: Path) -> Callable[..., Path]:
    def make(fault: str = "none", definition: str = "IN_ORDER", **changes: str) -> Path:
        xml = (HERE / "faulty.xml").read_text(encoding="utf-8").replace("fault:none", f"fault:{fault}")
        for old, new in changes.items():
            xml, count = re.subn(rf'{old}="[^"]*"', f'{old}="{new}"', xml)
            assert count == 1
        members = {XML: xml.encode(), BINARY: library(definition), "documentation/index.html": b"<html/>"}
        return zipped(members, tmp_path / f"{fault}.fmu")

    return make


def test_every_rule_has_a_fault() -> None:
    of_the_binary = {rule.id for rule in RULES.values() if rule.kind == "binary"}
    named = {rule for rule, *_ in (*FAULTS.values(), *COMPILED.values(), *OF_MODEL_EXCHANGE.values())}
    assert named | {"no-binary-here", "dependency-missing"} == of_the_binary


def test_every_fault_of_the_c_file_is_tested() -> None:
    (table,) = re.findall(r"faults\[\] = \{(.*?)\}", (HERE / "faulty.c").read_text(encoding="utf-8"), re.S)
    assert set(re.findall(r'"(\w+)"', table)) == {"none", *FAULTS}


def test_without_a_fault_nothing_is_found(faulty: Callable[..., Path]) -> None:
    assert check(faulty()) == []


@pytest.mark.parametrize("fault", some([*FAULTS], [*FAULTS][::3]))
def test_a_fault_is_found_by_its_rule_and_no_other(faulty: Callable[..., Path], fault: str) -> None:
    rule, words, companions = FAULTS[fault]
    found = check(faulty(fault), time_limit=1.0 if fault == "loop" else 60.0)
    own = [finding for finding in found if finding.rule == rule]
    assert any(words in finding.message for finding in own), found
    assert all(finding.file == BINARY and finding.severity == RULES[rule].severity for finding in own)
    assert {finding.rule for finding in found} - {rule} <= companions, found


@pytest.mark.parametrize("definition", COMPILED)
def test_a_fault_of_the_library_is_found(faulty: Callable[..., Path], definition: str) -> None:
    rule, words = COMPILED[definition]
    (finding,) = check(faulty(definition=definition))
    assert finding.rule == rule
    assert words in finding.message


@pytest.mark.parametrize("section", DEPENDENCIES)
def test_an_omitted_input_is_found(library: Library, tmp_path: Path, section: str) -> None:
    """Masters see no loop through an output whose dependencies omit an input."""
    old, new, words = DEPENDENCIES[section]
    xml = (HERE / "faulty.xml").read_text(encoding="utf-8")
    assert old in xml
    members = {XML: xml.replace(old, new).encode(), BINARY: library(), "documentation/index.html": b"<html/>"}
    (finding,) = check(zipped(members, tmp_path / "a.fmu"))
    assert finding.rule == "dependency-missing"
    assert words in finding.message
    assert f"dependencies in {section} omit" in finding.message


def test_the_binary_is_left_alone_on_request(faulty: Callable[..., Path]) -> None:
    assert check(faulty("crash"), static=True) == []


def test_a_rule_can_be_ignored(faulty: Callable[..., Path]) -> None:
    assert check(faulty("start"), ignore=["start-differs"]) == []


def test_an_fmu_that_allows_one_instance_gets_one_in_a_process(faulty: Callable[..., Path]) -> None:
    """That fault refuses a second; what needs two is not asked."""
    members_changed = faulty("single", canSerializeFMUstate='true" canBeInstantiatedOnlyOncePerProcess="true')
    assert check(members_changed) == []


def test_a_fixed_step_is_kept(faulty: Callable[..., Path]) -> None:
    assert check(faulty("refuse_step", canHandleVariableCommunicationStepSize="false")) == []


def test_missing_capabilities_are_no_fault(faulty: Callable[..., Path]) -> None:
    flags = ("canHandleVariableCommunicationStepSize", "canGetAndSetFMUstate", "canSerializeFMUstate")
    changes = dict.fromkeys((*flags, "providesDirectionalDerivative"), "false")
    assert check(faulty("state", **changes)) == []
    assert check(faulty("directional", **changes)) == []


def test_another_platform_is_a_note(library: Library, tmp_path: Path) -> None:
    other = "binaries/win64/faulty.dll" if fmpy.platform != "win64" else "binaries/linux64/faulty.so"
    xml = (HERE / "faulty.xml").read_bytes()
    members = {XML: xml, other: library(), "documentation/index.html": b"<html/>"}
    found = check(zipped(members, tmp_path / "a.fmu"))
    assert [(each.rule, each.severity) for each in found] == [("binary-format", "error"), ("no-binary-here", "note")]


def test_a_crash_on_misuse_names_the_misuse() -> None:
    """`friction_fmus.check.probes.fmi2_library.RawLibrary.mark` stores it with the name of the function."""
    seen: list[str] = []
    library = SimpleNamespace(misuse="", named="fmi2{}".format)
    run = SimpleNamespace(status=lambda *_: seen.append(library.misuse) or 3)
    calls = {"DoStep": ("I", ())}
    states = {"I": "the state instantiated"}
    report_accepted(library, seen.append, lambda *_: nullcontext(run), states, calls, KeyError)  # type: ignore[arg-type]
    assert (seen, library.misuse) == ([", not allowed in the state instantiated,"], "")
