"""Findings about a record that limit the reliability of its parameters, each with advice on what to measure."""

from __future__ import annotations

from dataclasses import dataclass


class RecordWarning(UserWarning):
    """Warning about a problem in a record; the text starts with the name of the finding."""


@dataclass(frozen=True)
class Finding:
    """Finding about a record.

    Attributes
    ----------
    name : str
        Stable name, such as ``no-reversal``.
    what : str
        Description with numbers, in one sentence.
    measure : str
        Advice on what to measure or change, in one sentence.
    """

    name: str
    what: str
    measure: str

    def __str__(self) -> str:
        """Return the finding in one line."""
        return f"{self.name}: {self.what} {self.measure}"
