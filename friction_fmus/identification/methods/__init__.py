"""Methods of identification from records: one module each, found by its file name.

A module has one function, ``fit(data, loss, starts)``, which returns a `Fit`. A friction block names its method in its
file (``IDENTIFIED METHOD(name)``) if it needs another one than its states suggest.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

from friction_fmus.errors import nearest
from friction_fmus.identification.errors import FitError

if TYPE_CHECKING:
    from friction_fmus.identification.fit.fitting import Fit, FitData
    from friction_fmus.identification.fit.models import ContactModel
    from friction_fmus.identification.fit.search import Loss


class Method(Protocol):
    """What a module of this package has."""

    def fit(self, data: FitData, loss: Loss, starts: int | None) -> Fit:
        """Identify the parameters of a friction block.

        Parameters
        ----------
        data : FitData
            The block and the records.
        loss : str
            Loss function, see `search`.
        starts : int or None
            Number of searches from different points; None: what suits the method.
        """


def method_names() -> tuple[str, ...]:
    """Return the names of the methods."""
    return tuple(sorted(path.stem.replace("_", "-") for path in Path(__file__).parent.glob("[a-z]*.py")))


def find_method(model: ContactModel, name: str = "auto") -> tuple[str, Method]:
    """Return the method of a friction block with its name.

    Parameters
    ----------
    model : ContactModel
        The block.
    name : str
        The method that the user asks for; "auto": the one of the block.

    Raises
    ------
    FitError
        If the block is identified by another method, or names one that does not exist.
    """
    natural = model.identified_by.method or ("inverse" if model.static else "output-error")
    if natural not in method_names():
        raise FitError(
            f"{model.name} names the method {natural!r}, which does not exist{nearest(natural, method_names())}"
        )
    if name not in ("auto", natural):
        raise FitError(f"{model.name} is identified with the method {natural!r}, not {name!r}; omit method.")
    return natural, cast(Method, import_module(f"{__name__}.{natural.replace('-', '_')}"))
