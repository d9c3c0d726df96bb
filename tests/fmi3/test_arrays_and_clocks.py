"""What FMI 3.0 has and FMI 2.0 has not: arrays and their size, clocks, early return, intermediate update, adjoints."""

from __future__ import annotations

import ctypes
import re
import subprocess
import zipfile
from collections.abc import Callable
from ctypes import byref, c_bool, c_double, c_void_p
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmi3.slaves import Model, Slave, check_adjoint, three
from lxml import etree
from shell.selection import SHELL_BLOCKS
from thorough import landing, some

from harness.compiling.toolchain import header_folder

RESIZED = ("GMS", "MaxwellSlip", "ModifiedLeuven", "ModifiedLeuvenFeedforward")


def resize(one: Slave, size: int) -> None:
    one.enterConfigurationMode()
    one.setUInt64([one.reference("N")], [size])
    one.exitConfigurationMode()


# ---- the two profiles


EVERY = [(name, full) for name in ("GMS", "PID") for full in (True, False)]


@pytest.mark.parametrize(("name", "full"), some(EVERY, [("GMS", True), ("PID", True)]))
def test_value_references_are_positions(build_fmu: Callable[..., Path], name: str, full: bool) -> None:
    """OMSimulator takes dependencies as positions from 1; as such they are those of FMI 2.0."""
    two, description = (fmpy.read_model_description(str(path)) for path in (build_fmu(name), three(name, full)))
    variables = description.modelVariables
    assert [v.valueReference for v in variables] == list(range(1, len(variables) + 1))

    def bare(known: str) -> str:
        return re.sub(r"\[\d+\]", "", known)

    for group in ("outputs", "continuousStateDerivatives" if description.modelExchange else "outputs"):
        old = {"continuousStateDerivatives": "derivatives"}.get(group, group)
        meant: dict[str, set[str]] = {}
        for unknown in getattr(two, old):
            meant.setdefault(bare(unknown.variable.name), set()).update(bare(k.name) for k in unknown.dependencies)
        with zipfile.ZipFile(three(name, full)) as archive:
            root = etree.fromstring(archive.read("modelDescription.xml"))
        tag = {"outputs": "Output"}.get(group, "ContinuousStateDerivative")
        found: dict[str, set[str]] = {}
        for unknown in root.iterfind(f"ModelStructure/{tag}"):
            known = {bare(variables[int(k) - 1].name) for k in str(unknown.get("dependencies")).split()}
            owner = variables[int(str(unknown.get("valueReference"))) - 1]
            found.setdefault(bare(owner.name), set()).update(known)
        assert found == meant


@pytest.mark.parametrize("name", ["GMS", "PID"])
def test_the_profile_for_all_importers_has_neither_arrays_nor_clocks(name: str) -> None:
    """fmusim needs the structural parameter before its arrays, PyFMI a scalar for each event indicator."""
    plain, full = (fmpy.read_model_description(str(three(name, full))) for full in (False, True))
    assert not any(v.dimensions or v.type in ("Clock", "UInt64") for v in plain.modelVariables)
    assert not plain.coSimulation.hasEventMode
    assert (full.modelVariables[0].causality == "structuralParameter") is (name == "GMS")
    assert any(v.type == "Clock" for v in full.modelVariables) is (name == "PID")
    assert not any(indicator.variable.dimensions for each in (plain, full) for indicator in each.eventIndicators)


@pytest.mark.parametrize(("name", "input_", "output"), [("GMS", "v", "F"), ("PID", "x", "u")])
def test_both_profiles_give_the_same_bits(name: str, input_: str, output: str) -> None:
    found = []
    for full in (False, True):
        with Slave(three(name, full)) as one:
            one.initialise()
            rows = []
            for k in range(50):
                one.set(input_, 1e-3 * np.sin(0.3 * k))
                one.doStep(k * 1e-3, 1e-3)
                rows.append(one.get(output))
        found.append(rows)
    assert found[0] == found[1] and any(row != found[0][0] for row in found[0])


# ---- arrays


