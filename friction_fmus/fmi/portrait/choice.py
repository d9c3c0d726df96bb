"""The experiment that shows what a block does: named in the block's file, or chosen from its ports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from friction_fmus.blocks.probe import INPUT
from friction_fmus.errors import FrictionError, nearest
from friction_fmus.fmi.portrait import control, friction, motion
from friction_fmus.fmi.portrait.course import Bench, Panel

Experiment = Callable[[Bench], tuple[Panel, ...]]

EXPERIMENTS: Final[Mapping[str, Experiment]] = {
    made.__name__: made
    for made in (
        friction.tomlinson,
        friction.depinning,
        friction.towed_to_and_fro,
        friction.avalanches,
        friction.pushed_mass,
        friction.stick_slip,
        motion.saturation,
        motion.ride,
        motion.ripple,
        motion.over_position,
        motion.push,
        motion.resonance,
        control.alternating_error,
        control.own_course,
        control.inversion,
        control.shaping,
        control.learning,
        motion.circle,
        motion.staircase,
        motion.differentiation,
    )
}
"""Experiments that a block's file can select by ``PORTRAIT``, or a law by ``portrait``."""


def experiment(bench: Bench) -> Experiment | None:
    """Return the experiment for a block, or None if there is nothing to show."""
    named = bench.portrait
    if named:
        if named not in EXPERIMENTS:
            raise FrictionError(f"There is no portrait {named!r}{nearest(named, EXPERIMENTS)}")
        return EXPERIMENTS[named]
    by_ports: tuple[tuple[bool, Experiment], ...] = (
        ("v" in bench.inputs and "F" in bench.outputs, friction.friction_panels),
        (bench.has("r", "rd", "x", "u", "F_hat"), control.tracking),
        (bench.has("F_hat") and (bench.has("v") or bench.has("rd")), control.estimate),
        (bench.has("r", "x", "u"), control.held_error),
        (bool(bench.outputs and bench.inputs), motion.step_response),
        (bool(bench.outputs) and not any(v.role == INPUT for v in bench.variables.values()), motion.course),
    )
    return next((made for fits, made in by_ports if fits), None)
