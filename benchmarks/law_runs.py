"""A law three ways over the same samples: as FMU, as exported C, in casadi's virtual machine."""

from __future__ import annotations

import ctypes
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import casadi
import fmpy
import numpy as np

from friction_fmus import build
from friction_fmus.codegen.layout import INPUTS, STATES, Export, is_flag
from friction_fmus.codegen.sources import header, implementation
from friction_fmus.lawkit.law import BOOLEANS, VECTORS, Kind, Law, LawVariable
from harness.compiling.toolchain import FLAGS, compiler, header_folder

Columns = Mapping[str, np.ndarray]


def compile_(source: Path, *others: str) -> ctypes.CDLL:
    """A shared library with the flags of the FMUs, and other flags or files."""
    target = source.with_suffix(".so")
    plain = [flag for flag in FLAGS if flag not in ("-std=c99", "-Werror")]  # dlopen and clock_gettime
    command = [*compiler(), "-std=gnu99", *plain, "-fvisibility=default", "-Wno-missing-prototypes"]
    files = [str(source), "-o", str(target), *others, "-shared", "-lm"]
    subprocess.run([*command, "-I", str(header_folder()), *files], check=True)
    return ctypes.CDLL(str(target))


def pointer(array: np.ndarray) -> ctypes.c_void_p:
    """To its first element."""
    return ctypes.c_void_p(array.ctypes.data)


def _loops(folder: Path) -> Path:
    """law_loops.c where it may be compiled."""
    copy = folder / "law_loops.c"
    copy.write_text((Path(__file__).parent / "law_loops.c").read_text(encoding="utf-8"), encoding="utf-8")
    return copy


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
        self.run_law = compile_(_loops(folder), "-ldl").run_law
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
            *(*list_(reals), pointer(real_rows), *list_(booleans), pointer(boolean_rows)),
            *(*list_(results), pointer(found), ctypes.c_long(n), ctypes.c_double(float(ts))),
        )
        if total < 0.0:
            raise SystemExit(f"The FMU of {self.law.name} does not run through")
        return found, float(total)


def local(places: Sequence[str]) -> list[str]:
    """Places behind pointers as places in variables of the same names."""
    return [place.replace("->", ".") for place in places]


def _driver(export: Export, step: str, others: Sequence[Path]) -> str:
    """C that runs rows of all variables, or of the inputs with the states fed back, and one that only takes the time.

    The compiler must not know the parameters: they are set through a pointer that it cannot follow.
    """
    p, groups = export.prefix, export.groups
    arguments = f"const {p}_parameters *, {p}_states *, const {p}_inputs *, {p}_outputs *"

    def assigned(variable: LawVariable, places: Sequence[str], source: str, first: int) -> list[str]:
        begin, end = ("", " != 0.0") if is_flag(variable) else (f"({export.real.name})", "")
        highs = [f"            {place} = {begin}{source}[{first + i}]{end};" for i, place in enumerate(places)]
        return highs + [
            f"            {low} = (float)({source}[{first + i}] - (double){place});"
            for i, (place, low) in enumerate(zip(places, local(export.lows(variable)), strict=False))
        ]

    def assignments(source: str, *, inputs: bool) -> list[str]:
        first, lines = 0, []
        for variable in export.law.given:
            places = local(export.places(variable))
            if (variable in groups["inputs"]) == inputs:
                lines += assigned(variable, places, source, first)
            first += len(places)
        return lines

    def compact() -> list[str]:
        return [
            line
            for i, variable in enumerate(groups["inputs"])
            for line in assigned(variable, [f"inputs.{variable.name}"], "row", i)
        ]

    def shown() -> list[str]:
        """Results, of pairs the sum."""
        lines = []
        for variable in export.law.results:
            places, lows = local(export.places(variable)), local(export.lows(variable))
            lines += [f"(double){a} + (double){b}" for a, b in zip(places, lows, strict=True)] if lows else places
        return lines

    width, count = sum(len(v.starts) for v in export.law.given), len(export.results)
    variables = [f"    {p}_{group} {group};" for group in groups]
    set_up = f"    start(&{', &'.join(groups)});"
    return "\n".join(
        [
            f'#include "{p}.c"',
            *(f'#include "{path}"' for path in others),
            "#include <time.h>",
            f"static void (*volatile start)({p}_parameters *, {p}_states *, {p}_inputs *, {p}_outputs *) = {p}_init;",
            f"static void (*volatile step)({arguments}) = {step};",
            "static volatile double sink;",
            "static double seconds(void)",
            "{",
            "    struct timespec now;",
            "    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);",
            "    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;",
            "}",
            "void run(long n, int feeds_back, const double *given, double *results)",
            "{",
            *variables,
            set_up,
            f"    for (long k = 0; k < n; k++, given += {width}, results += {count}) {{",
            *assignments("given", inputs=True),
            "            if (!feeds_back) {",
            *assignments("given", inputs=False),
            "            }",
            "            step(&parameters, &states, &inputs, &outputs);",
            *(f"            results[{i}] = {text};" for i, text in enumerate(shown())),
            "    }",
            "}",
            "double cost(long n, long times, const double *given)",
            "{",
            *variables,
            "    double sum = 0.0;",
            set_up,
            "    const double begin = seconds();",
            "    for (long j = 0; j < times; j++) {",
            f"        for (const double *row = given; row < given + {len(groups['inputs'])} * n;"
            f" row += {len(groups['inputs'])}) {{",
            *compact(),
            "            step(&parameters, &states, &inputs, &outputs);",
            f"            sum += (double)outputs.{groups['outputs'][0].name};",
            "        }",
            "    }",
            "    sink = sum;",
            "    return seconds() - begin;",
            "}",
            "",
        ]
    )