@pytest.mark.parametrize("name", some(RESIZED, RESIZED[:2]))
def test_the_structural_parameter_resizes_the_arrays(name: str) -> None:
    """Their first elements stay; in configuration mode and nowhere else."""
    with Slave(three(name)) as one:
        n = one.reference("N")
        size = int(one.variables["N"].start)
        arrays = [v for v in one.variables.values() if v.dimensions and v.causality == "parameter"]
        starts = {v.name: [float(x) for x in v.start.split()] for v in arrays}
        assert starts
        one.refuses(lambda: one.setUInt64([n], [3]), "instantiated")
        resize(one, 3)
        one.enterInitializationMode()
        for array, values in starts.items():
            assert one.get(array, 3) == values[:3]
            one.refuses(lambda array=array: one.get(array, size), "3 elements")
        one.refuses(lambda: one.setUInt64([n], [2]), "initialization mode")
        one.exitInitializationMode()
        one.refuses(lambda: one.setUInt64([n], [2]), "step mode")
        assert one.getUInt64([n]) == [3]
        one.doStep(0.0, 1e-3)


@pytest.mark.parametrize("size", [0, 2**63, 2**64 - 1])
def test_a_size_out_of_range_is_refused(size: int) -> None:
    with Slave(three("GMS")) as one:
        one.enterConfigurationMode()
        one.refuses(lambda: one.setUInt64([one.reference("N")], [size]), "N")


def test_a_block_without_structural_parameters_has_no_configuration_mode() -> None:
    with Slave(three("LuGre")) as one:
        one.refuses(one.enterConfigurationMode, "structural")


def test_fewer_elements_give_the_force_of_fewer_springs() -> None:
    """Maxwell slip in presliding: F = sum k[i] x for the elements that it has."""
    with Slave(three("MaxwellSlip")) as one:
        resize(one, 4)
        one.initialise(v=0.0)
        one.set("v", 1e-6)
        one.doStep(0.0, 1e-3)
        (force,) = one.get("F")
        assert force == pytest.approx(sum(one.get("k", 4)) * 1e-9, rel=1e-12)


def test_states_are_resized() -> None:
    """In model exchange: as many continuous states as elements."""
    with Model(three("MaxwellSlip")) as one:
        whole = one.getNumberOfContinuousStates()
        resize(one, 3)
        assert (whole, one.getNumberOfContinuousStates()) == (int(one.variables["N"].start), 3)
        one.enterInitializationMode()
        one.exitInitializationMode()
        one.updateDiscreteStates()
        one.enterContinuousTimeMode()
        x = (c_double * 3)(1e-7, 2e-7, -1e-7)
        one.setContinuousStates(x, 3)
        found = (c_double * 3)()
        one.getContinuousStates(found, 3)
        assert list(found) == list(x)
        assert one.get("F")[0] == pytest.approx(sum(x), rel=1e-12)  # the states are the forces of the springs
        one.refuses(lambda: one.getContinuousStates((c_double * whole)(), whole), "3 continuous states")


@landing
def test_states_beside_a_resized_array() -> None:
    """A scalar and the first three of ten elements, in the order of the description."""
    with Model(three("ModifiedLeuven")) as one:
        resize(one, 3)
        assert one.getNumberOfContinuousStates() == 4
        one.enterInitializationMode()
        one.exitInitializationMode()
        one.updateDiscreteStates()
        one.enterContinuousTimeMode()
        x = (c_double * 4)(1e-7, 2e-2, -1e-2, 3e-2)
        one.setContinuousStates(x, 4)
        found = (c_double * 4)()
        one.getContinuousStates(found, 4)
        assert list(found) == list(x)
        assert [*one.get("z"), *one.get("Fi", 3)] == list(x)


def test_an_array_is_got_and_set_as_a_whole() -> None:
    with Slave(three("GMS")) as one:
        one.enterInitializationMode()
        size = int(one.variables["N"].start)
        values = [1000.0 * (i + 1) for i in range(size)]
        one.set("k", *values)
        assert one.get("k", size) == values
        both = one.getFloat64([one.reference("Fc"), one.reference("k")], nValues=size + 1)
        assert both[1:] == values
        one.refuses(lambda: one.set("k", *values[1:]), f"{size} elements")
        one.refuses(lambda: one.set("k", *values[:-1], float("nan")), "k")


