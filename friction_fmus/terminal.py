"""What the commands share: text on stdout, a progress bar on stderr, options of the form NAME=VALUE."""

from __future__ import annotations

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from friction_fmus.errors import FrictionError

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


def parse_assignment(text: str) -> tuple[str, float | bool]:
    """``NAME=VALUE`` -> name and number or truth value.

    Raises
    ------
    FrictionError
        If it is neither.
    """
    name, equals, value = text.partition("=")
    if equals and value.strip().lower() in ("true", "false"):
        return name.strip(), value.strip().lower() == "true"
    try:
        number = float(value)
    except ValueError:
        equals = ""
    if not equals:
        raise FrictionError(f"--set {text!r} is not NAME=VALUE with a number, true or false as VALUE")
    return name.strip(), number
