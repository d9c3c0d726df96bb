"""Bias of the parameters by effects that no model of a contact contains: delays and filters of the measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from friction_fmus.identification.data.record import Array
from friction_fmus.identification.fit.search import SearchResult, covariance

#: Factor of the estimated bias, because delays and filters are not its only causes. It is chosen so that intervals of
#: 95 % cover the true parameters of nine in ten simulated axes (`tests/slow/test_intervals.py`).
ALLOWANCE = 3.0


def misfit_variance(found: SearchResult, parts: Sequence[Array], lengths: Sequence[int], G: Array) -> Array:
    """Return the variances by which a misfit widens those of reported values, shape (values,).

    Notes
    -----
    A force that is measured a little later than the motion, and a velocity or an acceleration from filtered
    differences, change the signal in proportion to the first and second time derivatives of its parts. With these
    columns N beside the Jacobian J, the estimates would move by

        d = -(J' P J)^-1 J' P r,   P = 1 - N (N'N)^-1 N'.

    What `ALLOWANCE` d exceeds the increase of the variance is a bias, whose square is added to the variance.
    """
    ends = np.cumsum(lengths)[:-1]
    columns = []
    for part in parts:
        pieces = np.split(part, ends)
        for _ in range(2):
            pieces = [np.gradient(piece) if len(piece) > 1 else np.zeros_like(piece) for piece in pieces]
            column = np.concatenate(pieces)
            columns.append(column / (np.linalg.norm(column) or 1.0))
    size = float(np.linalg.norm(found.J)) or 1.0
    J = np.column_stack([found.J, *(size * column for column in columns)])
    p = found.J.shape[1]
    d = -np.linalg.lstsq(J, found.residual, rcond=1e-7)[0][:p]
    before, _ = covariance(found, lengths)
    after, _ = covariance(replace(found, J=J), lengths)
    more = np.diag(G @ (after[:p, :p] - before) @ G.T)
    bias: Array = np.maximum((ALLOWANCE * G @ d) ** 2 - np.maximum(more, 0.0), 0.0)
    return bias
