"""The poles of the whole sampled loop of an axis: in sliding, within presliding, and where friction falls."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from friction_fmus import conditions
from friction_fmus.conditions import Condition, SampledLaw
from friction_fmus.doctor.axis import Axis, Finding, Used
from friction_fmus.doctor.linear import linearised, local_function

_BUZZ = "around a standstill the contact is a spring, and the loop with it is unstable: the axis buzzes at rest"
_INVERSE = (
    "the model in the estimator differs too much from the plant: |Q D| < 1 does not hold, the loop oscillates and grows"
)


def examine_poles(axis: Axis, servo: Used, left: float) -> Iterator[Finding]:
    """Poles in sliding and on the stiffness of the contact, without and with the estimators of disturbances.

    Parameters
    ----------
    axis, servo : Axis, Used
        The axis and the law that closes its position loop.
    left : float
        Viscous friction that no law compensates [N.s/m].
    """
    if servo.law.linear is None or "Ts" not in servo.values:
        return
    own, estimators = (servo,), tuple(estimating(axis, servo))
    parts = _parts(axis, own)
    if not servo.law.estimates:
        yield Finding(parts, _poles(axis, own, left, 0.0))
        if servo.path.amplified != 1.0:
            yield Finding(parts, _poles(axis, own, left, 0.0, "with the force of the dead zone", servo.path.amplified))
        yield from _presliding(axis, own)
    if estimators:
        # `own` is first, so that its sample time and its path are those of the loop
        together = tuple(dict.fromkeys((servo, *estimators)))
        yield Finding(_parts(axis, together), _poles(axis, together, left, 0.0))
        yield from _presliding(axis, together)


def estimating(axis: Axis, servo: Used) -> Iterator[Used]:
    """The estimators of disturbances that are sampled with the position loop."""
    for used in axis.laws:
        if used.law.estimates and used.values.get("Ts", servo.values["Ts"]) == servo.values["Ts"]:
            yield used


def falling(axis: Axis, servo: Used, fall: float, left: float) -> Condition:
    """Steady motion where friction falls steepest, with all that is in the loop.

    Parameters
    ----------
    fall : float
        Steepest fall of the Stribeck curve [N.s/m].
    """
    laws = tuple(dict.fromkeys((servo, *estimating(axis, servo))))
    driven = axis.driven(left - fall, 0.0, servo.path.at_load)
    return conditions.loop_poles(
        driven,
        _together(laws),
        servo.values["Ts"],
        servo.path.between,
        name="stick-slip",
        where=f"where friction falls by {fall:.4g} N.s/m",
        why="friction falls faster with speed than the loop damps: slow steady motion sticks and slips",
        hint="raise the damping of the loop or the bandwidth of the estimator, or compensate the friction",
    )


def _presliding(axis: Axis, laws: tuple[Used, ...]) -> Iterator[Finding]:
    contact = axis.contact
    if contact is not None and contact.stiffness:
        damping = contact.damping + contact.viscous
        where = f"in presliding (stiffness {contact.stiffness:.4g} N/m)"
        yield Finding(_parts(axis, laws), _poles(axis, laws, damping, contact.stiffness, where))


def _poles(
    axis: Axis, laws: tuple[Used, ...], damping: float, stiffness: float, where: str = "in sliding", times: float = 1.0
) -> Condition:
    servo, estimates = laws[0], any(used.law.estimates for used in laws)
    texts = {}
    if estimates:
        texts = {"name": "disturbance observer", "why": _INVERSE}
        texts["hint"] = "lower the bandwidth of the estimator, correct its mass"
    elif stiffness:
        texts = {"name": "presliding loop", "why": _BUZZ}
    driven = axis.driven(damping, stiffness, servo.path.at_load)
    return conditions.loop_poles(
        driven, _together(laws, times), servo.values["Ts"], servo.path.between, where=where, **texts
    )


def _together(laws: tuple[Used, ...], times: float = 1.0) -> Callable[[float], Sequence[SampledLaw]]:
    def sampled(Ts: float) -> list[SampledLaw]:
        return [_sampled(used, Ts).scaled(times * used.to_force, used.of_position, used.of_velocity) for used in laws]

    return sampled


def _sampled(used: Used, Ts: float) -> SampledLaw:
    if used.model == "LocalFunctionEstimator":
        return local_function(used.values, Ts)
    return linearised(used.model, {**used.values, **(used.law.linear or {})}, Ts)


def direct_gains(axis: Axis, servo: Used) -> tuple[float, float]:
    """What a step of the measured position and of the measured velocity gives at once [N/m, N.s/m]."""
    laws = tuple(dict.fromkeys((servo, *estimating(axis, servo))))
    found = _together(laws)(servo.values["Ts"])
    return float(sum(law.D[0] for law in found)), float(sum(law.D[1] for law in found))


def _parts(axis: Axis, laws: tuple[Used, ...]) -> tuple[str, ...]:
    return (*(used.part for used in reversed(laws)), axis.plant)
