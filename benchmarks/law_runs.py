"""A law three ways over the same samples: as FMU, as exported C, in casadi's virtual machine."""

from __future__ import annotations

import ctypes
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import fmpy
import numpy as np

from friction_fmus import build
from friction_fmus.codegen.sources import INPUTS, STATES, Export, header, implementation
from friction_fmus.law import BOOLEANS, VECTORS, Kind, Law, Variable
from harness.toolchain import FLAGS, compiler, header_folder

Columns = Mapping[str, np.ndarray]


def _compile(source: Path, *flags: str) -> ctypes.CDLL:
    """A shared library with the flags of the FMUs."""
    target = source.with_suffix(".so")
    plain = [flag for flag in FLAGS if flag not in ("-std=c99", "-Werror")]  # dlopen and clock_gettime
    command = [*compiler(), "-std=gnu99", *plain, "-fvisibility=default", "-Wno-missing-prototypes", *flags]
    subprocess.run([*command, "-I", str(header_folder()), str(source), "-o", str(target), "-shared", "-lm"], check=True)
    return ctypes.CDLL(str(target))


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


class LawFmu:
    """The FMU of a law of the catalogue.

    Parameters
    ----------
    law : Law
        The law.
    folder : Path
        Where to compile.
    """

    def __init__(self, law: Law, folder: Path) -> None:
        """Build it."""
        fmu = build(law.name, folder)
        self.law = law
        self.description = fmpy.read_model_description(str(fmu))
        unzipped = Path(fmpy.extract(str(fmu), str(folder / f"{law.name}.unzipped")))
        self.path = unzipped / "binaries" / fmpy.platform / f"{law.name}{fmpy.sharedLibraryExtension}"
        loops = folder / "law_loops.c"
        loops.write_text((Path(__file__).parent / "law_loops.c").read_text(encoding="utf-8"), encoding="utf-8")
        self.run_law = _compile(loops, "-ldl").run_law
        self.run_law.restype = ctypes.c_double

    def run(self, given: Columns) -> tuple[np.ndarray, float]:
        """Outputs and next states of every sample, and the seconds that it took.

        Parameters
        ----------
        given : mapping of str to array, shape (n,)
            Inputs.
        """
        reference = {v.name: v.valueReference for v in self.description.modelVariables}
        inputs = self.law.select(*INPUTS)
        reals = [v.name for v in inputs if v.kind not in BOOLEANS]
        booleans = [v.name for v in inputs if v.kind in BOOLEANS]
        results = [
            f"{v.name}[{i + 1}]" if v.kind in VECTORS else v.name
            for v in self.law.results
            for i in range(len(v.starts))
        ]
        n = len(next(iter(given.values())))
        real_rows = np.ascontiguousarray(np.array([given[name] for name in reals], dtype=float).reshape(-1, n).T)
        boolean_rows = np.ascontiguousarray(
            np.array([given[name] for name in booleans], dtype=np.int32).reshape(-1, n).T
        )
        found = np.full((n, len(results)), np.nan)

        def list_(names: Sequence[str]) -> tuple[object, ctypes.c_size_t]:
            return (ctypes.c_uint * len(names))(*(reference[name] for name in names)), ctypes.c_size_t(len(names))

        ts = next(v.start for v in self.law.variables if v.kind is Kind.SAMPLE_TIME)
        total = self.run_law(
            *(str(self.path).encode(), self.description.guid.encode()),
            *(*list_(reals), _pointer(real_rows), *list_(booleans), _pointer(boolean_rows)),
            *(*list_(results), _pointer(found), ctypes.c_long(n), ctypes.c_double(float(ts))),
        )
        if total < 0.0:
            raise SystemExit(f"The FMU of {self.law.name} does not run through")
        return found, float(total)


