"""Numerical methods and constants stand in fmu_src/numerics only, and compute what they say."""

from __future__ import annotations

import ctypes
import re
import subprocess
import zipfile
from collections import Counter
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

from friction_fmus import build
from friction_fmus.blocks.catalogue import source_folder
from harness.compiling.toolchain import compiler

SOURCES = source_folder()
NUMERICS = SOURCES / "numerics"
C_FILES = sorted(SOURCES.rglob("*.[ch]"))
MODELS = [path for path in C_FILES if path.parent != NUMERICS]
PI = re.compile(r"\b(3\.14159|6\.28318|1\.57079|0\.78539)\d*|\bM_PI")


def test_constants_come_from_numerics() -> None:
    own = {path.name for path in MODELS if PI.search(path.read_text(encoding="utf-8"))}
    assert own == set()


def test_headers_have_different_names_as_an_fmu_keeps_them_in_one_folder() -> None:
    names = Counter(path.name for path in C_FILES)
    assert [name for name, count in names.items() if count > 1] == []


def test_an_fmu_carries_only_the_headers_that_it_includes(tmp_path: Path) -> None:
    with zipfile.ZipFile(build("Quantiser", tmp_path)) as archive:
        names = {Path(name).name for name in archive.namelist() if name.startswith("sources/")}
    assert {"Quantiser.c", "block.h", "solver.h"} <= names
    assert names.isdisjoint({"attraction.h", "stribeck.h"})


def tokens(text: str) -> list[str]:
    """The tokens of C without comments and preprocessor lines; all names count as the same."""
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.S)
    text = re.sub(r"^\s*#(?:[^\n]*\\\n)*[^\n]*", "", text, flags=re.M)
    words = ["if", "else", "for", "while", "return", "const", "double", "static", "int", "bool", "void"]
    found = re.findall(r'[A-Za-z_]\w*|\d[\w.]*|"[^"]*"|[^\s\w]', text)
    return ["x" if token[0] in '_"' or (token[0].isalpha() and token not in words) else token for token in found]


def test_no_code_stands_in_two_files() -> None:
    length = 100  # some ten lines; equations that are alike have up to 89
    seen: dict[tuple[str, ...], str] = {}
    twice = set()
    for path in C_FILES:
        found = tokens(path.read_text(encoding="utf-8"))
        for i in range(len(found) - length + 1):
            first = seen.setdefault(tuple(found[i : i + length]), path.name)
            if first != path.name:
                twice.add((first, path.name))
    assert twice == set()


def test_quadrature_is_exact_for_polynomials() -> None:
    """Gauss-Lobatto: the inner nodes are the extrema of P4; row i integrates to node i, the last one degree 7."""
    header = (NUMERICS / "attraction.h").read_text(encoding="utf-8")
    nodes, weights = (
        np.array([float(number) for number in re.findall(r"-?\d+\.\d+", text)])
        for text in re.findall(r"lobatto_\w+(?:\[NODES\])+ = {(.*?)};", header, re.S)
    )
    np.testing.assert_allclose(nodes, [0.0, 0.5 - np.sqrt(3 / 28), 0.5, 0.5 + np.sqrt(3 / 28), 1.0], atol=1e-16)
    for end, row in zip(nodes[1:], weights[1:].reshape(4, 5), strict=True):
        for power in range(8 if end == 1.0 else 5):
            assert abs(row @ nodes**power - end ** (power + 1) / (power + 1)) < 1e-15


