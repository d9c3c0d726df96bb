"""The package `harness` under another name, so that ``friction_fmus`` is the one name to remember.

The objects are those of `harness`; its submodules are imported by their own names.
"""

from typing import TYPE_CHECKING

import harness as _harness

if TYPE_CHECKING:
    from harness import *  # noqa: F403
else:

    def __getattr__(name: str) -> object:
        return getattr(_harness, name)

    def __dir__() -> list[str]:
        return dir(_harness)


__all__ = _harness.__all__