class LawC:
    """The exported C of a law, or a C function that takes its place.

    Parameters
    ----------
    export : Export
        The law.
    folder : Path
        Where to compile.
    step : str, optional
        Another function of the same arguments than the exported one.
    source : Path, optional
        C file with that function; it may use the structs.
    flags : sequence of str
        Of the compiler, after its usual ones.
    """

    def __init__(
        self,
        export: Export,
        folder: Path,
        *,
        step: str = "",
        source: Path | None = None,
        flags: Sequence[str] = (),
    ) -> None:
        """Compile it."""
        self.export = export
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{export.prefix}.h").write_text(header(export), encoding="utf-8")
        law = folder / f"{export.prefix}.c"
        law.write_text(implementation(export), encoding="utf-8")
        driver = folder / "driver.c"
        text = _driver(export, step or f"{export.prefix}_step", [source] if source else [])
        driver.write_text(text, encoding="utf-8")
        library = compile_(driver, *flags)
        self._run, self._cost = library.run, library.cost
        self._cost.restype = ctypes.c_double

    def run(self, rows: np.ndarray, *, feeds_back: bool) -> np.ndarray:
        """Outputs and next states of every sample.

        Parameters
        ----------
        rows : float64 array, shape (n, arguments of the law)
            Values of what a sample reads; of these only the inputs if it feeds back.
        feeds_back : bool
            The states go on from sample to sample, parameters stay at their start.
        """
        rows = np.ascontiguousarray(rows, dtype=float)
        found = np.full((len(rows), len(self.export.results)), np.nan)
        self._run(ctypes.c_long(len(rows)), int(feeds_back), pointer(rows), pointer(found))
        return found

    def cost(self, given: Columns, times: int = 1) -> float:
        """Seconds of a sample, with its inputs set and its states fed back; no more than that is done.

        Parameters
        ----------
        given : mapping of str to array, shape (n,)
            Inputs.
        times : int
            How often to go through them.
        """
        rows = np.ascontiguousarray(np.array([given[v.name] for v in self.export.groups["inputs"]], dtype=float).T)
        n = len(rows)
        return float(self._cost(ctypes.c_long(n), ctypes.c_long(times), pointer(rows))) / (n * times)


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


class LawBuffer:
    """A law in casadi's virtual machine through its buffer interface.

    Parameters
    ----------
    export : Export
        The law.
    folder : Path
        Where to compile the loop that calls it.
    """

    def __init__(self, export: Export, folder: Path) -> None:
        """Set up the buffer, with everything at its start."""
        law = export.law
        labels = [variable for variable in law.given for _ in variable.starts]
        self._arguments = np.array([start for v in law.given for start in export.start[v.name]], dtype=float)
        self._results = np.zeros(law.function.n_out())
        self._buffer, self._evaluate = law.function.buffer()
        for i in range(self._arguments.size):
            self._buffer.set_arg(i, memoryview(self._arguments[i : i + 1]))
        for i in range(self._results.size):
            self._buffer.set_res(i, memoryview(self._results[i : i + 1]))
        self._inputs = np.array([i for i, v in enumerate(labels) if v.kind in INPUTS], dtype=np.int64)
        self._states = np.array([i for i, v in enumerate(labels) if v.kind in STATES], dtype=np.int64)
        self._names = [labels[i].name for i in self._inputs]
        self._first_state = len(law.select(Kind.OUTPUT))
        folder.mkdir(parents=True, exist_ok=True)
        self._run = compile_(_loops(folder), "-ldl").run_buffer
        self._run.restype = ctypes.c_double

    def from_c(self, given: Columns) -> float:
        """Seconds of a sample, with inputs set and states fed back, in a loop in C: no Python in it."""
        rows = np.ascontiguousarray(np.array([given[name] for name in self._names], dtype=float).T)
        # what casadi's C++ calls _function_buffer_eval(void *), and what Python's call of the buffer comes down to
        library = ctypes.CDLL(casadi._casadi.__file__)
        capsule = ctypes.pythonapi.PyCapsule_GetPointer
        capsule.restype, capsule.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
        total = self._run(
            ctypes.cast(library._ZN6casadi21_function_buffer_evalEPv, ctypes.c_void_p),
            *(ctypes.c_void_p(capsule(self._buffer._self(), None)), pointer(self._arguments), pointer(self._results)),
            *(pointer(self._inputs), ctypes.c_long(self._inputs.size)),
            *(pointer(self._states), ctypes.c_long(self._states.size), ctypes.c_long(self._first_state)),
            *(pointer(rows), ctypes.c_long(len(rows))),
        )
        return float(total) / len(rows)

    def from_python(self, given: Columns, times: int = 20) -> float:
        """Seconds of a call from Python, the mean of these inputs; setting them and the states is not in it."""
        evaluate, total, n = self._evaluate, 0.0, len(next(iter(given.values())))
        for i in range(n):
            self._arguments[self._inputs] = [given[name][i] for name in self._names]
            begin = time.thread_time()
            for _ in range(times):
                evaluate()
            total += time.thread_time() - begin
            self._arguments[self._states] = self._results[self._first_state :]
        return total / (n * times)


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
