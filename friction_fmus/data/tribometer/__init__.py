"""The tribometer record: a reciprocating contact, mostly in presliding (J. Christopherson, FrictionModels.jl)."""

from __future__ import annotations

import lzma
from pathlib import Path

import numpy as np

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.record import Record

CITATION = "J. Christopherson and contributors: FrictionModels.jl. github.com/jchristopherson/FrictionModels.jl (MIT)"

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
    file = Path(__file__).with_name("reciprocating.txt.xz") if path is None else Path(path)
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
        citation=CITATION,
    )
