"""What importers call, in their order, against the plainest run of the same block: the same bits.

OMSimulator, PyFMI, MasterSim, fmusim, the FMU Compliance Checker and containers, whether they are installed or not, as
traces of them show. `tests/shell` has the functions one by one.
"""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from shell.instance import OK, Instance, Library, signals

STEPS, H = 20, 2.0**-9


def driven(library: Library) -> list[dict[str, float]]:
    """Inputs before each step."""
    return signals(library, 3, STEPS)


def plain(library: Library, tolerance: float | None = None) -> bytes:
    """The bits of all variables at the end of the plainest run."""
    with Instance(library) as run:
        inputs = driven(library)
        run.initialise(tolerance=tolerance, **inputs[0])
        for k, values in enumerate(inputs):
            run.set(values)
            run.step(k * H, H)
        return run.everything()


def set_one_by_one(run: Instance, values: Mapping[str, float]) -> None:
    for name, value in values.items():
        run.set({name: value})


def read_one_by_one(run: Instance) -> None:
    for name in run.library.variables:
        run.get1(name)


def test_omsimulator(library: Library) -> None:
    """Inputs in initialization mode, after it and before each step; all read one by one, again after setting."""
    inputs = driven(library)
    with Instance(library, b"model.root.block", resources=b"file:////tmp/x/resources", visible=True) as run:
        run.setup(tolerance=1e-4)
        run.must("EnterInitializationMode")
        read_one_by_one(run)
        set_one_by_one(run, inputs[0])
        read_one_by_one(run)
        run.must("ExitInitializationMode")
        for k, values in enumerate(inputs):
            set_one_by_one(run, values)
            read_one_by_one(run)
            run.step(k * H, H)
            read_one_by_one(run)
        assert run.everything() == plain(library, tolerance=1e-4)
        run.step(STEPS * H, 1e-17)  # one more than was asked for
        run.must("Terminate")


def test_libcosim_and_ecos(library: Library) -> None:
    """All Reals in one call each step, time and parameters among them; ecos names an instance by a path."""
    inputs, reals = driven(library), library.names(type="Real")
    with Instance(library, b"/tmp/system/resources/Block.fmu", resources=b"file:////tmp/x/resources/") as run:
        run.setup()
        run.must("EnterInitializationMode")
        for _ in range(3):
            run.set(inputs[0])
            run.get(*reals)
        run.must("ExitInitializationMode")
        run.set(inputs[0])
        for k, values in enumerate(inputs):
            run.set(values)
            run.step(k * H, H)
            run.get(*reals)
        assert run.everything() == plain(library)


def test_pyfmi_master(library: Library) -> None:
    """Calls with no variables at all, and outputs once more after the inputs are set."""
    inputs, outputs = driven(library), library.names("output")
    with Instance(library) as run:
        run.setup(tolerance=1e-6)
        run.must("EnterInitializationMode")
        assert run.call("SetReal", None, 0, None) == OK
        run.set(inputs[0])
        run.must("ExitInitializationMode")
        for k, values in enumerate(inputs):
            assert run.call("SetReal", None, 0, None) == OK
            run.set(values)
            run.get(*outputs)
            run.step(k * H, H)
            run.get(*outputs)
        assert run.everything() == plain(library, tolerance=1e-6)
        run.must("Terminate")


def test_mastersim_goes_back(library: Library) -> None:
    """Start values before initialization mode; each step done twice from a saved state; never terminated."""
    inputs = driven(library)
    with Instance(library) as run:
        run.setup(tolerance=1e-5, stop=STEPS * H)
        run.set({v: library.start(v) for v in library.names("parameter")})
        run.set(inputs[0])
        run.must("EnterInitializationMode")
        run.set(inputs[0])
        run.must("ExitInitializationMode")
        for k, values in enumerate(inputs):
            with run.saved() as state:
                run.set(values)
                run.must("DoStep", k * H, H, 1)  # promises never to go back
                run.get(*library.names("output"))
                run.must("SetFMUstate", state)
                run.set(values)
                run.step(k * H, H)
        assert run.everything() == plain(library, tolerance=1e-5)


def test_fmusim_resumes_from_a_file(library: Library) -> None:
    """The state goes into an instance straight after fmi2Instantiate."""
    inputs, half = driven(library), STEPS // 2
    resources = library.folder.joinpath("resources").as_uri().encode() + b"/"
    with Instance(library, resources=resources) as first:
        first.initialise(**inputs[0])
        for k in range(half):
            first.set(inputs[k])
            first.step(k * H, H)
        data = first.serialised()
    with Instance(library, resources=resources) as second:
        second.restore(data)
        assert second.get1("time") == half * H
        for k in range(half, STEPS):
            second.set(inputs[k])
            second.step(k * H, H)
        assert second.everything() == plain(library)


def test_compliance_checker(library: Library) -> None:
    """Nothing is set, all is logged."""
    with Instance(library, b"x") as run, Instance(library, b"y", logging=False) as other:
        run.initialise()
        other.initialise()
        for k in range(STEPS):
            read_one_by_one(run)
            run.step(k * H, H)
            other.step(k * H, H)
        assert run.everything() == other.everything()
        assert [message for message in run.messages if message[2] != "logStatusWarning"] == []
        run.must("Terminate")


def test_cofmupy_and_containers(library: Library) -> None:
    """Inputs before fmi2SetupExperiment, one by one; steps at times that are added up; never terminated."""
    inputs, t = driven(library), 0.0
    with Instance(library, b"Block.fmu", resources=b"file:///tmp/container//00/resources", logging=False) as run:
        set_one_by_one(run, inputs[0])
        run.setup()
        run.must("EnterInitializationMode")
        run.must("ExitInitializationMode")
        for values in inputs:
            set_one_by_one(run, values)
            run.step(t, H)
            t += H
        assert run.everything() == plain(library)


@pytest.mark.parametrize("resources", [b"", b"file:/x", b"/x/resources", b"no uri at all", b"file:///%20%C3%A4/%"])
def test_whatever_the_resources_are_called(library: Library, resources: bytes) -> None:
    with Instance(library, b"a/b.c d", resources=resources) as run:
        run.initialise()
        run.step(0.0, H)


def test_a_last_step_that_is_short_by_rounding(library: Library) -> None:
    """h (1 - 1e-15), and the rest in one more step: no sample is lost and none is taken twice."""
    inputs = driven(library)
    with Instance(library) as short, Instance(library) as whole:
        for run in (short, whole):
            run.initialise(stop=STEPS * H, **inputs[0])
            for k in range(STEPS - 1):
                run.set(inputs[k])
                run.step(k * H, H)
        t = (STEPS - 1) * H
        whole.step(t, H)
        short.step(t, H * (1.0 - 1e-15))
        short.step(t + H * (1.0 - 1e-15), 1e-17)
        for name in library.names(type="Real"):
            nominal = float(library.variables[name].nominal or 1.0)
            assert short.get1(name) == pytest.approx(whole.get1(name), rel=1e-9, abs=1e-9 * nominal), name
