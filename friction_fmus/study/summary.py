"""Progress of a study, description of its settings, and entries of its result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from friction_fmus.study.config import StudyConfig
from friction_fmus.study.data import Data
from friction_fmus.study.recommending import shown
from friction_fmus.study.steps import Step
from harness import Progress


@dataclass
class ProgressReporter:
    """Progress of a study from 0 to 1."""

    progress: Progress | None
    done: float = 0.0

    def __call__(self, part: float) -> None:
        """Report that this fraction is done; the reported progress never decreases."""
        self.done = max(self.done, part)
        if self.progress is not None:
            self.progress.update(round(100.0 * self.done), 100)

    def steps(self, begin: float, end: float, count: int) -> Callable[[Step], None]:
        """Return a callback for each of `count` steps between two fractions."""
        done = 0

        def one(step: Step) -> None:
            nonlocal done
            done += 1
            self(begin + (end - begin) * done / max(1, count))

        return one


def overview(config: StudyConfig, data: Data) -> dict[str, str]:
    """Return descriptions of record, servo and settings, by topic."""
    record, servo, wanted = data.longest, config.servo, config.compensation
    length = f"{len(record)} samples at {1e3 * record.Ts:g} ms"
    segments = f"{len(data.records)} segments; the longest has {length}"
    overview = {"record": length if len(data.records) == 1 else segments}

    def span(records: Sequence[Any]) -> str:
        return f"{records[0].t[0]:.4g} to {records[-1].t[-1]:.4g} s"

    overview["training data"] = span(data.train)
    if data.validation:
        overview["validation data"] = span(data.validation)
    for number, finding in enumerate(data.findings, start=1):
        overview[f"finding {number}"] = finding
    if servo is not None:
        gains = ", ".join(f"{name} {value:.5g}" for name, value in servo.gains.items())
        overview["servo"] = (
            f"{servo.law} with {gains}; sample time {1e3 * servo.Ts:g} ms, force limit ±{servo.force_limit:.4g} "
            f"{record.units.force}, velocity over {servo.window} samples, encoder resolution "
            + (shown(servo.quantum, record.units.position) if servo.quantum else "unlimited")
        )
        overview["compensation"] = (
            f"gains {', '.join(f'{gain:g}' for gain in wanted.gains)}, or the bandwidth, with a sensitivity peak of at "
            f"most {wanted.limits.Ms:g} and a delay margin of at least {wanted.limits.delay:g} samples; friction and "
            f"mass {100 * wanted.mismatch:g} % off; the servo "
            + ("has velocity and inertia feedforward" if wanted.motion_feedforward else "is as measured")
        )
    return overview


def identifier(name: str) -> str:
    """Return a valid model identifier made from the name of a record."""
    letters = "".join(letter for letter in name.title() if letter.isascii() and letter.isalnum())
    return letters if letters and letters[0].isalpha() else f"Axis{letters}"
