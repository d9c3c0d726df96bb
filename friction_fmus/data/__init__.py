"""Measured records included in the package, each with its citation."""

import lzma
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import scipy.io

from friction_fmus.identification.data.record import Record

__all__ = ["EMPS_PUBLISHED", "load_emps", "load_tribometer"]

#: Published parameters [kg, N.s/m, N, N] (Janot, Gautier, Brunot 2019).
EMPS_PUBLISHED: Mapping[str, float] = MappingProxyType({"M": 95.1089, "Fv": 203.5034, "Fc": 20.3935, "OF": -3.1648})

EMPS_CITATION = (
    "A. Janot, M. Gautier, M. Brunot: Data Set and Reference Models of EMPS. "
    "2019 Workshop on Nonlinear System Identification Benchmarks, Eindhoven. nonlinearbenchmark.org"
)


def load_emps() -> Record:
    """Load the EMPS record.

    Returns
    -------
    Record
        24841 samples at 1 kHz: time [s], position [m], reference [m] and force ``gtau * vir`` [N].

    Notes
    -----
    Source: Janot, Gautier, Brunot 2019. The README beside the file lists the variables and the authors' terms. The
    servo, whose settings the study ``emps`` has, computes the velocity from averaged positions, qb[k] = (q[k] +
    q[k-1])/2 and v[k] = (qb[k] - qb[k-1])/Ts, which equals (q[k] - q[k-2])/(2 Ts): ``window = 2``.
    """
    content = scipy.io.loadmat(Path(__file__).parent / "emps" / "DATA_EMPS.mat")
    t, qm, qg, vir = (np.asarray(content[name], dtype=np.float64).ravel() for name in ("t", "qm", "qg", "vir"))
    gtau = float(content["gtau"].item())
    return Record("EMPS", t=t, q=qm, reference=qg, force=gtau * vir, citation=EMPS_CITATION)


TRIBOMETER_CITATION = (
    "J. Christopherson and contributors: FrictionModels.jl. github.com/jchristopherson/FrictionModels.jl (MIT)"
)

#: Normal force at and above which the contact counts as loaded [N].
LOADED = 4.9


def load_tribometer() -> Record:
    """Load the tribometer record, while the contact is loaded.

    Returns
    -------
    Record
        40418 samples at 200 Hz, from 7.7 to 209.8 s: time [s], position [m], friction [N], positive for a positive
        velocity, and normal force [N], about 5 N.

    Notes
    -----
    The README beside the file states source (J. Christopherson, FrictionModels.jl), units and licence.
    """
    with lzma.open(Path(__file__).parent / "tribometer" / "reciprocating.txt.xz", "rt") as text:
        t, normal, position, friction = np.loadtxt(text, skiprows=1, delimiter="\t").T
    loaded = np.flatnonzero(normal * 1e-6 >= LOADED)
    rows = slice(loaded[0], loaded[-1] + 1)
    return Record(
        "tribometer",
        t=t[rows],
        q=1e-3 * position[rows],
        friction=-1e-6 * friction[rows],
        normal=1e-6 * normal[rows],
        citation=TRIBOMETER_CITATION,
    )
