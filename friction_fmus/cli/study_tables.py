"""The result of a study as text for the terminal."""

from rich.console import Console

from friction_fmus.cli.console import drawn, styled
from friction_fmus.listings import compensator_listing, ladder_listing, model_listing, percent, shown
from friction_fmus.study.study_result import StudyResult
from friction_fmus.study.verification import Verification


def show_study(console: Console, result: StudyResult) -> None:
    """Print models, compensators, recommendation and violated conditions."""
    u = result.units.words
    show_servo(console, result)
    console.print(drawn(model_listing(result)))
    failed = [f"{row.name} ({row.reason})" for row in result.models if row.rank is None]
    if failed:
        console.print(f"Without a rank: {'; '.join(failed)}")
    for model in result.models:
        known = [f"{p.name} {p.value:.6g} ({p.published:.6g})" for p in model.parameters if p.published is not None]
        if known:
            console.print(f"{model.name}, identified ({result.known_as}): {', '.join(known)}")
    console.print()
    if result.ladder:
        console.print(drawn(ladder_listing(result)))
        console.print()
    if result.compensators:
        console.print(drawn(compensator_listing(result)))
        console.print(
            "Tracking error: root mean square of reference minus position over the whole run. Worst case: with "
            f"friction, {u.mass}, delay, encoder and reference changed. Drive {u.force}: only the part above the loop "
            "bandwidth."
        )
        console.print(_numerical(result))
        left = sum(row.metrics is None for row in result.compensators)
        if left:
            console.print(f"{left} compensators do not apply to this axis; the report states the reasons.")
        console.print()
    console.print(styled((_headline(result), "bold")))
    console.print(result.recommendation.reason)
    if result.recommendation.runner_up:
        console.print(f"Runner-up: {result.recommendation.runner_up_reason}")
    for step in result.recommendation.next_steps:
        console.print(f"Next: {step}")
    for caution in result.recommendation.cautions:
        console.print(f"Note: {caution}")
    wrong = [row for row in result.conditions if not row.ok]
    for row in wrong:
        console.print(styled("Condition: ", (row.name, "bold red"), f", {row.wrong}; {row.change}"))
    if result.conditions and not wrong:
        console.print(f"All {len(result.conditions)} conditions of the recommended loop hold.")
    console.print()


def show_servo(console: Console, result: StudyResult) -> None:
    """Print how well the servo as configured reproduces the record, and the findings."""
    u = result.units.words
    check = result.servo_check
    if check.residual is not None:
        within = "reproduces" if check.residual.percent <= check.allowed else "does not reproduce"
        console.print(
            f"The servo as configured {within} the logged drive {u.force}: "
            f"residual {percent(check.residual.percent)} of its rms value, {check.allowed:.3g} % allowed."
        )
    elif check.reason:
        console.print(check.reason)
    for finding in result.findings:
        console.print(styled((finding.name, "bold red"), f": {finding.what} {finding.change}"))
    console.print()


def show_verification(console: Console, found: Verification) -> None:
    """Print claimed and measured error, and what differs."""
    console.print(
        f"{found.name}: {shown(found.claimed, found.unit)} rms claimed, {shown(found.measured, found.unit)} rms "
        f"measured ({100.0 * (found.measured / found.claimed - 1.0):+.0f} %). The claim "
        f"{'came' if found.came_true else 'did not come'} true.",
        soft_wrap=True,
    )
    for reason in found.reasons:
        console.print(reason, soft_wrap=True)
    if not found.came_true and not found.reasons:
        console.print("Mass and friction are as in the study. Compare the reference and the settings of the drive.")


def _numerical(result: StudyResult) -> str:
    """Return how far the tracking errors are off, in a sentence."""
    runs = [(row.name, row.metrics) for row in result.compensators if row.metrics is not None]
    shares = {name: run.rms_bound / run.rms for name, run in runs if run.rms_bound is not None and run.rms > 0.0}
    if not shares:
        return "Numerical error of the tracking errors: not known."
    worst = max(shares, key=lambda name: shares[name])
    return f"Numerical error of the tracking errors: at most {100.0 * shares[worst]:.2g} % ({worst})."


def _headline(result: StudyResult) -> str:
    name = result.recommendation.name
    if not name:
        return "No recommendation"
    return "Recommendation: no compensation" if name == "none" else f"Recommendation: {name}"
