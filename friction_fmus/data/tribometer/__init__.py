"""The tribometer record: a reciprocating contact, rich in presliding (J. Christopherson, FrictionModels.jl)."""

from __future__ import annotations

import lzma
from pathlib import Path

import numpy as np

from friction_fmus.identification.data.record import Record
from friction_fmus.identification.errors import RecordError

CITATION = "J. Christopherson and contributors: FrictionModels.jl. github.com/jchristopherson/FrictionModels.jl (MIT)"

#: Normal force from which on the contact counts as loaded [N].
LOADED = 4.9


def load_tribometer(path: Path | None = None) -> Record:
    """Load the tribometer record, from where the contact is loaded to where it is unloaded.

    Parameters
    ----------
    path : Path, optional
        Another copy of ``reciprocating.txt``, compressed with xz or not; without it the one in the package is read.

    Returns
    -------
    Record
        40418 samples at 200 Hz, 7.7 to 209.8 s: time [s], position [m], friction [N] with the sign of this project,
        normal force [N], about 5 N.

    Raises
    ------
    RecordError
        The file is missing or is not that table.

    Notes
    -----
    Source, units and licence: the README beside the file.
    """
    file = Path(__file__).with_name("reciprocating.txt.xz") if path is None else Path(path)
    if not file.is_file():
        raise RecordError(f"There is no file {file}; give the path of reciprocating.txt or reinstall the package.")
    try:
        with lzma.open(file, "rt") if file.suffix == ".xz" else file.open(encoding="utf-8") as text:
            table = np.loadtxt(text, skiprows=1, delimiter="\t")
        t, normal, position, friction = table.T
    except (ValueError, OSError, EOFError, lzma.LZMAError) as error:
        raise RecordError(f"{file} cannot be read as the tribometer's table ({error}); fetch it again.") from error
    loaded = np.flatnonzero(normal * 1e-6 >= LOADED)
    if loaded.size == 0:
        raise RecordError(f"The contact in {file} is never loaded with {LOADED} N; it is not the tribometer's record.")
    rows = slice(loaded[0], loaded[-1] + 1)
    return Record(
        "tribometer",
        t=t[rows],
        q=1e-3 * position[rows],
        friction=-1e-6 * friction[rows],
        normal=1e-6 * normal[rows],
        citation=CITATION,
    )