# ---- clocks


def driven(one: Slave, stop: float, h: float) -> list[tuple[float, float]]:
    """Time and output of the PID controller, instantiated with event mode, at the end of each step."""
    t, due, found = 0.0, True, []
    while t < stop - 1e-9:
        one.set("x", 1e-3 * np.sin(20.0 * t))
        if due:
            if t > 0.0:
                one.enterEventMode()
            one.setClock([one.reference("samples")], [True])
            while one.updateDiscreteStates()[0]:
                pass
            one.enterStepMode()
        due, _, _, t = one.doStep(t, min(h, stop - t))
        found.append((t, one.get("u")[0]))
    return found


@pytest.mark.parametrize("h", [1e-3, 2.5e-4, 0.9e-3])
def test_samples_in_events_are_those_inside_a_step(h: float) -> None:
    """Bit for bit, with the same inputs at the samples: the steps end there."""
    with Slave(three("PID"), eventModeUsed=True, earlyReturnAllowed=True) as events, Slave(three("PID")) as inside:
        for one in (events, inside):
            one.initialise(r=1e-3, rd=0.0, rdd=0.0, v=0.0)
        found = driven(events, 0.02, h)
        assert {round(t / 1e-3) for t, _ in found if abs(t / 1e-3 - round(t / 1e-3)) < 1e-9} == set(range(1, 21))
        expected, t = [], 0.0
        for end, _ in found:
            inside.set("x", 1e-3 * np.sin(20.0 * t))
            assert inside.doStep(t, end - t)[:3] == (False, False, False)
            t = end
            expected.append((t, inside.get("u")[0]))
        assert found == expected


def test_an_event_without_the_clock_leaves_the_sample_to_the_next_step() -> None:
    with Slave(three("PID"), eventModeUsed=True) as late, Slave(three("PID")) as inside:
        for one in (late, inside):
            one.initialise(r=1e-3, rd=0.0, rdd=0.0, v=0.0)
        late.updateDiscreteStates()
        late.setClock([late.reference("samples")], [False])
        late.updateDiscreteStates()
        late.enterStepMode()
        for one in (late, inside):
            one.doStep(0.0, 0.5e-3)
        assert late.get("u") == inside.get("u") != [0.0]
    with Slave(three("PID"), eventModeUsed=True) as late:
        late.initialise(r=1e-3, rd=0.0, rdd=0.0, v=0.0)
        late.updateDiscreteStates()
        late.setClock([late.reference("samples")], [True])  # its tick is still due
        late.updateDiscreteStates()
        late.enterStepMode()
        late.doStep(0.0, 0.5e-3)
        assert late.get("u") != [0.0]


def set_slope(one: Slave, name: str, slope: float) -> None:
    """Set the time derivative of an input."""
    slopes = one.dll.harness_SetInputDerivatives
    slopes.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_void_p]
    references, orders = (ctypes.c_uint * 1)(one.reference(name)), (ctypes.c_int * 1)(1)
    assert slopes(one.component, references, 1, orders, (c_double * 1)(slope)) == 0


def test_input_derivatives_last_for_the_whole_step() -> None:
    """Over samples at which the importer reads values, a ramp gives what it gives without them."""
    found = []
    for update in ({}, {"earlyReturnAllowed": False, "intermediateUpdate": stopping(1.0, [])}):
        with Slave(three("PID"), **update) as one:
            one.initialise(r=1e-3, rd=0.0, rdd=0.0, v=0.0)
            set_slope(one, "x", 0.5)
            one.doStep(0.0, 5e-3)
            found.append(one.get("u") + one.get("x"))
    assert found[0] == pytest.approx(found[1], rel=1e-12)


