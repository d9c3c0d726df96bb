"""Progress of a sweep."""

from __future__ import annotations

from rich.progress import Progress, ProgressColumn, Task
from rich.text import Text

from friction_fmus.cli.console import progress_bar


class _Rate(ProgressColumn):
    """Runs per second."""

    def render(self, task: Task) -> Text:
        """Return the rate; empty until it is known."""
        return Text(f"{task.speed:.3g} runs/s" if task.speed else "")


class SweepBar:
    """Progress of a sweep on a progress bar."""

    def __init__(self, bar: Progress) -> None:
        """Add a task to the bar."""
        self._bar = bar
        self._task = bar.add_task("sweep", total=None)

    def update(self, done: int, total: int) -> None:
        """Show the progress; runs cached by an earlier call do not count for the rate."""
        if self._bar.tasks[0].total is None:
            self._bar.reset(self._task, completed=done, total=total)
        self._bar.update(self._task, completed=done, total=total)


def sweep_progress() -> Progress:
    """Return the progress bar of a sweep."""
    return progress_bar(_Rate(), speed_estimate_period=60)
