"""Which conditions apply to an axis, and with which numbers."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from friction_fmus import conditions
from friction_fmus.blocks.arithmetic import evaluate
from friction_fmus.blocks.contact import Level
from friction_fmus.conditions import Condition, SampledLaw
from friction_fmus.conditions.condition import above, below, first_largest, remainder, spectral_radius
from friction_fmus.doctor.examined_axis import ActiveLaw, Axis, Gains, LoopFinding, Values

Array: TypeAlias = NDArray[np.float64]
Lowpass: TypeAlias = Callable[[Array, Values], Array]


def butterworth_there_and_back(frequency: Array, p: Values) -> Array:
    """Return Q of IterativeLearning: a second-order Butterworth filter, forward and backward; 1 for fq = 0."""
    fq, Ts = p["fq"], p["Ts"]
    if not 0.0 < fq < 0.5 / Ts:
        return np.ones_like(frequency)
    return np.asarray(1.0 / (1.0 + (np.tan(np.pi * frequency * Ts) / np.tan(np.pi * fq * Ts)) ** 4))


def windowed_sinc(frequency: Array, p: Values) -> Array:
    """Return Q of RepetitiveController: a low-pass filter over M samples to each side, with a squared-cosine window."""
    fq, Ts, M = p["fq"], p["Ts"], int(p["M"])
    if not 0.0 < fq < 0.5 / Ts or M == 0:
        return np.ones_like(frequency)
    i = np.arange(-M, M + 1)
    q = np.sinc(2.0 * fq * Ts * i) * np.cos(np.pi * i / (2.0 * (M + 1))) ** 2
    return np.asarray(np.cos(2.0 * np.pi * np.outer(frequency * Ts, i)) @ (q / q.sum()))


def contracts(lowpass: Lowpass, axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the convergence of learning in a sampled loop, from 1/(N Ts), the lowest frequency that can be learned."""
    gains, p = axis.servo.gains if axis.servo else None, used.values
    if gains is None:
        return
    Ts = p["Ts"]
    frequency = np.linspace(1.0 / (p["N"] * Ts), 0.5 / Ts, 4001)
    viscous = axis.damping + (axis.contact.levels[0].viscous if axis.contact else 0.0)
    loop = (axis.m, viscous, gains.Kp, gains.Kd, gains.Ki, Ts, axis.stiffness)
    sensitivity = used.to_force * p["gain"] * conditions.sampled_sensitivity(frequency, *loop)
    learning = conditions.learning_filter(frequency, p["m"], p["Kp"], p["Kd"], p["Ki"], Ts)
    yield conditions.contraction(frequency, sensitivity, learning, lowpass(frequency, p), p["rate"])


def share_of(used: ActiveLaw) -> float:
    """Return the fraction of the friction computed by a law that acts on the plant."""
    return used.to_force * used.values.get("gain", 1.0)


def left_of(axis: Axis, side: int, feedforward: bool = False) -> Level:
    """Return the friction in one direction left by laws that act at rest or, with `feedforward`, all compensators."""
    assert axis.contact is not None
    left = axis.contact.levels[side]
    for used in axis.laws:
        if used.law.levels is not None and (used.law.at_rest or feedforward):
            share, known = share_of(used), used.law.levels(used.values)[side]
            left = replace(
                left,
                Fc=max(remainder(left.Fc, share * known.Fc), 0.0),
                Fs=max(remainder(left.Fs, share * known.Fs), 0.0),
                viscous=remainder(left.viscous, share * known.viscous),
            )
    return left