def test_the_clock_has_the_interval_of_ts() -> None:
    with Slave(three("PID"), eventModeUsed=True) as one:
        clock = one.variables["samples"]
        assert (clock.type, clock.intervalVariability) == ("Clock", "fixed")
        assert clock.intervalDecimal is None  # it depends on Ts: importers ask for it
        one.enterInitializationMode()
        one.set("Ts", 4e-3)
        references, interval, qualifier = (ctypes.c_uint * 1)(one.reference("samples")), c_double(), ctypes.c_int()
        one.fmi3GetIntervalDecimal(one.component, references, 1, byref(interval), byref(qualifier))
        assert (interval.value, qualifier.value) == (4e-3, 2)
        one.refuses(
            lambda: one.fmi3SetIntervalDecimal(one.component, references, 1, byref(interval)), "the parameter Ts"
        )
        one.exitInitializationMode()
        one.setClock([clock.valueReference], [True])
        assert one.getClock([clock.valueReference])[0]
        one.updateDiscreteStates()
        assert not one.getClock([clock.valueReference])[0]
        one.enterStepMode()
        one.doStep(0.0, 1e-3)
        one.enterEventMode()
        one.refuses(lambda: one.setClock([clock.valueReference], [True]), "0.0040000000000000001 s")


def test_clock_functions_write_only_the_values_asked_for() -> None:
    """What lies behind the arrays of an importer stays as it is."""
    with Slave(three("PID"), eventModeUsed=True) as one:
        one.initialise()
        references = (ctypes.c_uint32 * 1)(one.reference("samples"))
        ticks, interval, shift = (c_bool * 2)(True, True), (c_double * 2)(1.0, 7.0), (c_double * 2)(1.0, 7.0)
        qualifier = (ctypes.c_int * 2)(9, 9)
        one.fmi3GetClock(one.component, references, 1, ticks)
        one.fmi3GetIntervalDecimal(one.component, references, 1, interval, qualifier)
        one.fmi3GetShiftDecimal(one.component, references, 1, shift)
        assert ([*ticks], [*interval], [*shift]) == ([False, True], [0.001, 7.0], [0.0, 7.0])
        assert [value == 9 for value in qualifier] == [False, True]


def test_a_continuous_block_has_no_event_mode() -> None:
    with pytest.raises(Exception, match="Failed to instantiate"):
        Slave(three("LuGre"), eventModeUsed=True)
    with Slave(three("LuGre")) as one:
        one.initialise()
        one.refuses(one.enterEventMode, "eventModeUsed = false")


# ---- intermediate update and early return


def stopping(at: float, times: list[float]) -> Callable[..., None]:
    """A callback that ends the step at the first update at or after a time."""

    def update(
        _: object, t: float, _set: bool, _get: bool, finished: bool, can: bool, wanted: object, when: object
    ) -> None:
        assert finished
        times.append(t)
        if can and t >= at:
            ctypes.cast(wanted, ctypes.POINTER(c_bool))[0] = True
            ctypes.cast(when, ctypes.POINTER(c_double))[0] = t

    return update


@pytest.mark.parametrize("name", ["PID", "compensated_axis"])
def test_an_importer_may_end_a_step_at_a_sample(name: str) -> None:
    """Of a block or, in a composite, at a point of its grid."""
    times: list[float] = []
    with Slave(three(name), earlyReturnAllowed=True, intermediateUpdate=stopping(0.0035, times)) as one:
        one.initialise()
        event, terminate, early, last = one.doStep(0.0, 0.01)
        assert (event, terminate, early) == (False, False, True)
        assert last == times[-1]
        assert last == pytest.approx(0.004, abs=1e-12) or name != "PID"
        assert 0.0035 <= last <= 0.004 + 1e-12
        assert one.doStep(last, 0.01 - last)[2]
        assert times == sorted(times)


