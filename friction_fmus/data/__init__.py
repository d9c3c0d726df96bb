"""Measured records included in the package, each with its citation."""

import lzma
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import scipy.io

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.record import Record

__all__ = ["EMPS_PUBLISHED", "load_emps", "load_tribometer"]

#: Published parameters [kg, N.s/m, N, N] (Janot, Gautier, Brunot 2019).
EMPS_PUBLISHED: Mapping[str, float] = MappingProxyType({"M": 95.1089, "Fv": 203.5034, "Fc": 20.3935, "OF": -3.1648})

EMPS_CITATION = (
    "A. Janot, M. Gautier, M. Brunot: Data Set and Reference Models of EMPS. "
    "2019 Workshop on Nonlinear System Identification Benchmarks, Eindhoven. nonlinearbenchmark.org"
)


def load_emps(path: Path | None = None) -> Record:
    """Load the EMPS record.

    Parameters
    ----------
    path : Path, optional
        Copy of ``DATA_EMPS.mat`` to read instead of the one in the package.

    Returns
    -------
    Record
        24841 samples at 1 kHz: time [s], position [m], reference [m] and force ``gtau * vir`` [N].

    Raises
    ------
    RecordError
        If the file is missing, is not a MATLAB file or lacks a variable.

    Notes
    -----
    Source: Janot, Gautier, Brunot 2019. The README beside the file lists the variables and the authors' terms. The
    servo, whose settings the study ``emps`` has, computes the velocity from averaged positions, qb[k] = (q[k] +
    q[k-1])/2 and v[k] = (qb[k] - qb[k-1])/Ts, which equals (q[k] - q[k-2])/(2 Ts): ``window = 2``.
    """
    file = Path(__file__).parent / "emps" / "DATA_EMPS.mat" if path is None else Path(path)
    names = ("t", "qm", "qg", "vir", "gtau")
    if not file.is_file():
        raise RecordError(f"There is no file {file}; give the path of DATA_EMPS.mat or reinstall the package.")
    try:
        content = scipy.io.loadmat(file, variable_names=names)
    except Exception as error:  # a damaged file may raise any exception in scipy
        raise RecordError(f"{file} cannot be read as a MATLAB file ({error}); download DATA_EMPS.mat again.") from error
    missing = [name for name in names if name not in content]
    if missing:
        raise RecordError(
            f"{file} has no variable {', '.join(missing)}; it is not DATA_EMPS.mat of the EMPS benchmark."
        )
    t, qm, qg, vir = (np.asarray(content[name], dtype=np.float64).ravel() for name in names[:4])
    gtau = float(np.asarray(content["gtau"]).item())
    return Record("EMPS", t=t, q=qm, reference=qg, force=gtau * vir, citation=EMPS_CITATION)


TRIBOMETER_CITATION = (
    "J. Christopherson and contributors: FrictionModels.jl. github.com/jchristopherson/FrictionModels.jl (MIT)"
)

#: Normal force at and above which the contact counts as loaded [N].
LOADED = 4.9


def load_tribometer(path: Path | None = None) -> Record:
    """Load the tribometer record, while the contact is loaded.

    Parameters
    ----------
    path : Path, optional
        Copy of ``reciprocating.txt``, plain or compressed with xz, to read instead of the one in the package.

    Returns
    -------
    Record
        40418 samples at 200 Hz, from 7.7 to 209.8 s: time [s], position [m], friction [N], positive for a positive
        velocity, and normal force [N], about 5 N.

    Raises
    ------
    RecordError
        If the file is missing or is not that table.

    Notes
    -----
    The README beside the file states source (J. Christopherson, FrictionModels.jl), units and licence.
    """
    file = Path(__file__).parent / "tribometer" / "reciprocating.txt.xz" if path is None else Path(path)
    if not file.is_file():
        raise RecordError(f"There is no file {file}; give the path of reciprocating.txt or reinstall the package.")
    try:
        with lzma.open(file, "rt") if file.suffix == ".xz" else file.open(encoding="utf-8") as text:
            table = np.loadtxt(text, skiprows=1, delimiter="\t")
        t, normal, position, friction = table.T
    except (ValueError, OSError, EOFError, lzma.LZMAError) as error:
        raise RecordError(f"{file} cannot be read as the tribometer's table ({error}); download it again.") from error
    loaded = np.flatnonzero(normal * 1e-6 >= LOADED)
    if loaded.size == 0:
        raise RecordError(f"The normal force in {file} never reaches {LOADED} N; this is not the tribometer's record.")
    rows = slice(loaded[0], loaded[-1] + 1)
    return Record(
        "tribometer",
        t=t[rows],
        q=1e-3 * position[rows],
        friction=-1e-6 * friction[rows],
        normal=1e-6 * normal[rows],
        citation=TRIBOMETER_CITATION,
    )
