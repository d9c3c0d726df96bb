"""What a study says of itself: its settings, its rows, its progress."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from friction_fmus.study.compensators import Choice
from friction_fmus.study.config import StudyConfig
from friction_fmus.study.data import Data
from friction_fmus.study.evaluation import Trial
from friction_fmus.study.records import CompensatorResult
from friction_fmus.study.steps import Job
from harness import Progress


@dataclass
class Teller:
    """Tells the progress, 0 to 1."""

    progress: Progress | None
    told: float = 0.0

    def __call__(self, part: float) -> None:
        """Tell that this part is done; it never goes back."""
        self.told = max(self.told, part)
        if self.progress is not None:
            self.progress.update(round(100.0 * self.told), 100)

    def steps(self, begin: float, end: float, count: int) -> Callable[[Job], None]:
        """To be called after each of `count` pieces between two parts of the whole."""
        done = 0

        def one(job: Job) -> None:
            nonlocal done
            done += 1
            self(begin + (end - begin) * done / max(1, count))

        return one


def overview(config: StudyConfig, data: Data) -> dict[str, str]:
    """Record, servo and settings in words."""
    record, servo, wanted = data.longest, config.servo, config.compensation
    length = f"{len(record)} samples of {1e3 * record.Ts:g} ms"
    overview = {"record": length if len(data.records) == 1 else f"{len(data.records)} pieces, the longest {length}"}

    def span(records: Sequence[Any]) -> str:
        return f"{records[0].t[0]:.4g} to {records[-1].t[-1]:.4g} s"

    overview["fitted"] = span(data.train)
    if data.validation:
        overview["predicted"] = span(data.validation)
    for number, finding in enumerate(data.findings, start=1):
        overview[f"finding {number}"] = finding
    if servo is not None:
        gains = ", ".join(f"{name} {value:.5g}" for name, value in servo.gains.items())
        overview["servo"] = (
            f"{servo.law} with {gains}; every {1e3 * servo.Ts:g} ms, limit ±{servo.force_limit:.4g} "
            f"{record.units.force}, velocity over {servo.window} samples, encoder "
            + (f"{1e9 * servo.quantum:g} n{record.units.position}" if servo.quantum else "exact")
        )
        overview["compensation"] = (
            f"gains {', '.join(f'{gain:g}' for gain in wanted.gains)}; friction and mass of the axis "
            f"±{100 * wanted.mismatch:g} % off in the corners; the servo "
            + ("has feedforward of velocity and inertia" if wanted.motion_feedforward else "is as measured")
        )
    return overview


def compensator_row(
    name: str, summary: str, kind: str, choice: Choice | None, trial: Trial | None, cost_ns: float = 0.0
) -> CompensatorResult:
    """The row of a law, before it is ranked."""
    if trial is None:
        return CompensatorResult(name, summary, kind, False, choice.reason if choice is not None else "")
    failures = [point.failure for point in trial.sweep if point.metrics is None]
    return CompensatorResult(
        name,
        summary,
        kind,
        True,
        failures[0] if trial.metrics is None and failures else "",
        choice.model if choice is not None else "",
        dict(choice.compensator.values) if choice is not None and choice.compensator is not None else {},
        trial.gain,
        trial.metrics,
        trial.sweep,
        trial.corners,
        cost_ns=cost_ns,
        error=trial.error,
    )


def identifier(name: str) -> str:
    """A model identifier from the name of a record."""
    letters = "".join(letter for letter in name.title() if letter.isascii() and letter.isalnum())
    return letters if letters and letters[0].isalpha() else f"Axis{letters}"
