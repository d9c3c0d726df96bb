"""Every function in every mode, against the tables of sections 3.2.3 and 4.2.4 of FMI 2.0.5.

Three columns are wider than there: inputs may be set right after fmi2Instantiate, as many importers do; states may be
set by fmi2SetReal in model exchange, as casadi does; and an fmi2Error leaves the instance in the mode it was in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p, create_string_buffer
from pathlib import Path

import pytest
from shell.instance import (
    ABSENT,
    CO_SIMULATION,
    DISCARD,
    ERROR,
    EXCHANGE_SIGNATURES,
    LAST_SUCCESSFUL_TIME,
    MODEL_EXCHANGE,
    OK,
    SIGNATURES,
    TERMINATED,
    EventInfo,
    Instance,
    Library,
    load,
    signals,
)
from thorough import some

# I instantiated, N initialization mode, C step complete, F step failed, T terminated; in model exchange E event mode
# and X continuous-time mode
BOTH = {
    "SetDebugLogging": "INCFTEX",
    "SetupExperiment": "I",
    "EnterInitializationMode": "I",
    "ExitInitializationMode": "N",
    "Terminate": "CFEX",
    "Reset": "INCFTEX",
    "GetReal": "NCFTEX",
    "GetInteger": "NCFTEX",
    "GetBoolean": "NCFTEX",
    "GetString": "NCFTEX",
    "SetReal": "INCEX",
    "SetInteger": "INCEX",
    "SetBoolean": "INCEX",
    "SetString": "INCEX",
    "GetFMUstate": "INCFTEX",
    "SetFMUstate": "INCFTEX",
    "FreeFMUstate": "INCFTEX",
    "SerializedFMUstateSize": "INCFTEX",
    "SerializeFMUstate": "INCFTEX",
    "DeSerializeFMUstate": "INCFTEX",
    "GetDirectionalDerivative": "NCFTEX",
}
CO_SIMULATION_ONLY = {
    "SetRealInputDerivatives": "INC",
    "GetRealOutputDerivatives": "CFT",
    "DoStep": "C",
    "CancelStep": "",  # steps are never pending
    "GetStatus": "CFT",
    "GetRealStatus": "CFT",
    "GetIntegerStatus": "CFT",
    "GetBooleanStatus": "CFT",
    "GetStringStatus": "CFT",
}
MODEL_EXCHANGE_ONLY = {
    "EnterEventMode": "X",
    "NewDiscreteStates": "E",
    "EnterContinuousTimeMode": "E",
    "CompletedIntegratorStep": "X",
    "SetTime": "EX",
    "SetContinuousStates": "X",
    "GetContinuousStates": "NTEX",
    "GetNominalsOfContinuousStates": "INTEX",
    "GetDerivatives": "NTEX",
    "GetEventIndicators": "NTEX",
}
TABLE = {
    CO_SIMULATION: BOTH | CO_SIMULATION_ONLY | dict.fromkeys(MODEL_EXCHANGE_ONLY, ""),
    MODEL_EXCHANGE: BOTH | dict.fromkeys(CO_SIMULATION_ONLY, "") | MODEL_EXCHANGE_ONLY,
}
ELSEWHERE_IN_3 = {"GetNominalsOfContinuousStates": "NTEX"}
"""What FMI 3.0 allows in other modes than FMI 2.0."""
KINDS = {CO_SIMULATION: "co-simulation", MODEL_EXCHANGE: "model exchange"}
MODES_OF = {CO_SIMULATION: "INCFT", MODEL_EXCHANGE: "INTEX"}
NOT_OF_AN_INSTANCE = {"GetTypesPlatform", "GetVersion", "Instantiate", "FreeInstance"}
NEVER_AVAILABLE = {"GetStatus", "GetIntegerStatus", "GetStringStatus"}
MODES = {
    **{"I": "instantiated", "N": "initialization mode", "C": "step complete", "F": "step failed", "T": "terminated"},
    **{"E": "event mode", "X": "continuous-time mode"},
}
EACH = [(kind, mode) for kind in KINDS for mode in MODES_OF[kind]]
each_mode = pytest.mark.parametrize(("kind", "mode"), EACH, ids=[f"{KINDS[kind]} {MODES[mode]}" for kind, mode in EACH])


def allowed(library: Library, kind: int) -> dict[str, str]:
    """The modes in which each function may be called."""
    if library.fmi == 2:
        return TABLE[kind]
    elsewhere = ELSEWHERE_IN_3 if kind == MODEL_EXCHANGE else {}
    table = {name: modes for name, modes in (TABLE[kind] | elsewhere).items() if name not in ABSENT}
    # a step that is discarded leaves the state before the call
    return {name: modes.replace("F", "") + "F" * ("C" in modes) for name, modes in table.items()}


def test_the_table_has_all_functions() -> None:
    for table in TABLE.values():
        assert set(table) | NOT_OF_AN_INSTANCE == {*SIGNATURES, *EXCHANGE_SIGNATURES}


def in_mode(library: Library, mode: str, kind: int = CO_SIMULATION) -> Instance:
    """A Mass, or for all modes but F any block, brought into that mode."""
    run = Instance(library, kind=kind)
    if mode == "I":
        return run
    run.setup()
    run.must("EnterInitializationMode")
    run.set(signals(library, 1, 1)[0])
    if mode == "N":
        return run
    run.must("ExitInitializationMode")
    if kind == MODEL_EXCHANGE:
        run.event()
        if mode != "E":
            run.must("EnterContinuousTimeMode")
    else:
        run.step(0.0, 0.1)
    if mode == "F":
        run.set({"F_drive": 1e308})
        assert run.call("DoStep", 0.1, 10.0, 1) == DISCARD
    if mode == "T":
        run.must("Terminate")
    run.messages.clear()
    return run


@pytest.fixture
def mass(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("Mass"))


def arguments_of(function: str, run: Instance, state: c_void_p, mode: str = "") -> tuple[object, ...]:
    """Arguments with which the function succeeds where it is allowed; nothing for types that a block has not."""
    real, size = c_double(), c_size_t()
    run.must("SerializedFMUstateSize", state, byref(size))
    buffer = create_string_buffer(size.value)
    run.must("SerializeFMUstate", state, buffer, size.value)
    outputs = [run.reference(name) for name in run.library.names("output", type="Real")][:1]
    inputs = [run.reference(name) for name in run.library.names("input", type="Real")][:1]
    tunable = [v for v in run.library.variables.values() if v.variability == "tunable" and v.type == "Real"]
    chosen = inputs if mode == "X" else [int(v.valueReference) for v in tunable][:1]
    value = float(tunable[0].start) if tunable and mode != "X" else 0.0
    orders = (c_int * 1)(1)
    a, b = (c_uint * 1)(*outputs), (c_uint * 1)(*inputs)
    return {
        "SetDebugLogging": (1, 0, None),
        "SetupExperiment": (0, 0.0, 0.0, 0, 0.0),
        "GetReal": ((c_uint * 1)(run.reference("time")), 1, real),
        "SetReal": ((c_uint * 1)(*chosen), len(chosen), c_double(value)),
        **dict.fromkeys(("GetInteger", "GetBoolean", "SetInteger", "SetBoolean"), (None, 0, None)),
        **dict.fromkeys(("GetString", "SetString"), (None, 0, None)),
        "GetFMUstate": (byref(c_void_p()),),
        "SetFMUstate": (state,),
        "FreeFMUstate": (byref(c_void_p()),),
        "SerializedFMUstateSize": (state, byref(size)),
        "SerializeFMUstate": (state, buffer, size.value),
        "DeSerializeFMUstate": (buffer, size.value, byref(c_void_p())),
        "GetDirectionalDerivative": (a, len(outputs), b, len(inputs), c_double(1.0), real),
        "SetRealInputDerivatives": (b, len(inputs), orders, c_double(0.0)),
        "GetRealOutputDerivatives": (a, len(outputs), orders, real),
        "DoStep": (0.1, 0.1, 1),
        "NewDiscreteStates": (byref(EventInfo()),),
        "CompletedIntegratorStep": (1, c_int(), c_int()),
        "SetTime": (0.1,),
        **dict.fromkeys(
            ("SetContinuousStates", "GetContinuousStates", "GetNominalsOfContinuousStates", "GetDerivatives"),
            ((c_double * run.library.states)(), run.library.states),
        ),
        "GetEventIndicators": ((c_double * run.library.indicators)(), run.library.indicators),
        "GetStatus": (0, c_int()),
        "GetRealStatus": (LAST_SUCCESSFUL_TIME, real),
        "GetIntegerStatus": (0, c_int()),
        "GetBooleanStatus": (TERMINATED, c_int()),
        "GetStringStatus": (1, c_char_p()),
    }.get(function, ())


def check(run: Instance, function: str, mode: str, kind: int = CO_SIMULATION) -> None:
    before = run.serialised()
    with run.saved() as state:
        run.messages.clear()
        status = run.call(function, *arguments_of(function, run, state, mode))
    if mode in allowed(run.library, kind)[function]:
        assert status == (DISCARD if function in NEVER_AVAILABLE else OK)
        assert [message[1] for message in run.messages] == ([DISCARD] if status == DISCARD else [])
    else:
        assert status == ERROR
        ((_, logged, category, message),) = run.messages
        assert (logged, category) == (ERROR, "logStatusError")
        assert b"fmi2" + function.encode() in message
        assert run.serialised() == before


@each_mode
def test_a_function_is_accepted_where_the_standard_allows_it_and_nowhere_else(
    mass: Library, kind: int, mode: str
) -> None:
    for function in allowed(mass, kind):
        with in_mode(mass, mode, kind) as run:
            check(run, function, mode, kind)


LIVING = [each for each in EACH if each[1] != "F"]


@pytest.mark.parametrize(("kind", "mode"), some(LIVING, LIVING[::2]))
def test_every_block_has_that_table(library: Library, kind: int, mode: str) -> None:
    if library.exchanges:
        for function in allowed(library, kind):
            with in_mode(library, mode, kind) as run:
                check(run, function, mode, kind)
    elif kind == CO_SIMULATION:
        for function in allowed(library, kind).keys() - MODEL_EXCHANGE_ONLY.keys():
            with in_mode(library, mode) as run:
                check(run, function, mode)
    else:
        assert Instance(library, kind=kind).pointer is None


@each_mode
def test_an_illegal_call_does_no_harm(mass: Library, kind: int, mode: str) -> None:
    """After all that is refused, what is allowed goes on as if nothing had been."""
    with in_mode(mass, mode, kind) as run:
        before = run.serialised()
        for function, modes in allowed(mass, kind).items():
            if mode not in modes:
                with run.saved() as state:
                    assert run.call(function, *arguments_of(function, run, state)) == ERROR
        assert run.serialised() == before
        run.must("Reset")
        if kind == MODEL_EXCHANGE:
            run.exchange()
        else:
            run.initialise()
            run.step(0.0, 0.1)


@each_mode
def test_a_saved_state_carries_its_mode(mass: Library, kind: int, mode: str) -> None:
    with in_mode(mass, mode, kind) as run, Instance(mass, kind=kind) as other:
        other.restore(run.serialised())
        for function in ("EnterInitializationMode", "ExitInitializationMode", "DoStep", "GetReal", "NewDiscreteStates"):
            with in_mode(mass, "I", kind) as fresh:
                fresh.restore(run.serialised())
                check(fresh, function, mode, kind)


@pytest.mark.parametrize("kind", KINDS, ids=KINDS.get)
def test_a_state_of_the_other_kind_is_refused(mass: Library, kind: int) -> None:
    other = MODEL_EXCHANGE if kind == CO_SIMULATION else CO_SIMULATION
    with in_mode(mass, "N", kind) as run, Instance(mass, kind=other) as fresh:
        assert fresh.try_restore(run.serialised()) == ERROR
        assert b"the other kind" in fresh.messages[-1][3]


def test_after_terminate_the_last_values_can_still_be_read(library: Library) -> None:
    with in_mode(library, "C") as run:
        before = run.everything()
        run.must("Terminate")
        assert run.everything() == before


# ---- what has no instance


def test_a_null_instance_is_an_error(lugre: Library) -> None:
    with Instance(lugre) as run, run.saved() as state:
        for function in allowed(lugre, CO_SIMULATION):
            arguments = arguments_of(function, run, state)
            assert getattr(lugre.handle, f"fmi2{function}")(None, *arguments) == ERROR, function


def test_freeing_nothing_does_nothing(library: Library) -> None:
    library.handle.fmi2FreeInstance(None)


def test_an_instance_may_be_freed_in_any_mode(mass: Library) -> None:
    for kind, mode in EACH:
        in_mode(mass, mode, kind).free()


def test_freeing_no_state_does_nothing(lugre: Library) -> None:
    with Instance(lugre) as run:
        run.must("FreeFMUstate", byref(c_void_p()))
        run.must("FreeFMUstate", None)


def test_the_library_says_what_it_is(library: Library) -> None:
    assert library.handle.fmi2GetVersion() == {2: b"2.0", 3: b"3.0"}[library.fmi]
    assert library.handle.fmi2GetTypesPlatform() == b"default"


REFUSED = {
    "wrong GUID": ({"guid": b"{00000000-0000-0000-0000-000000000000}"}, (b"GUID", b"instantiation token")),
    "empty GUID": ({"guid": b""}, (b"GUID", b"instantiation token")),
    "unknown kind": ({"kind": 7}, (b"co-simulation", b"scheduled execution")),
    "empty name": ({"name": b""}, (b"name", b"name")),
    "no name": ({"name": None}, (b"name", b"name")),
}


@pytest.mark.parametrize("fault", REFUSED)
@pytest.mark.parametrize("logging", [False, True])
def test_a_faulty_instantiation_gives_null_and_says_why(library: Library, fault: str, logging: bool) -> None:
    change, words = REFUSED[fault]
    refused = Instance(library, **{"name": b"x", "logging": logging} | change)
    assert refused.pointer is None
    ((_, status, category, message),) = refused.messages
    assert (status, category) == (ERROR, "logStatusError")
    assert words[library.fmi - 2] in message
    assert message.startswith(b"fmi2Instantiate")  # names of FMI 3.0 are translated


@pytest.mark.parametrize("fault", REFUSED)
def test_a_faulty_instantiation_without_a_logger_gives_null(lugre: Library, fault: str) -> None:
    change, _ = REFUSED[fault]
    assert Instance(lugre, **{"name": b"x", "logger": False} | change).pointer is None
    assert Instance(lugre, **{"name": b"x", "callbacks": False} | change).pointer is None


@pytest.fixture
def silent(lugre: Library) -> Iterator[Instance]:
    with Instance(lugre, logger=False) as made:
        yield made


def test_an_instance_without_a_logger_refuses_in_silence(silent: Instance) -> None:
    assert silent.call("DoStep", 0.0, 0.1, 1) == ERROR
    silent.initialise()
    assert silent.try_set({"v": float("nan")}) == [DISCARD]
    silent.step(0.0, 0.1)


def test_an_instance_without_callbacks_works(lugre: Library) -> None:
    with Instance(lugre, callbacks=False) as run:
        run.initialise(v=1e-3)
        assert run.call("Reset") == OK


@pytest.mark.parametrize("setup", [(1, 0.0, 0.0, 0, 0.0), (1, -1e-3, 0.0, 0, 0.0), (1, float("nan"), 0.0, 0, 0.0),
                                   (0, 0.0, float("nan"), 0, 0.0), (0, 0.0, float("inf"), 0, 0.0),
                                   (0, 0.0, 1.0, 1, 0.5), (0, 0.0, 0.0, 1, float("nan"))])  # fmt: skip
def test_an_impossible_experiment_is_an_error(lugre: Library, setup: tuple[float, ...]) -> None:
    """Tolerance not positive, start not finite, stop before start."""
    with Instance(lugre) as run:
        before = run.serialised()
        assert run.call("SetupExperiment", *setup) == ERROR
        assert run.messages[-1][1] == ERROR
        assert run.serialised() == before


def test_values_of_the_experiment_that_are_not_defined_do_not_count(lugre: Library) -> None:
    with Instance(lugre) as run:
        run.must("SetupExperiment", 0, float("nan"), 0.0, 0, float("nan"))
        run.must("SetupExperiment", 0, -1.0, 0.0, 0, -1.0)
        run.must("EnterInitializationMode")
        run.must("ExitInitializationMode")
        run.step(0.0, 0.1)


def test_without_an_experiment_time_starts_at_zero_and_does_not_end(lugre: Library) -> None:
    with Instance(lugre) as run:
        run.must("EnterInitializationMode")
        run.must("ExitInitializationMode")
        assert run.get1("time") == 0.0
        run.step(0.0, 0.1)


@pytest.mark.parametrize("kind", [-1, 0, 1, 2, 3, 4, 99])
def test_statuses_of_another_kind_are_discarded(lugre: Library, kind: int) -> None:
    if lugre.fmi == 3:
        pytest.skip("FMI 3.0 has no function for GetRealStatus")
    with Instance(lugre) as run:
        run.initialise()
        value = c_double(-7.0)
        assert run.call("GetRealStatus", kind, value) == (OK if kind == LAST_SUCCESSFUL_TIME else DISCARD)
        flag = c_int(-7)
        assert run.call("GetBooleanStatus", kind, flag) == (OK if kind == TERMINATED else DISCARD)
        assert value.value == (0.0 if kind == LAST_SUCCESSFUL_TIME else -7.0)
        assert flag.value == (0 if kind == TERMINATED else -7)
