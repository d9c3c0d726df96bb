"""The figures of a study, as plain data."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from rich.table import Table

from .metrics import Agreement


@dataclass(frozen=True)
class Identified:
    """One identified parameter.

    Attributes
    ----------
    value, standard_error : float
        Estimate and its standard error, in `unit`; the error is nan where the parameter was chosen.
    unit : str
        Unit.
    published : float or None
        Value in the literature, in `unit`.
    meaning : str
        What the parameter is.
    """

    value: float
    standard_error: float
    unit: str
    published: float | None
    meaning: str

    @property
    def deviation_percent(self) -> float | None:
        """Difference from the published value in percent of it."""
        if not self.published:
            return None
        return 100.0 * (self.value - self.published) / abs(self.published)


@dataclass(frozen=True)
class Tracking:
    """Tracking error of one servo with one feedforward.

    Attributes
    ----------
    servo : str
        "as measured" or "with motion feedforward".
    feedforward : str
        "none", "coulomb" or "stribeck": the friction model of the feedforward.
    rms_um, max_um : float
        Root mean square and largest magnitude of reference minus position [um].
    """

    servo: str
    feedforward: str
    rms_um: float
    max_um: float


AS_MEASURED = "as measured"
WITH_MOTION = "with motion feedforward"


@dataclass(frozen=True)
class Compensation:
    """What friction feedforward gains.

    Attributes
    ----------
    rows : tuple of Tracking
        One row for each servo and feedforward.
    """

    rows: tuple[Tracking, ...]

    def rms_um(self, servo: str, feedforward: str) -> float:
        """Tracking error of one row [um]."""
        for row in self.rows:
            if (row.servo, row.feedforward) == (servo, feedforward):
                return row.rms_um
        raise KeyError(f"There is no row for the servo {servo!r} with the feedforward {feedforward!r}.")


@dataclass(frozen=True)
class Summary:
    """Result of a study of one axis.

    Attributes
    ----------
    record : str
        Name of the record.
    citation : str
        Whom to cite.
    identified : mapping of str to Identified
        Inverse model: M, Fv, Fc, OF.
    stribeck : mapping of str to Identified
        Closed-loop fit: M, Fv, Fc, Fs, vs, delta, OF.
    closed_loop : mapping of str to Agreement
        "coulomb" and "stribeck".
    compensation : Compensation
        Tracking errors.
    notes : mapping of str to str
        Settings that the figures depend on, for example the communication step.
    files : tuple of str
        What was written, relative to the output directory.
    """

    record: str
    citation: str
    identified: Mapping[str, Identified]
    stribeck: Mapping[str, Identified]
    closed_loop: Mapping[str, Agreement]
    compensation: Compensation
    notes: Mapping[str, str] = field(default_factory=dict)
    files: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return what `summary.json` contains; a missing number is None."""
        gain = self.compensation

        def without_and_with(servo: str) -> dict[str, float]:
            return {"without": gain.rms_um(servo, "none"), "with": gain.rms_um(servo, "stribeck")}

        content = {
            "record": self.record,
            "citation": self.citation,
            "identified": {name: asdict(parameter) for name, parameter in self.identified.items()},
            "stribeck": {name: asdict(parameter) for name, parameter in self.stribeck.items()},
            "closed_loop": {name: asdict(figures) for name, figures in self.closed_loop.items()},
            "compensation": {
                "tracking_rms_um": without_and_with(AS_MEASURED),
                "tracking_rms_um_with_motion_feedforward": without_and_with(WITH_MOTION),
                "rows": [asdict(row) for row in gain.rows],
            },
            "notes": dict(self.notes),
            "files": list(self.files),
        }
        cleaned = _without_nan(content)
        assert isinstance(cleaned, dict)
        return cleaned

    def to_json(self) -> str:
        """Return `to_dict` as indented JSON text."""
        return json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def summary_table(summary: Summary) -> Table:
    """Return a table of the figures for the terminal."""
    table = Table(title=f"Study of the axis {summary.record}", title_justify="left")
    table.add_column("quantity")
    table.add_column("value", justify="right")
    table.add_column("std. error", justify="right")
    table.add_column("published", justify="right")
    table.add_column("unit")

    def section(title: str, parameters: Mapping[str, Identified]) -> None:
        table.add_row(f"[bold]{title}[/bold]")
        for name, parameter in parameters.items():
            table.add_row(
                f"  {name}",
                number(parameter.value),
                number(parameter.standard_error),
                number(parameter.published),
                parameter.unit if parameter.unit != "1" else "",
            )
        table.add_section()

    section("Inverse model (IDIM-LS)", summary.identified)
    section("Stribeck fit in closed loop", summary.stribeck)
    table.add_row("[bold]Co-simulated minus measured[/bold]")
    for name, figures in summary.closed_loop.items():
        table.add_row(f"  {name}: position, rms", f"{figures.position_rms_um:.3f}", "", "", "µm")
        table.add_row(f"  {name}: force, rms", f"{figures.force_percent:.2f}", "", "", "%")
    table.add_section()
    for servo in dict.fromkeys(row.servo for row in summary.compensation.rows):
        table.add_row(f"[bold]Tracking error, servo {servo}[/bold]")
        for row in summary.compensation.rows:
            if row.servo == servo:
                what = "no friction" if row.feedforward == "none" else row.feedforward
                table.add_row(f"  {what} feedforward", f"{row.rms_um:.2f}", "", "", "µm")
    return table


def number(value: float | None) -> str:
    """Return a number as people read it: four decimals, more where it is small; a dash where there is
    none."""
    if value is None or math.isnan(value):
        return "–"
    if value != 0.0 and abs(value) < 0.1:
        return f"{value:.3g}"
    return f"{value:.4f}"


def _without_nan(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _without_nan(value) for key, value in content.items()}
    if isinstance(content, list):
        return [_without_nan(value) for value in content]
    if isinstance(content, float) and not math.isfinite(content):
        return None
    return content
