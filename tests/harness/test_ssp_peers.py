"""Written .ssp archives in other tools: each runs them to the solution that is known in closed form."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from fmpy.ssp import ssd
from fmpy.ssp.simulation import simulate_ssp

from harness import Experiment, FmuPart, Parameter, ParameterSet, System, Wire, write_ssv

STOP = 4.0
M, K, FV = 1.0, 4.0, 0.4
NAMES = ("mass.x", "mass.v", "friction.F")
Trajectories = Mapping[str, np.ndarray]


def exact(times: np.ndarray, gain: float = 1.0, offset: float = 0.0) -> np.ndarray:
    """Position of the mass: m x'' = -k x - (gain Fv x' + offset), from x = 1 at rest."""
    rest = -offset / K
    decay = gain * FV / (2.0 * M)
    omega = np.sqrt(K / M - decay**2)
    return rest + (1.0 - rest) * np.exp(-decay * times) * (
        np.cos(omega * times) + decay / omega * np.sin(omega * times)
    )


@pytest.fixture
def oscillator(build_fmu: Callable[..., Path]) -> Callable[..., System]:
    def make(step: float, gain: float = 1.0, offset: float = 0.0) -> System:
        return System(
            [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("Viscous"))],
            ["mass.v -> friction.v", Wire("friction.F", "mass.F_friction", gain=gain, offset=offset)],
            {"mass.m": M, "mass.k": K, "mass.x0": 1.0, "mass.F_drive": 0.0, "friction.Fv": FV},
            Experiment(stop=STOP, step=step, master="jacobi", record=NAMES),
            name="oscillator",
        )

    return make


@pytest.fixture(autouse=True)
def _temporary(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The folder for temporary files, which ecos leaves behind."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))


def own(system: System) -> Trajectories:
    with system:
        result = system.run()
    return {name: result[name].to_numpy()[1:] for name in NAMES}


def in_libcosim(path: Path, step: float) -> Trajectories:
    """Run an archive, whose annotation says the step."""
    pytest.importorskip("libcosimpy")
    from libcosimpy.CosimEnums import CosimVariableType
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.WARNING)
    count = round(STOP / step)
    execution = CosimExecution.from_ssp_file(str(path))
    observer = CosimObserver.create_time_series(count + 1)
    execution.add_observer(observer)
    places = {}
    for name in NAMES:
        part, port = name.split(".")
        slave = execution.slave_index_from_instance_name(part)
        places[name] = next(
            (slave, variable.reference)
            for variable in execution.slave_variables(slave)
            if variable.name.decode() == port
        )
        observer.start_time_series(*places[name], CosimVariableType.REAL)
    execution.step(count)
    assert execution.status().current_time == round(STOP * 1e9)
    return {
        name: np.array(observer.time_series_real_samples(slave, reference, 1, count)[2])
        for name, (slave, reference) in places.items()
    }


def in_ecos(path: Path, step: float) -> Trajectories:
    """Run an archive with its parameter set."""
    try:
        from ecospy import EcosLib, EcosSimulation
    except (ImportError, OSError) as error:  # its library needs Debian's libtbb12
        pytest.skip(f"ecospy cannot be loaded: {error}")
    EcosLib.set_log_level("warn")
    rows = []
    with EcosSimulation(step, ssp_path=str(path)) as simulation:
        simulation.init(parameter_set="start")
        for _ in range(round(STOP / step)):
            simulation.step()
            rows.append([simulation.get_real(name.replace(".", "::")) for name in NAMES])
        simulation.terminate()
    return dict(zip(NAMES, np.array(rows).T, strict=True))


def in_fmpy(path: Path, step: float) -> Trajectories:
    """Run an archive; fmpy wants the parameters of the SSD handed over, and stamps ends of steps with their begin."""
    system = ssd.read_ssd(str(path)).system
    start = {
        f"{component.name}.{parameter.name}": Parameter(float(parameter.value))
        for component in ssd.find_components(system)
        for binding in component.parameterBindings
        for values in binding.parameterValues
        for parameter in values.parameters
    }
    write_ssv(ParameterSet("start", start), path.with_suffix(".ssv"))
    rows = simulate_ssp(
        str(path), stop_time=STOP - step / 2, step_size=step, parameter_set=ssd.read_ssv(str(path.with_suffix(".ssv")))
    )
    return {name: rows[name] for name in NAMES}


PEERS = pytest.mark.parametrize("peer", [in_libcosim, in_ecos, in_fmpy], ids=lambda peer: peer.__name__)


@PEERS
def test_peers_converge_to_the_solution(
    oscillator: Callable[..., System], tmp_path: Path, peer: Callable[[Path, float], Trajectories]
) -> None:
    errors = []
    for step in (1 / 256, 1 / 512):
        oscillator(step).to_ssp(tmp_path / "oscillator.ssp")
        found = peer(tmp_path / "oscillator.ssp", step)["mass.x"]
        times = step * np.arange(1, round(STOP / step) + 1)
        errors.append(np.abs(found - exact(times)).max())
    assert errors[0] < 0.02
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.1)  # explicit coupling is of first order


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.0), (2.0, 0.5)])
@pytest.mark.parametrize("peer", [in_libcosim, in_ecos], ids=lambda peer: peer.__name__)
def test_jacobi_is_the_same_everywhere(
    oscillator: Callable[..., System],
    tmp_path: Path,
    peer: Callable[[Path, float], Trajectories],
    gain: float,
    offset: float,
) -> None:
    step = 1 / 256
    oscillator(step, gain, offset).to_ssp(tmp_path / "oscillator.ssp")
    found, expected = peer(tmp_path / "oscillator.ssp", step), own(oscillator(step, gain, offset))
    for name in ("mass.x", "mass.v"):
        np.testing.assert_allclose(found[name], expected[name], rtol=0, atol=1e-12)


@pytest.mark.parametrize("peer", [in_libcosim, in_ecos], ids=lambda peer: peer.__name__)
def test_peers_transform_connections(
    oscillator: Callable[..., System], tmp_path: Path, peer: Callable[[Path, float], Trajectories]
) -> None:
    step = 1 / 512
    oscillator(step, gain=2.0, offset=0.5).to_ssp(tmp_path / "oscillator.ssp")
    found = peer(tmp_path / "oscillator.ssp", step)["mass.x"]
    times = step * np.arange(1, round(STOP / step) + 1)
    assert np.abs(found - exact(times, 2.0, 0.5)).max() < 0.02
    assert np.abs(found - exact(times)).max() > 0.1  # without the transformation it would be another motion


def test_fmpy_reads_what_is_written(oscillator: Callable[..., System], tmp_path: Path) -> None:
    oscillator(1 / 256).to_ssp(tmp_path / "oscillator.ssp")
    read = ssd.read_ssd(str(tmp_path / "oscillator.ssp"))
    assert read.name == "oscillator"
    units = {unit.name: (unit.kg, unit.m, unit.s, unit.factor) for unit in read.units}
    assert units["N"] == (1, 1, -2, 1.0)
    assert {(c.startElement, c.startConnector, c.endElement, c.endConnector) for c in read.system.connections} == {
        ("mass", "v", "friction", "v"),
        ("friction", "F", "mass", "F_friction"),
    }
    mass, friction = ssd.find_components(read.system)
    assert (mass.source, friction.source) == ("resources/Mass.fmu", "resources/Viscous.fmu")
    (binding,) = mass.parameterBindings
    (values,) = binding.parameterValues
    found = {parameter.name: (float(parameter.value), parameter.unit) for parameter in values.parameters}
    assert found["k"] == (4.0, "N/m")