def injection_of_error(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the condition on a LuGre observer that is corrected by the position error, k > 0."""
    gains = axis.servo.gains if axis.servo else None
    p = used.values
    if gains is not None and p["k"] > 0.0:
        yield conditions.injection(axis.m, gains.Kp, gains.Kd, gains.Ki, p["sigma0"], p["sigma1"])


def feeds_stiffness_back(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the condition on a law whose contact model, of bristles or elements, follows the measured motion."""
    gains = axis.servo.gains if axis.servo else None
    if gains is not None and axis.contact is not None:
        stiffness = axis.contact.stiffness + axis.stiffness + gains.Kp
        if axis.contact.stiffness:  # a rigid contact is stiffer than any model of it
            fed_back = float(evaluate("either(sigma0, sum(k))", used.values))
            yield conditions.fed_back_stiffness(share_of(used) * fed_back, stiffness)


def covers_friction(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the condition that a set-valued sliding mode covers the friction not compensated by other laws."""
    if axis.contact is not None:
        left = [left_of(axis, side, feedforward=True) for side in (0, 1)]
        yield conditions.sliding_gain(share_of(used) * used.values["K"], max(max(at.Fc, at.Fs) for at in left))


def follows_friction(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the condition on the gains of a super-twisting law."""
    yield conditions.super_twisting(used.values["c1"], used.values["c2"])


def adapts(texts: tuple[str, ...], axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the stability condition of an adaptation, from the expressions of its rate and its damping."""
    rate, damping = (float(evaluate(text, used.values)) for text in texts)
    yield conditions.adaptation(rate, damping, axis.m, used.values["Ts"])


def looks_ahead(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the condition on the preview of a non-causal inverse; zero-phase tracking (ZPETC) needs none."""
    p = used.values
    if not p["zero_phase"]:
        yield conditions.preview(p["zero"], p["preview"])


def dithers(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the conditions on the frequency and the stroke of a dither."""
    p = used.values
    force = abs(share_of(used)) * p["Ad"]
    if force == 0.0:
        return
    yield conditions.dither_frequency(p["frequency"], p["Ts"])
    if axis.contact is not None and axis.contact.stiffness:
        F = max(max(at.Fc, at.Fs) for at in axis.contact.levels)
        yield conditions.dither_stroke(force, p["frequency"], axis.m, F, axis.contact.stiffness)


def pushes(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the condition on force pulses, for errors from the tolerance to a thousand times the tolerance."""
    p = used.values
    if axis.contact is None or p["tol"] <= 0.0:
        return
    worst = max(axis.contact.levels, key=lambda at: at.Fs - at.Fc)
    if worst.Fc <= 0.0:
        return
    tp = p["n_pulse"] * p["Ts"]
    errors = p["tol"] * np.geomspace(1.0, 1e3, 301)
    if p["sized"]:
        forces = (p["Fc"] + np.sqrt(p["Fc"] ** 2 + 8.0 * p["m"] * p["Fc"] * p["gain"] * errors / tp**2)) / 2.0
        forces = np.maximum(forces, p["Fs"])
    else:
        errors, forces = errors[:1], np.array([p["F_pulse"]])
    most = min(used.path.high, -used.path.low)
    sent = np.minimum(abs(used.to_force) * forces, most)
    short = np.array([below(float(F), most) for F in sent])
    kept = short | (np.arange(len(sent)) == 0)  # a pulse at the force limit is repeated: one is enough
    gains = axis.servo.gains if axis.servo else None
    loop = (gains.Kp, gains.Kd) if gains else (0.0, 0.0)
    yield conditions.pulses(errors[kept], sent[kept], worst.Fc, worst.Fs, tp, axis.m, *loop)


_BUZZ = "in presliding the contact acts as a spring, and the loop with this spring is unstable: the axis buzzes at rest"
_INVERSE = "the model in the estimator differs too much from the plant: |Q D| < 1 is violated and oscillations grow"


def examine_poles(axis: Axis, servo: ActiveLaw, left: float) -> Iterator[LoopFinding]:
    """Yield the stability conditions in sliding and in presliding, without and with disturbance estimators."""
    if servo.law.linear is None or "Ts" not in servo.values:
        return
    own, together = (servo,), _with_estimators(axis, servo)
    if not servo.law.estimates:
        yield from _regimes(axis, own, left)
        if servo.path.amplified != 1.0:
            yield LoopFinding(
                (servo.part, axis.plant),
                _poles(axis, own, left, 0.0, f"with the {axis.words.force} of the dead-zone law", servo.path.amplified),
            )
    if estimating(axis, servo):
        yield from _regimes(axis, together, left)


def _regimes(axis: Axis, laws: tuple[ActiveLaw, ...], left: float) -> Iterator[LoopFinding]:
    """Yield the condition in sliding and, if that holds, the condition in presliding."""
    parts, contact = (*(used.part for used in reversed(laws)), axis.plant), axis.contact
    sliding = _poles(axis, laws, left, 0.0)
    yield LoopFinding(parts, sliding)
    if sliding.ok and contact is not None and contact.stiffness:
        where = f"in presliding (stiffness {contact.stiffness:.4g} {axis.words.N_m})"
        yield LoopFinding(parts, _poles(axis, laws, contact.damping + contact.viscous, contact.stiffness, where))


def estimating(axis: Axis, servo: ActiveLaw) -> bool:
    """Return whether the loop contains a disturbance estimator."""
    return any(used.law.estimates for used in _with_estimators(axis, servo))


def _with_estimators(axis: Axis, servo: ActiveLaw) -> tuple[ActiveLaw, ...]:
    """Return the law of the position loop and the estimators with the same sample time."""
    Ts = servo.values.get("Ts")
    others = [used for used in axis.laws if used.part != servo.part and used.law.estimates]
    return (servo, *(used for used in others if Ts is None or math.isclose(used.values.get("Ts", Ts), Ts)))


def falling(axis: Axis, servo: ActiveLaw, level: Level) -> Iterator[Condition]:
    """Yield the stability of slow motion at the least stable speed, if the loop is stable without dry friction."""
    laws = _with_estimators(axis, servo)
    if axis.contact is None or level.vs is None or not _poles(axis, laws, level.viscous, 0.0).ok:
        return
    driven = axis.driven(level.viscous, 0.0, servo.path.at_load)
    at = 3 if axis.at_load else 1
    mass = axis.m if axis.flexible is None else axis.flexible[int(axis.at_load)]
    speeds = level.vs * np.geomspace(0.05, 5.0, 31)
    g = level.at(speeds)
    law, Ts = _together(laws), servo.values["Ts"]
    path = servo.path.dynamics(Ts)
    found = []
    for v, here, slope in zip(speeds, g, np.gradient(g, speeds), strict=True):
        if axis.contact.stiffness:
            bristles = (axis.contact.stiffness, axis.contact.damping)
            plant = conditions.on_bristles(driven, at, mass, *bristles, float(here), float(slope), float(v))
        else:
            A = driven.A.copy()
            A[at, at] -= slope / mass
            plant = replace(driven, A=A)
        found.append((spectral_radius(conditions.chain(plant, law(Ts), Ts, path)), float(v), float(slope), plant))
    _, v, slope, plant = found[first_largest([radius for radius, *_ in found])]
    yield conditions.loop_poles(
        *(plant, law, Ts, path),
        name="stick-slip",
        where=f"at {v:.4g} {axis.words.m_s}, where friction falls by {-slope:.4g} {axis.words.Ns_m},",
        why="friction falls with speed faster than the loop's damping can make up for: slow motion is unstable "
        "(stick-slip)",
        hint="raise the damping of the loop or the bandwidth of the estimator, or compensate the friction",
    )


def _resonance(m1: float, m2: float, k: float, d: float) -> str:
    frequency = math.sqrt(k * (m1 + m2) / (m1 * m2)) / (2.0 * math.pi)
    return (
        f"motor and load resonate at {frequency:.4g} Hz, and with its delays and sensor location the loop excites "
        "this resonance: the oscillation grows"
    )


def _poles(
    axis: Axis,
    laws: tuple[ActiveLaw, ...],
    damping: float,
    stiffness: float,
    where: str = "in sliding",
    times: float = 1.0,
) -> Condition:
    servo, estimates = laws[0], any(used.law.estimates for used in laws)
    texts = {}
    if estimates:
        texts = {"name": "disturbance observer", "why": _INVERSE}
        texts["hint"] = f"lower the bandwidth of the estimator, correct its {axis.words.mass}"
    elif axis.flexible is not None:
        texts = {"why": _resonance(*axis.flexible)}
    elif stiffness:
        texts = {"name": "presliding loop", "why": _BUZZ}
    driven, Ts = axis.driven(damping, stiffness, servo.path.at_load), servo.values["Ts"]
    return conditions.loop_poles(driven, _together(laws, times), Ts, servo.path.dynamics(Ts), where=where, **texts)


def _together(laws: tuple[ActiveLaw, ...], times: float = 1.0) -> Callable[[float], Sequence[SampledLaw]]:
    def sampled(Ts: float) -> list[SampledLaw]:
        return [
            used.law.linear(used.values, Ts).scaled(times * used.to_force, used.of_position, used.of_velocity)
            for used in laws
            if used.law.linear is not None
        ]

    return sampled


def direct_gains(axis: Axis, servo: ActiveLaw) -> tuple[float, float]:
    """Return the immediate response of the force to a step of measured position and velocity [N/m, N.s/m]."""
    found = _together(_with_estimators(axis, servo))(servo.values["Ts"])
    return float(sum(law.D[0] for law in found)), float(sum(law.D[1] for law in found))


def examine_axis(axis: Axis) -> Iterator[LoopFinding]:
    """Yield all conditions that apply to an axis, including those that hold."""
    servo = axis.servo
    gains = servo.gains if servo is not None else None
    if servo is not None and gains is not None:
        yield from _linear(axis, servo, gains)
        for condition in _with_friction(axis, servo, gains):
            yield LoopFinding((servo.part, *_plant(axis)), condition)
        yield from _around(axis, servo, gains)
        yield from _inertia(axis, servo, gains)
    yield from _on_a_belt(axis)
    yield from _pulled(axis)
    yield from _compensated(axis)
    for used in axis.laws:
        for rule in used.law.rules:
            for condition in rule(axis, used):
                others = (servo.part,) if servo is not None and servo.part != used.part else ()
                yield LoopFinding((used.part, *others, axis.plant), condition)


def _plant(axis: Axis) -> tuple[str, ...]:
    return (axis.plant,) if axis.friction in (None, axis.plant) else (axis.plant, str(axis.friction))


def _linear(axis: Axis, servo: ActiveLaw, gains: Gains) -> Iterator[LoopFinding]:
    """Yield the stability of the loop without dry friction, in continuous time and sampled."""
    left = _viscous(axis)
    if not servo.law.estimates:
        loop = (axis.m, axis.damping + left, gains.Kp, gains.Kd, gains.Ki)
        yield LoopFinding((servo.part, axis.plant), conditions.routh(*loop, axis.stiffness))
    yield from examine_poles(axis, servo, left)


def _viscous(axis: Axis) -> float:
    return min(left_of(axis, side).viscous for side in (0, 1)) if axis.contact else 0.0


def _with_friction(axis: Axis, servo: ActiveLaw, gains: Gains) -> Iterator[Condition]:
    """Yield stick-slip and hunting, each in its worse direction."""
    if axis.contact is None:
        return
    left = [left_of(axis, side) for side in (0, 1)]
    yield from _stick_slip(axis, servo, gains, left)
    at = max(left, key=lambda level: level.Fs - level.Fc)
    integral = gains.Ki > 0.0 and gains.Kp > 0.0
    loop = axis.m, axis.damping + at.viscous, gains.Kp, gains.Kd
    slip = conditions.expected_slip(*loop, at.Fc, at.Fs) if integral else math.inf
    if gains.db > 0.0 and integral:
        yield conditions.dead_band(gains.db, slip)
    elif servo.law.hunts:
        turned = gains.reversal < 0.0 or gains.turned > 0.0
        stiffness = axis.contact.stiffness
        deflection = at.Fs / stiffness if stiffness > 0.0 else 0.0
        yield conditions.hunting(gains.Ki, at.Fc, at.Fs, turned, stiffness > 0.0, slip, deflection)
    if gains.turned > 0.0 and gains.Ki > 0.0:
        yield conditions.turned_friction(gains.turned, min(level.Fc for level in left))


def _stick_slip(axis: Axis, servo: ActiveLaw, gains: Gains, left: list[Level]) -> Iterator[Condition]:
    """Yield stick-slip from the damping of the position loop, or from the poles if the loop has more dynamics."""
    falling_curves = [at for at in left if at.vs and above(at.Fs, at.Fc)]
    if not falling_curves:
        return
    path = servo.path
    dynamic = (axis.flexible, path.tau, path.delay, path.lowpass, path.notch, path.position, estimating(axis, servo))
    worst = max(falling_curves, key=lambda at: conditions.steepest_fall(at.Fc, at.Fs, at.vs or 0.0, at.delta))
    fall = conditions.steepest_fall(worst.Fc, worst.Fs, worst.vs or 0.0, worst.delta)
    if any(dynamic) and servo.law.linear is not None and math.isfinite(fall):
        yield from falling(axis, servo, worst)
        return
    taken = axis.m * gains.Ki / gains.Kp if gains.Kp > 0.0 and gains.Ki > 0.0 else 0.0
    falls = [
        conditions.stick_slip_free(gains.Kd, axis.damping + at.viscous, at.Fc, at.Fs, at.vs or 0.0, at.delta, taken)
        for at in falling_curves
    ]
    yield max(falls, key=lambda fall: fall.bound - fall.value)


def _around(axis: Axis, servo: ActiveLaw, gains: Gains) -> Iterator[LoopFinding]:
    """Yield the conditions on drive limits, encoder, cogging and prefilters."""
    path, parts = servo.path, (servo.part, *_plant(axis))
    if axis.contact is not None:
        most = (path.high, -path.low)
        sides = [
            conditions.break_away(most[side], axis.contact.levels[side].Fs, ("forward", "backward")[side])
            for side in (0, 1)
        ]
        yield LoopFinding(parts, min(sides, key=lambda side: side.value - side.bound))
    if axis.contact is not None and path.quantum > 0.0 and servo.law.linear is not None:
        Kp, Kd = direct_gains(axis, servo)
        # the impulse response of a low-pass filter is nowhere above the inverse of its delay at frequency 0
        slow = sum(zeta / (math.pi * f) for f, zeta, _, band, high in path.lowpass if f and band == high == 0.0)
        window = path.window * servo.values["Ts"] + path.smoothing + slow if path.window else math.inf
        held = min(at.Fs for at in axis.contact.levels)
        yield LoopFinding((path.sensor, *parts), conditions.encoder_count(path.quantum, Kp, Kd, held, window))
    if axis.cogging is not None:
        part, slope = axis.cogging
        yield LoopFinding((part, *parts), conditions.cogging(gains.Kp + axis.stiffness, slope))
    for shaper in axis.shapers:
        own = tuple(shaper.values[key] for key in ("Kp", "Kd", "Ki", "Ts"))
        yield LoopFinding((shaper.part,), conditions.prefilter(own[0], own[1], own[2], own[3]))
        controller = servo.law.gains(servo.values) if servo.law.gains else gains
        theirs = (controller.Kp, controller.Kd, controller.Ki, servo.values.get("Ts", own[3]))
        yield LoopFinding((shaper.part, servo.part), conditions.prefilter_match(own, theirs))


def _on_a_belt(axis: Axis) -> Iterator[LoopFinding]:
    """Yield steady sliding of a mass on a belt without a controller."""
    if axis.belt is None or axis.contact is None or axis.servo is not None:
        return
    at = axis.contact.levels[0 if axis.belt <= 0.0 else 1]
    if at.vs:
        damping = axis.damping + at.viscous
        yield LoopFinding(_plant(axis), conditions.belt(damping, at.Fc, at.Fs, at.vs, at.delta, axis.belt))


def _pulled(axis: Axis) -> Iterator[LoopFinding]:
    """Yield the stick-slip cycle of a mass that a spring pulls, without a controller."""
    if not axis.support or axis.contact is None or axis.servo is not None or not axis.stiffness > 0.0:
        return
    at = axis.contact.levels[0 if axis.support > 0.0 else 1]
    if above(at.Fs, at.Fc):
        spring = (axis.m, axis.stiffness, axis.damping + at.viscous)
        found = conditions.pulled_mass(*spring, at.Fc, at.Fs, at.vs, at.delta, axis.support)
        yield LoopFinding(_plant(axis), found)


def _compensated(axis: Axis) -> Iterator[LoopFinding]:
    """Yield the ratio of all compensated friction to the friction of the axis, at the worst speed."""
    known = [(used, used.law.levels(used.values)) for used in axis.laws if used.law.levels is not None]
    if axis.contact is None or not known:
        return
    worst = 0.0
    for side, level in enumerate(axis.contact.levels):
        scales = [at.vs for at in (level, *(levels[side] for _, levels in known)) if at.vs]
        speeds = np.geomspace(1e-3 * min(scales, default=1.0), 1e3 * max(scales, default=1.0), 1000)
        there = level.at(speeds)
        total = sum(share_of(used) * levels[side].at(speeds) for used, levels in known)
        if there.min() > 0.0:
            worst = max(worst, float(np.max(total / there)))
    measured = any(used.law.measured for used, _ in known)
    parts = (*(used.part for used, _ in known), axis.friction or axis.plant)
    yield LoopFinding(parts, conditions.overcompensation(worst, measured))


def _inertia(axis: Axis, servo: ActiveLaw, gains: Gains) -> Iterator[LoopFinding]:
    """Yield the condition that either the position loop or another law has the inertia feedforward, not both."""
    masses = [(used, used.law.inertia(used.values)) for used in axis.laws if used.law.inertia is not None]
    feeding = [used for used, mass in masses if mass != 0.0]
    total = gains.m + sum(used.to_force * mass for used, mass in masses)
    if feeding:
        parts = (*(used.part for used in feeding), servo.part, axis.plant)
        yield LoopFinding(parts, conditions.inertia(total, axis.m, laws=len(feeding) + (gains.m != 0.0)))