CODE = """
#include "asperity.h"
#include "elimination.h"
#include "extrapolation.h"
#include "linear_step.h"
#include "oscillator.h"
#include "splitmix.h"
void swing(double *y, double omega2, double zeta, double a, double t) { ring(&y[0], &y[1], omega2, zeta, a, t); }
uint64_t scrambled(uint64_t counter) { return scramble(counter * GOLDEN + 1234567); }
bool solve(int n, double *a, double *b) { return solve_linear(n, a, b); }
void advance(const double *a, const double *b, const double *c, double *x, double h)
{
    Exponential of;
    exponential(a, h, &of);
    linear_step(&of, b, c, x);
}
static void pull(const void *system, double s, const double *y, double *a)
{
    (void)s;
    a[0] = -y[0] - *(const double *)system * (y[0] - y[1]);
    a[1] = -y[1] - *(const double *)system * (y[1] - y[0]);
}
bool move(double *y, double k, double h)
{
    double left = 1e6, inner = 0.0;
    const Dynamics d = {pull, &k, 2, sqrt(1.0 + 2.0 * k), CHAIN_TOLERANCE, &left};
    return move_masses(&d, y, h, &inner);
}
void slip(const double *surface, double p, double *found)
{
    const Surface f = {surface[0], surface[1], surface[2], surface[3], surface[4], surface[5]};
    const Slip forwards = {&f, 0.0, 0.0, 1}, backwards = {&f, 0.0, 0.0, -1};
    const Taylor of[] = {ahead(&forwards, p), instability(&forwards, p),
                         ahead(&backwards, -p), instability(&backwards, -p)};
    for (int i = 0; i < 4; i++) {
        found[3 * i] = of[i].value;
        found[3 * i + 1] = of[i].slope;
        found[3 * i + 2] = of[i].bend;
    }
}
"""
BESIDE = -77.0


