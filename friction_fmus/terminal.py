"""What the commands show: text on stdout, a progress bar on stderr."""

from __future__ import annotations

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

console = Console()


def progress_bar() -> Progress:
    """A bar on stderr that disappears when done; nothing where the output is not a terminal."""
    screen = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal)


class RunBar:
    """A run's progress on such a bar."""

    def __init__(self, bar: Progress, description: str) -> None:
        """Add it to the bar."""
        self._bar = bar
        self._task = bar.add_task(description, total=None)

    def update(self, done: int, total: int) -> None:
        """Called by the harness."""
        self._bar.update(self._task, completed=done, total=total)
