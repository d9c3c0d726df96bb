"""What to know about a record before its parameters are believed: named findings, each with what to measure next."""

from __future__ import annotations

from dataclasses import dataclass


class RecordWarning(UserWarning):
    """A record was read, but something about it should be known; the text begins with the name of the finding."""


@dataclass(frozen=True)
class Finding:
    """One thing to know about a record.

    Attributes
    ----------
    name : str
        Stable name, such as ``no-reversal``.
    what : str
        What was found, with numbers; one sentence.
    measure : str
        What to measure or to change; one sentence.
    """

    name: str
    what: str
    measure: str

    def __str__(self) -> str:
        """The finding in one line."""
        return f"{self.name}: {self.what} {self.measure}"