@pytest.mark.parametrize(
    ("name", "value", "slope", "h"), [("Mass", 1e308, 0.0, 10.0), ("SampledSum", 1.797e308, 1.7e308, 0.01)]
)
@pytest.mark.parametrize("updates", some([False, True], [True]))
def test_a_shorter_step_works_after_one_that_is_discarded(
    name: str, value: float, slope: float, h: float, updates: bool
) -> None:
    """The state is that before the call, even if samples were taken before the one that overflows."""
    times: list[float] = []
    options = {"intermediateUpdate": stopping(1.0, times)} if updates else {}
    driven, ramped = ("F_drive", "F_load") if name == "Mass" else ("u1", "u2")
    with Slave(three(name), **options) as one, Slave(three(name), **options) as fresh:
        for each in (one, fresh):
            each.initialise()
            each.set(driven, value)
            set_slope(each, ramped, slope)
        one.refuses(lambda: one.doStep(0.0, h), "at its start is kept")
        assert len(times) == (updates and name == "SampledSum")
        for each in (one, fresh):
            assert each.doStep(0.0, 0.5e-3)[-1] == 0.5e-3
            each.set(driven, 1.0)
            each.doStep(0.5e-3, h)
        state, other = one.getFMUState(), fresh.getFMUState()
        assert one.serializeFMUState(state) == fresh.serializeFMUState(other)
        one.freeFMUState(state)
        fresh.freeFMUState(other)


@pytest.mark.parametrize("name", some(["LuGre", "PID", "GMS", "compensated_axis"], ["PID", "GMS"]))
def test_intermediate_variables_are_the_results_that_are_continuous(name: str) -> None:
    """Those marked with intermediateUpdate can be required and read in an update; no other one can be required."""
    found: list[object] = []
    variables = [v for v in fmpy.read_model_description(str(three(name))).modelVariables if v.name != "time"]
    with zipfile.ZipFile(three(name)) as archive:  # fmpy does not read the attribute
        root = etree.fromstring(archive.read("modelDescription.xml"))
    marked = [int(str(each.get("valueReference"))) for each in root.iterfind(".//*[@intermediateUpdate='true']")]
    plain = [v for v in variables if not v.name.startswith("event_indicators")]
    results = [v for v in plain if v.type == "Float64" and v.causality in ("output", "local", None)]
    assert marked == [v.valueReference for v in results if v.variability in ("continuous", None)]
    size = {v.valueReference: int(np.prod(v.shape or (1,))) for v in variables}

    def update(_: object, t: float, *_rest: object) -> None:
        found.append([one.getFloat64([reference], nValues=size[reference]) for reference in marked])

    options = {"requiredIntermediateVariables": marked, "intermediateUpdate": update}
    with Slave(three(name), **options) as one:
        one.initialise()
        one.doStep(0.0, 0.01)
        assert found and found[-1] == [one.getFloat64([reference], nValues=size[reference]) for reference in marked]
    for v in variables:
        if v.valueReference not in marked:
            with pytest.raises(Exception, match="Failed to instantiate"):
                Slave(three(name), requiredIntermediateVariables=[v.valueReference])


def test_an_update_without_permission_ends_no_step() -> None:
    times: list[float] = []
    with Slave(three("PID"), intermediateUpdate=stopping(0.0, times)) as one:
        one.initialise()
        assert one.doStep(0.0, 0.01) == (False, False, False, 0.01)
        assert times == pytest.approx([1e-3 * k for k in range(1, 11)])


def test_updates_change_no_number() -> None:
    """A step that is cut at the samples for the updates is the whole step bit for bit."""
    with Slave(three("PID"), intermediateUpdate=stopping(1.0, [])) as one, Slave(three("PID")) as other:
        for each in (one, other):
            each.initialise(r=1e-3, x=0.0)
            each.set("x", 2e-4)
            for k in range(5):
                each.doStep(3.3e-3 * k, 3.3e-3)
        assert one.get("u") == other.get("u")


# ---- derivatives


@pytest.mark.parametrize("name", some(SHELL_BLOCKS, ("LuGre", "GMS", "PID")))
def test_adjoint_is_the_transpose_of_directional(name: str) -> None:
    check_adjoint(name)


