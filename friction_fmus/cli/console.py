"""Output of the commands: text on stdout, progress bars on stderr."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn
from rich.text import Text


def literal_console(**options: Any) -> Console:
    """Return a console that prints text as it is: a path such as ``o[/b].csv`` is no markup, and ``:x:`` no emoji.

    Styled text is made with `styled` or as `rich.text.Text`.

    Parameters
    ----------
    **options
        Of `rich.console.Console`.
    """
    return Console(markup=False, emoji=False, highlight=False, **options)


def styled(*pieces: str | tuple[str, str]) -> Text:
    """Return text of which some pieces have a style: ``styled(("weak", "yellow"), " Fs")``."""
    return Text.assemble(*pieces)


console = literal_console()


def progress_bar(*columns: ProgressColumn, **options: Any) -> Progress:
    """Return a bar on stderr that disappears when done; it shows nothing where stderr is not a terminal.

    Parameters
    ----------
    *columns
        Further columns, before the time that remains.
    **options
        Of `rich.progress.Progress`.
    """
    screen = literal_console(stderr=True)
    first = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn())
    shown = (*first, *columns, TimeRemainingColumn())
    return Progress(*shown, console=screen, transient=True, disable=not screen.is_terminal, **options)


class RunBar:
    """A run's progress on such a bar."""

    def __init__(self, bar: Progress, description: str) -> None:
        """Add a task to the bar."""
        self._bar = bar
        self._task = bar.add_task(description, total=None)

    def update(self, done: int, total: int) -> None:
        """Called by the harness."""
        self._bar.update(self._task, completed=done, total=total)
