"""The package `harness` as ``friction_fmus.harness``: the same objects. Its submodules are those of `harness`."""

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