def test_derivatives_of_nothing_need_no_arrays() -> None:
    nothing = (None, 0) * 4
    with Slave(three("LuGre")) as one:
        one.initialise()
        one.fmi3GetDirectionalDerivative(one.component, *nothing)
        one.fmi3GetAdjointDerivative(one.component, *nothing)
        one.fmi3GetOutputDerivatives(one.component, None, 0, None, None, 0)


def test_scalars_may_be_repeated_up_to_the_number_of_variables(build_fmu: Callable[..., Path]) -> None:
    """With more, they are certainly repeated. F = sigma0 z + ..., so dF/dz = sigma0 at v = 0."""
    most = len(fmpy.read_model_description(str(build_fmu("LuGre"))).modelVariables)
    with Slave(three("LuGre")) as one:
        one.initialise(v=0.0, sigma0=2e4)
        z, F = one.reference("z"), one.reference("F")
        for given in (most, most + 1):

            def differentiate(count: int = given) -> list[float]:
                return list(one.getDirectionalDerivative([F] * (count - 1), [z], [1.0]))

            def derive(count: int = given) -> list[float]:
                found = (c_double * count)()
                references, orders = (ctypes.c_uint * count)(*[F] * count), (ctypes.c_int * count)(*[1] * count)
                one.fmi3GetOutputDerivatives(one.component, references, count, orders, found, count)
                return list(found)

            if given == most:
                assert differentiate() == pytest.approx([2e4] * (most - 1))
                assert derive() == [0.0] * most
            else:
                one.refuses(differentiate, "more than once")
                one.refuses(derive, "more than once")


# ---- states


def test_states_of_another_fmu_are_refused() -> None:
    with Slave(three("LuGre")) as lugre, Slave(three("Mass")) as mass:
        state = mass.getFMUState()
        data = mass.serializeFMUState(state)
        lugre.refuses(lambda: lugre.deserializeFMUState(data), "another FMU")
        lugre.refuses(lambda: lugre.setFMUState(state), "another FMU")
        mass.freeFMUState(state)


def test_a_state_keeps_mode_and_size() -> None:
    with Slave(three("GMS")) as one, Slave(three("GMS")) as other:
        resize(one, 3)
        one.initialise()
        one.set("v", 1e-3)
        one.doStep(0.0, 1e-3)
        state = one.getFMUState()
        copy = other.deserializeFMUState(one.serializeFMUState(state))
        other.setFMUState(copy)
        for each in (one, other):
            each.doStep(1e-3, 1e-3)
        assert one.get("F") == other.get("F")
        assert other.getUInt64([other.reference("N")]) == [3]
        one.freeFMUState(state)
        other.freeFMUState(copy)


def test_a_state_of_event_mode_needs_event_mode() -> None:
    with Slave(three("PID"), eventModeUsed=True) as events, Slave(three("PID")) as plain:
        state = events.getFMUState()
        data = events.serializeFMUState(state)
        plain.refuses(lambda: plain.deserializeFMUState(data), "eventModeUsed")
        events.freeFMUState(state)


# ---- sources


@pytest.mark.parametrize("name", some(["PID", "GMS"], ["GMS"]))
def test_the_build_description_is_enough_to_compile(name: str, tmp_path: Path) -> None:
    """With gcc, and the headers of FMI 3.0 only."""
    folder = Path(fmpy.extract(str(three(name)))) / "sources"
    build = etree.parse(folder / "buildDescription.xml")
    files = [str(file.get("name")) for file in build.iter("SourceFile")]
    headers = tmp_path / "headers"
    headers.mkdir()
    for header in header_folder().glob("fmi3*.h"):
        (headers / header.name).write_bytes(header.read_bytes())
    library = tmp_path / f"{name}.so"
    command = ["gcc", "-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared", "-isystem", str(headers)]
    prefix = f"{name}_"
    subprocess.run([*command, *files, "-o", str(library), "-lm"], cwd=folder, check=True)
    made = ctypes.CDLL(str(library))
    version = getattr(made, f"{prefix}fmi3GetVersion")
    version.restype = ctypes.c_char_p
    assert version() == b"3.0"
    assert c_void_p.in_dll(made, f"{prefix}fmi3DoStep") is not None