@pytest.fixture(scope="module", params=[2])
def numerics(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """With this number of states of linear equations."""
    folder = tmp_path_factory.mktemp("numerics")
    (folder / "numerics.c").write_text(CODE, encoding="utf-8")
    flags = [
        "-std=c99",
        "-O1",
        "-shared",
        "-fPIC",
        f"-I{NUMERICS}",
        f"-I{SOURCES / 'friction'}",
        f"-DLINEAR_STATES={request.param}",
    ]
    flags += ["-ftrivial-auto-var-init=pattern"]  # what is not set is no number
    subprocess.run([*compiler(), *flags, "numerics.c", "-lm", "-o", "numerics.so"], cwd=folder, check=True)
    loaded = ctypes.CDLL(str(folder / "numerics.so"))
    numbers = np.ctypeslib.ndpointer(float, flags="C")
    loaded.scrambled.restype = ctypes.c_uint64
    loaded.scrambled.argtypes = (ctypes.c_uint64,)
    loaded.swing.argtypes = (numbers, *[ctypes.c_double] * 4)
    loaded.move.restype = ctypes.c_bool
    loaded.move.argtypes = (numbers, ctypes.c_double, ctypes.c_double)
    loaded.solve.restype = ctypes.c_bool
    loaded.solve.argtypes = (ctypes.c_int, numbers, numbers)
    loaded.slip.argtypes = (numbers, ctypes.c_double, numbers)
    loaded.advance.argtypes = (*[numbers] * 4, ctypes.c_double)
    return loaded


@pytest.mark.parametrize(("numerics", "n"), [(n, n) for n in (1, 2, 3, 6)], indirect=["numerics"])
def test_linear_equations_with_a_ramp_are_stepped_exactly(numerics: ctypes.CDLL, n: int) -> None:
    """Against the exponential of the matrix [a c b; 0 0 1; 0 0 0] h of scipy; beside x nothing is written."""
    drawn = np.random.default_rng(n)
    a, b, c, x = (drawn.normal(size=shape) for shape in ((n, n), n, n, n))
    whole = np.zeros((n + 2, n + 2))
    whole[:n] = np.column_stack([a, c, b])
    whole[n, n + 1] = 1.0
    for h in (0.0, 1e-3, 0.2, 7.0):
        found = np.array([*x, BESIDE])
        numerics.advance(a, b, c, found, h)
        expected = (expm(whole * h) @ [*x, 0.0, 1.0])[:n]
        np.testing.assert_allclose(found[:n], expected, rtol=0.0, atol=1e-12 * max(1.0, abs(expected).max()))
        assert found[n] == BESIDE


def test_linear_systems_are_solved_with_exchanged_rows(numerics: ctypes.CDLL) -> None:
    a = np.array([[0.0, 2.0, 1.0], [1.0, 0.0, 0.0], [4.0, 1.0, -3.0]])
    b = np.array([7.0, -1.0, 0.5, BESIDE])
    expected = np.linalg.solve(a, b[:3])
    assert numerics.solve(3, np.array([*a.ravel(), BESIDE]), b)
    assert [*b] == pytest.approx([*expected, BESIDE], rel=1e-14)
    for singular in ([[1.0, 2.0], [2.0, 4.0]], [[0.0, 1.0], [0.0, 3.0]], [[np.nan, 1.0], [np.nan, 2.0]]):
        assert not numerics.solve(2, np.array(singular), np.ones(2))


def test_coupled_masses_move_in_their_modes(numerics: ctypes.CDLL) -> None:
    """1 kg each on 1 N/m, with k between them: in phase at 1 rad/s, in opposition at sqrt(1 + 2 k)."""
    k, h, fast = 1.5, 3.0, 2.0
    y = np.array([1.0, 0.5, 0.0, 0.0, BESIDE])
    assert numerics.move(y, k, h)
    slow, other = 0.75 * np.cos(h), 0.25 * np.cos(fast * h)
    slow_rate, other_rate = -0.75 * np.sin(h), -0.25 * fast * np.sin(fast * h)
    expected = [slow + other, slow - other, slow_rate + other_rate, slow_rate - other_rate, BESIDE]
    np.testing.assert_allclose(y, expected, rtol=0.0, atol=1e-10)


def test_random_bits_are_those_of_splitmix64(numerics: ctypes.CDLL) -> None:
    """The first three numbers that its authors' program gives for the seed 1234567."""
    assert [numerics.scrambled(k) for k in (1, 2, 3)] == [6457827717110365317, 3203168211198807973, 9817491932198370423]


@pytest.mark.parametrize("zeta", [0.0, 0.2, 1.0, 3.0])
def test_an_oscillator_on_an_accelerated_base_moves_by_its_exponential(numerics: ctypes.CDLL, zeta: float) -> None:
    omega, a, t = 30.0, -2.0, 0.04
    found = np.array([1e-3, 0.05])
    rates = np.array([[0.0, 1.0, 0.0], [-(omega**2), -2.0 * zeta * omega, a], [0.0, 0.0, 0.0]])
    expected = (expm(rates * t) @ [*found, 1.0])[:2]
    numerics.swing(found, omega**2, zeta, a, t)
    np.testing.assert_allclose(found, expected, rtol=1e-11)


def test_slip_of_an_asperity_has_these_slopes_and_bounds(numerics: ctypes.CDLL) -> None:
    """g(p) = p + N (w' + s mu0)/k_t and -g', derived by casadi; wherever the asperity touches, no bend is larger."""
    h, A, k, k_n, k_t, mu0, x, s = symbols = [
        ca.SX.sym(name) for name in ("h", "A", "k", "k_n", "k_t", "mu0", "x", "s")
    ]
    w = A * ca.cos(k * s * x)
    incline = -A * k * ca.sin(k * s * x)
    g = s * (s * x + k_n * (h + w) * (incline + s * mu0) / k_t)
    rows = []
    for value in (g, -ca.gradient(g, x)):
        slope = ca.gradient(value, x)
        rows += [value, slope, ca.gradient(slope, x)]
    exact = ca.Function("exact", symbols, [ca.vertcat(*rows)])
    drawn, tightest = np.random.default_rng(1), np.zeros(2)
    for _ in range(400):
        size, length = 10.0 ** drawn.uniform(-7.0, -5.0), 10.0 ** drawn.uniform(-6.0, -3.0)
        values = [size * drawn.uniform(-0.5, 2.0), size, 2.0 * np.pi / length, 1e6, 10.0 ** drawn.uniform(4.0, 7.0)]
        surface = np.array([*values, drawn.uniform(0.0, 0.5)])
        for at in length * drawn.uniform(0.0, 1.0, 30):
            if values[0] + size * np.cos(values[2] * at) < 0.0:
                continue
            found = np.empty(12)
            numerics.slip(surface, at, found)
            for side, place in ((1.0, slice(0, 6)), (-1.0, slice(6, 12))):
                expected = np.asarray(exact(*surface, side * at, side)).ravel()
                scale = abs(expected) + 1e-9 * np.array([length, 1.0, 1.0 / length, 1.0, 1.0 / length, 1.0 / length**2])
                assert np.all(abs(found[place] - expected)[[0, 1, 3, 4]] <= 1e-9 * scale[[0, 1, 3, 4]])
                share = abs(expected[[2, 5]]) / found[place][[2, 5]]
                assert np.all(share <= 1.0 + 1e-9)
                tightest = np.maximum(tightest, share)
    assert np.all(tightest > 0.5)
