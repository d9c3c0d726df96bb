"""Methods of identification from records; each module is a method with the module's name.

A module has the function ``fit(data, loss, starts)``, which returns a `BlockFit`; `free_run` continues another method
and has ``identify_free_run(found)`` instead. The default method of a friction block depends on whether it has states;
its file may state another one (``IDENTIFIED METHOD(name)``).
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

from friction_fmus.errors import FitError, did_you_mean

if TYPE_CHECKING:
    from friction_fmus.identification.fit.block_fit import BlockFit, FitData
    from friction_fmus.identification.fit.contact_model import ContactModel
    from friction_fmus.identification.fit.search import Loss


class Method(Protocol):
    """Interface of a module of this package."""

    def fit(self, data: FitData, loss: Loss, starts: int | None) -> BlockFit:
        """Identify the parameters of a friction block."""


def method_names() -> tuple[str, ...]:
    """Return the names of all methods."""
    return tuple(sorted(path.stem.replace("_", "-") for path in Path(__file__).parent.glob("[a-z]*.py")))


def find_method(model: ContactModel, name: str = "auto") -> tuple[str, Method]:
    """Return name and module of the method of a friction block."""
    natural = model.identified_by.method or ("inverse" if model.static else "output-error")
    if natural not in method_names():
        raise FitError(
            f"the file of {model.name} names the unknown method {natural!r}{did_you_mean(natural, method_names())}"
        )
    if name not in ("auto", natural):
        raise FitError(f"{model.name} is identified with the method {natural!r}, not {name!r}; omit method.")
    return natural, cast(Method, import_module(f"{__name__}.{natural.replace('-', '_')}"))
