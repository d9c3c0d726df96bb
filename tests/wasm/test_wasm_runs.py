"""A run of many steps as one call of a module, compiled for this machine and linked to a body with known motion."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from harness.compiling.toolchain import compiler, header_folder

FOLDER = Path(__file__).parents[2] / "fmu_src" / "wasm"
BODY = r"""
#include <math.h>
/* x' = gain u with u linear in a step, and counters that the run sets before each step. */
typedef struct { double u, rate, gain, x, time; int count, steps, mode, flag; } Body;
static Body body;
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[])
{
    for (size_t k = 0; k < n; k++) {
        *(r[k] == 0 ? &body.u : &body.gain) = v[k];
        body.rate = 0.0;
    }
    return fmi2OK;
}
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                       const fmi2Integer order[], const fmi2Real v[])
{
    for (size_t k = 0; k < n; k++)
        if (order[k] != 1)
            return fmi2Error;
        else if (r[k] == 0)
            body.rate = v[k];
    return fmi2OK;
}
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer v[])
{
    for (size_t k = 0; k < n; k++)
        *(r[k] == 10 ? &body.count : &body.mode) = v[k];
    return fmi2OK;
}
fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Boolean v[])
{
    body.flag = v[0];
    return n == 1 && r[0] == 20 ? fmi2OK : fmi2Error;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[])
{
    for (size_t k = 0; k < n; k++)
        v[k] = r[k] == 1 ? body.x : body.u;
    return fmi2OK;
}
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Integer v[])
{
    for (size_t k = 0; k < n; k++)
        v[k] = r[k] == 10 ? body.count : r[k] == 11 ? body.mode : body.steps;
    return fmi2OK;
}
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Boolean v[])
{
    v[0] = body.flag;
    return n == 1 && r[0] == 20 ? fmi2OK : fmi2Error;
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean unused)
{
    if (t != body.time || body.count < 0)
        return fmi2Error;
    body.x += body.gain * (body.u * h + 0.5 * body.rate * h * h);
    body.time = t + h;
    body.steps++;
    return fmi2OK;
}
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    *state = malloc(sizeof body);
    memcpy(*state, &body, sizeof body);
    return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    memcpy(&body, state, sizeof body);
    return fmi2OK;
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    free(*state);
    *state = NULL;
    return fmi2OK;
}
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String where,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logs)
{
    memset(&body, 0, sizeof body);
    return &body;
}
"""
H = 0.25
INPUTS = (0, 2, 10, 11, 20)
"""References of u and gain (Real), count and mode (Integer), flag (Boolean)."""
OUTPUTS = (1, 0, 12, 10, 11, 20)
"""References of x and u (Real), steps, count and mode (Integer), flag (Boolean)."""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("runs")
    (folder / "body.c").write_text(f'#include "{FOLDER / "wasm.c"}"\n{BODY}', encoding="utf-8")
    flags = ["-shared", "-fPIC", "-O1", "-w", "-isystem", str(header_folder())]
    subprocess.run([*compiler(), *flags, "body.c", "-lm", "-o", "body.so"], cwd=folder, check=True)
    loaded = ctypes.CDLL(str(folder / "body.so"))
    loaded.wasm_instantiate.restype = ctypes.c_void_p
    return loaded


def run(library: ctypes.CDLL, inputs: NDArray[np.float64], *, linear: bool) -> tuple[int, NDArray[np.float64]]:
    """Number of rows computed, and the outputs, a column each; `inputs`: a column each."""
    rows = len(inputs)
    columns = np.ascontiguousarray(inputs.T)
    outputs = np.full((len(OUTPUTS), rows), np.nan)
    counts = (ctypes.c_int * 6)(2, 2, 1, 2, 3, 1)
    references = (ctypes.c_uint * (len(INPUTS) + len(OUTPUTS)))(*INPUTS, *OUTPUTS)
    numbers = ctypes.POINTER(ctypes.c_double)
    body = ctypes.c_void_p(library.wasm_instantiate(b"body", b""))
    done = library.wasm_run(
        body,
        ctypes.c_double(0.0),
        ctypes.c_double(H),
        rows,
        ctypes.c_bool(linear),
        counts,
        references,
        columns.ctypes.data_as(numbers),
        outputs.ctypes.data_as(numbers),
    )
    return int(done), outputs.T


ROWS = np.array([[1.0, 2.0, 3, 4, 1], [2.0, 2.0, 5, 6, 0], [-1.0, 2.0, 7, 8, 1], [0.5, 2.0, 9, 1, 0]])


@pytest.mark.parametrize("linear", [False, True])
def test_each_step_has_the_inputs_of_its_row(library: ctypes.CDLL, linear: bool) -> None:
    """Held or linear to the next row: x is the sum of rectangles or trapezia; all values are exact in binary."""
    done, outputs = run(library, ROWS, linear=linear)
    u = ROWS[:, 0]
    mean = 0.5 * (u[:-1] + u[1:]) if linear else u[:-1]
    before = np.maximum(np.arange(4) - 1, 0)  # a row shows the inputs of the step that ends there
    assert done == 4
    assert outputs[:, 0].tolist() == [0.0, *np.cumsum(2.0 * H * mean)]
    assert outputs[:, 1].tolist() == u[before].tolist()
    assert outputs[:, 2].tolist() == [0, 1, 2, 3]
    assert outputs[:, 3:].tolist() == ROWS[before, 2:].tolist()


def test_a_step_that_fails_ends_the_run_and_returns_to_its_start(library: ctypes.CDLL) -> None:
    """The body refuses a step with a negative count: the third."""
    rows = ROWS.copy()
    rows[2, 2] = -1.0
    done, outputs = run(library, rows, linear=False)
    assert done == 3
    assert outputs[:3, 2].tolist() == [0, 1, 2]
    assert np.isnan(outputs[3]).all()
    x = (ctypes.c_double * 1)()
    library.fmi2GetReal(None, (ctypes.c_uint * 1)(1), ctypes.c_size_t(1), x)
    assert x[0] == 0.0
