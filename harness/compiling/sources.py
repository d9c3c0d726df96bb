"""C sources as texts by path: where they are, which of them a file includes, and what identifies them."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path


def source_folder() -> Path:
    """Return the folder ``fmu_src``, in a checkout or an installed package."""
    package = Path(__file__).parents[1]
    places = (package.parent / "fmu_src", package.parent / "friction_fmus" / "fmu_src")
    return next(place for place in places if place.is_dir())


def included(unit: str, files: Mapping[str, str]) -> dict[str, str]:
    """Return the text of a file to compile and of the files that it can include."""
    folders = set(re.findall(r'^#include "([^"/]+)/', files[unit], re.M))
    found = (
        {name: text for name, text in files.items() if name.split("/")[0] in folders}
        if folders
        else {name: text for name, text in files.items() if "/" not in name and name.endswith(".h")}
    )
    return {unit: files[unit], **found}


def guid_of(files: Mapping[str, str], *texts: str) -> str:
    """Return a GUID that identifies sources and other texts."""
    digest = hashlib.sha256()
    for text in (*texts, *(part for item in sorted(files.items()) for part in item)):
        digest.update(text.encode() + b"\0")
    digits = digest.hexdigest()
    return "{" + "-".join(digits[a:b] for a, b in ((0, 8), (8, 12), (12, 16), (16, 20), (20, 32))) + "}"
