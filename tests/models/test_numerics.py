"""Numerical methods and constants stand in fmu_src/numerics only."""

from __future__ import annotations

import re
import zipfile
from collections import Counter
from pathlib import Path

import numpy as np

from friction_fmus import build
from friction_fmus.blocks.catalogue import source_folder

NUMERICS = source_folder() / "numerics"
C_FILES = sorted(source_folder().rglob("*.[ch]"))
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
