"""Each rule of model exchange finds the fault that it is for, in an FMU with that fault only."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from check.broken import XML, zipped
from check.libraries import BINARY, HERE, Library
from thorough import landing, nightly, some

from friction_fmus.check import RULES, check

# fault, as in faulty_exchange.c -> rule, what its message must name, rules that cannot but speak too
FAULTS = {
    "endless": ("event-iteration", "after 100 at 0.0 s", set()),
    "late": ("event-time", "at 0.02 s, but the event iteration at 0.02 s is over", set()),
    "unset": ("counts", "fmi2NewDiscreteStates does not set all", set()),
    "unset_step": ("counts", "fmi2CompletedIntegratorStep does not set all", set()),
    "few_states": ("counts", "fmi2GetContinuousStates rejects 2 values", {"call-refused"}),
    "many_indicators": ("counts", "fmi2GetEventIndicators sets 2 values, but 1 are", set()),
    "few_results": ("counts", "fmi2GetDerivatives sets 1 values, but 2 are", {"states", "directional"}),
    "nan_rate": ("value-not-finite", "fmi2GetDerivatives returns nan for x", set()),
    "nan_indicator": ("value-not-finite", "returns nan for event indicator 1", set()),
    "nominal": ("nominal-states", "the nominal value of x is 0.0", set()),
    "forgetful": ("states", "v is 0.5 after it was set to 0.501", {"directional"}),
    "swapped": ("states", "fmi2GetContinuousStates gives", set()),
    "memory": ("history", "after another point was tried", set()),
    "tangent": ("directional", "the derivative of der(v) with respect to v is", set()),
    "no_tangent": ("capability", "fmi2GetDirectionalDerivative rejects x; it logged 'not done yet'", set()),
    "order": ("call-order-accepted", "fmi2SetTime in initialization mode", set()),
    "misuse": ("misuse-crashes", "ends its process", set()),
    "refuse_event": ("call-refused", "fmi2EnterEventMode is rejected in continuous-time mode", set()),
    "refuse_time": ("call-refused", "fmi2SetTime is rejected in continuous-time mode; it logged 'time stands", set()),
    "state": ("state-not-restored", "count is", {"state-not-serialized"}),
    "leak_step": ("memory-grows", "every step allocates", set()),
    "start": ("start-differs", "gain starts at 3.0, but at 2.0", set()),
    "crash": ("binary-crashes", "fmi2GetDerivatives ends its process: SIGSEGV", set()),
}


@pytest.fixture
def faulty(library: Library, tmp_path: Path) -> Callable[..., Path]:
    def make(fault: str = "none", **changes: str) -> Path:
        xml = (HERE / "faulty_exchange.xml").read_text(encoding="utf-8").replace("fault:none", f"fault:{fault}")
        for old, new in changes.items():
            xml, count = re.subn(rf'{old}="[^"]*"', f'{old}="{new}"', xml)
            assert count == 1
        binary = library("IN_ORDER", "faulty_exchange.c")
        members = {XML: xml.encode(), BINARY: binary, "documentation/index.html": b"<html/>"}
        return zipped(members, tmp_path / f"{fault}.fmu")

    return make


def test_every_fault_of_the_c_file_is_tested() -> None:
    (table,) = re.findall(r"faults\[\] = \{(.*?)\}", (HERE / "faulty_exchange.c").read_text(encoding="utf-8"), re.S)
    assert set(re.findall(r'"(\w+)"', table)) == {"none", *FAULTS}


def test_without_a_fault_nothing_is_found(faulty: Callable[..., Path]) -> None:
    assert check(faulty()) == []


@landing
@pytest.mark.parametrize("fault", some([*FAULTS], [*FAULTS][::24]))
def test_a_fault_is_found_by_its_rule_and_no_other(faulty: Callable[..., Path], fault: str) -> None:
    rule, words, companions = FAULTS[fault]
    found = check(faulty(fault), time_limit=60.0)
    own = [finding for finding in found if finding.rule == rule]
    assert any(words in finding.message for finding in own), found
    assert all(finding.severity == RULES[rule].severity for finding in own)
    assert {finding.rule for finding in found} - {rule} <= companions, found


@nightly
def test_missing_capabilities_are_no_fault(faulty: Callable[..., Path]) -> None:
    changes = dict.fromkeys(("canGetAndSetFMUstate", "canSerializeFMUstate", "providesDirectionalDerivative"), "false")
    assert check(faulty("state", **changes)) == []
    assert check(faulty("tangent", **changes)) == []


def test_both_interfaces_of_one_fmu_are_run(faulty: Callable[..., Path]) -> None:
    """This library refuses co-simulation, which another XML declares beside model exchange."""
    path = faulty("none", providesDirectionalDerivative='false"/><CoSimulation modelIdentifier="faulty')
    assert {finding.rule for finding in check(path)} >= {"instantiate-fails", "function-missing"}