def _driver(export: Export) -> str:
    """C that runs rows of all variables, or of the inputs with the states fed back."""
    p = export.prefix
    groups = export.groups

    def place(variable: Variable) -> list[str]:
        return [text.replace("->", ".", 1) for text in export.places(variable)]

    rows = [(variable, text) for variable in export.law.given for text in place(variable)]
    inputs = [
        f"            {text} = ({'int' if v.kind in BOOLEANS else export.real.name})given[{i}];"
        for i, (v, text) in enumerate(rows)
        if v in groups["inputs"]
    ]
    others = [
        f"                {text} = ({'int' if v.kind in BOOLEANS else export.real.name})given[{i}];"
        for i, (v, text) in enumerate(rows)
        if v not in groups["inputs"]
    ]
    results = [
        f"            results[{i}] = (double){text};"
        for i, text in enumerate(text.replace("->", ".") for text in export.results)
    ]
    arguments = f"const {p}_parameters *, {p}_states *, const {p}_inputs *, {p}_outputs *"
    return "\n".join(
        [
            f'#include "{p}.c"',
            "#include <time.h>",
            "/* not inlined: the compiler must not know the parameters */",
            f"static void (*volatile step)({arguments}) = {p}_step;",
            "double run(long n, int feeds_back, const double *given, double *results);",
            "double run(long n, int feeds_back, const double *given, double *results)",
            "{",
            *(f"    {p}_{group} {group};" for group in groups),
            "    struct timespec begin, end;",
            f"    {p}_init(&parameters, &states, &inputs, &outputs);",
            "    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &begin);",
            "    for (long k = 0; k < n; k++) {",
            *inputs,
            "            if (!feeds_back) {",
            *others,
            "            }",
            "            step(&parameters, &states, &inputs, &outputs);",
            *results,
            f"            given += {len(rows)};",
            f"            results += {len(results)};",
            "    }",
            "    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &end);",
            "    return (double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec);",
            "}",
            "",
        ]
    )


class LawC:
    """The exported C of a law.

    Parameters
    ----------
    export : Export
        The law.
    folder : Path
        Where to compile.
    """

    def __init__(self, export: Export, folder: Path) -> None:
        """Compile it."""
        self.export = export
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{export.prefix}.h").write_text(header(export), encoding="utf-8")
        (folder / f"{export.prefix}.c").write_text(implementation(export), encoding="utf-8")
        source = folder / "driver.c"
        source.write_text(_driver(export), encoding="utf-8")
        self._run = _compile(source).run
        self._run.restype = ctypes.c_double

    def run(self, rows: np.ndarray, *, feeds_back: bool) -> tuple[np.ndarray, float]:
        """Outputs and next states of every sample, and the seconds that it took.

        Parameters
        ----------
        rows : float64 array, shape (n, arguments of the law)
            Values of what a sample reads; of these only the inputs if it feeds back.
        feeds_back : bool
            The states go on from sample to sample, parameters stay at their start.
        """
        rows = np.ascontiguousarray(rows, dtype=float)
        found = np.full((len(rows), len(self.export.results)), np.nan)
        total = self._run(ctypes.c_long(len(rows)), int(feeds_back), _pointer(rows), _pointer(found))
        return found, float(total)


def rows_of(export: Export, given: Columns) -> np.ndarray:
    """Rows of all that a sample reads: these inputs, everything else at its start."""
    n = len(next(iter(given.values())))
    columns = []
    for variable in export.law.given:
        if variable.name in given:
            columns.append(given[variable.name])
        else:
            columns += [np.full(n, start) for start in export.start[variable.name]]
    return np.array(columns, dtype=float).T


def run_casadi(law: Law, rows: np.ndarray) -> np.ndarray:
    """The rows by casadi, the states fed back: results of every sample."""
    buffer, evaluate = law.function.buffer()
    given, result = rows[0].copy(), np.zeros(law.function.n_out())
    for i in range(given.size):
        buffer.set_arg(i, memoryview(given[i : i + 1]))
    for i in range(result.size):
        buffer.set_res(i, memoryview(result[i : i + 1]))
    labels = [variable for variable in law.given for _ in variable.starts]
    states = [i for i, variable in enumerate(labels) if variable.kind in STATES]
    first_next = len(law.select(Kind.OUTPUT))
    found = np.empty((len(rows), result.size))
    state = given[states]
    for row, target in zip(rows, found, strict=True):
        given[:] = row
        given[states] = state
        evaluate()
        target[:] = result
        state = result[first_next:].copy()
    return found


def casadi_by_rows(law: Law, rows: np.ndarray) -> tuple[np.ndarray, float]:
    """The rows by casadi's virtual machine as they are: results of every sample, and the seconds, without Python."""
    buffer, evaluate = law.function.map(len(rows)).buffer()
    columns = [np.ascontiguousarray(column) for column in rows.T]
    results = [np.zeros(len(rows)) for _ in range(law.function.n_out())]
    for i, column in enumerate(columns):
        buffer.set_arg(i, memoryview(column))
    for i, column in enumerate(results):
        buffer.set_res(i, memoryview(column))
    begin = time.thread_time()
    evaluate()
    return np.array(results).T, time.thread_time() - begin
