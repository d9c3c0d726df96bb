"""Which experiment shows what a block is: by its name where it needs one of its own, otherwise by its ports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from friction_fmus.describe import INPUT
from friction_fmus.portrait import control, friction, motion
from friction_fmus.portrait.course import Bench, Panel

Experiment = Callable[[Bench], tuple[Panel, ...]]

OWN: Mapping[str, Experiment] = MappingProxyType(
    {
        "PrandtlTomlinson": friction.tomlinson,
        "FrenkelKontorova": friction.depinning,
        "FrenkelKontorovaTomlinson": friction.towed_to_and_fro,
        "BurridgeKnopoff": friction.avalanches,
        "KarnoppMass": friction.pushed_mass,
        "SwitchMass": friction.stick_slip,
        "Actuator": motion.saturation,
        "Belt": motion.ride,
        "Cogging": motion.ripple,
        "Mass": motion.push,
        "TwoMass": motion.resonance,
        "ResetPID": control.alternating_error,
        "Dither": control.own_course,
        "DiscreteInverse": control.inversion,
        "InverseDynamics": control.inversion,
        "Prefilter": control.shaping,
        "PreviewPrefilter": control.shaping,
        "IterativeLearning": control.learning,
        "RepetitiveController": control.learning,
        "Circle": motion.circle,
        "Encoder": motion.staircase,
        "Quantiser": motion.staircase,
        "Differentiator": motion.differentiation,
    }
)
"""Block of the library -> its experiment, where the ports do not tell it."""


def experiment(bench: Bench) -> Experiment | None:
    """What to do with a block, None for one that has nothing to show."""
    if bench.model in OWN:
        return OWN[bench.model]
    by_ports: tuple[tuple[bool, Experiment], ...] = (
        ("v" in bench.inputs and "F" in bench.outputs, friction.friction_panels),
        (bench.has("r", "rd", "x", "u", "F_hat"), control.tracking),
        (bench.has("F_hat") and (bench.has("v") or bench.has("rd")), control.estimate),
        (bench.has("r", "x", "u"), control.held_error),
        (bool(bench.outputs and bench.inputs), motion.step_response),
        (bool(bench.outputs) and not any(v.role == INPUT for v in bench.variables.values()), motion.course),
    )
    return next((made for fits, made in by_ports if fits), None)
