"""Random arguments of laws."""

from __future__ import annotations

import numpy as np

from friction_fmus.lawkit.law import BOOLEANS, Law


def random_arguments(law: Law, n: int, seed: int) -> np.ndarray:
    """Arguments of a law about its start values, Booleans at random, with zeros and coarse values among them."""
    random = np.random.default_rng(seed)
    columns = []
    for variable in law.given:
        for start in variable.starts:
            if variable.kind in BOOLEANS or variable.flag:
                columns.append(random.integers(0, 2, n).astype(float))
                continue
            if variable.tally:
                columns.append(random.integers(0, 3, n).astype(float))
                continue
            size = abs(start) or variable.nominal
            column = start + size * random.normal(size=n) * 10.0 ** random.uniform(-4, 1, n)
            column[random.random(n) < 0.1] = start
            column[random.random(n) < 0.05] = 0.0
            columns.append(np.clip(column, variable.min, variable.max))
    return np.array(columns).T
