"""Learned residual of a friction model over velocity, position and direction."""

from itertools import pairwise

from casadi import SX, fabs, floor, if_else, sign

from friction_fmus.lawkit.law import Command, Input, Output, Parameter, Switch, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import clip
from friction_fmus.lawkit.quantities import FORCE, LENGTH, POSITIONS, SPEEDS, VELOCITY

ZEROS = (0.0,) * (len(SPEEDS) * POSITIONS)


def hat(distance: SX) -> SX:
    """Return 1 - |distance| within a distance of 1, else 0, without decisions."""
    return (fabs(distance + 1.0) + fabs(distance - 1.0)) / 2.0 - fabs(distance)


@law(
    "FrictionResidual",
    "Learned residual of a friction model over velocity, position and direction, bounded and passive",
    source="This library; bilinear interpolation",
    cites=("FrictionFmus2026",),
    Ts=1e-3,
    use=Use("feedforward", never="It corrects the {force} of a friction model."),
    outputs={"u": Output(FORCE, "{force} with the residual"), "residual": Output(FORCE, "residual, u - f")},
)
def friction_residual(
    f: SX = Input(FORCE, 0.0, "{force} of the friction model, or of a feedforward law"),
    x: SX = Input(LENGTH, 0.0, "position, or its reference"),
    v: SX = Input(VELOCITY, 0.0, "velocity, or its reference"),
    enable: SX = Command(True, "false: u = 0 and residual = 0"),
    gain: SX = variables.GAIN,
    v_max: SX = Parameter(VELOCITY, 0.1, "largest speed of the table", min=1e-12),
    x_begin: SX = Parameter(LENGTH, 0.0, "first position of the table"),
    spacing: SX = Parameter(LENGTH, 1e-3, "distance of the positions of the table", min=1e-12),
    forward: SX = Parameter(FORCE, ZEROS, "friction to add in forward motion: 8 positions for each speed"),
    backward: SX = Parameter(FORCE, ZEROS, "friction to add in backward motion, positive if it opposes the motion"),
    R_max: SX = Parameter(FORCE, 100.0, "largest residual", min=0.0),
    only_adds: SX = Switch(False, "true: the residual never assists the motion"),
) -> dict[str, SX]:
    """Force of a friction model plus a table over speed and position, one for each direction of motion.

        R        = forward(|v|, x) for v > 0, backward(|v|, x) for v < 0
        R        = clip(gain R, -R_max, R_max)
        R        = max(R, 0)                           if only_adds
        R        = max(R, -max(sgn(v) f, 0))
        residual = sgn(v) R
        u        = f + residual

    The tables have the speeds 0.03, 0.1, 0.3, 0.6 and 1 times v_max and 8 equally spaced positions from x_begin on.
    They are interpolated bilinearly. Below the first speed, R falls to 0 in proportion to |v|; above v_max and outside
    the positions, the values of the edge hold.

    The interpolation is this library's. `learn_residual` of `friction_fmus.identification` finds the table: least
    squares with ridge regularisation on the residual of an identified model, with cross-validation.

    The residual is bounded by R_max and by the values of the table. With it, u v >= min(f v, 0) at each instant:
    where the model resists the motion, u resists it or is 0, so that the sum with a static model is passive. A model
    with presliding returns energy that it stored; only_adds keeps the sum passive with every passive model.

    Use it to correct the remaining error of a friction model: friction that depends on position and direction, or
    another curve over speed. Connect a friction model and the motion, or F_hat of a feedforward law and the reference.

    While enable is false, u and residual are 0. The law has no state, so u jumps when enabled in motion.

    Limits: the table does not know the history of the motion, so it cannot learn presliding. It is as good as the
    motion from which it was learned; outside it holds the values of the edge.
    """
    share = fabs(v) / v_max
    along_speed = SX(0.0)
    for before, after in pairwise((0.0, *SPEEDS)):
        along_speed += clip((share - before) / (after - before), SX(0.0), SX(1.0))
    phase = (x - x_begin) / (POSITIONS * spacing)
    within = POSITIONS * (phase - floor(phase))  # a difference of two positions is accurate in single precision
    last = POSITIONS - 1.0
    along_x = if_else(phase < 0.0, 0.0, if_else(phase < last / POSITIONS, within, last))
    of_position = [hat(along_x - j) for j in range(POSITIONS)]
    R = SX(0.0)
    for i in range(len(SPEEDS)):
        row = SX(0.0)
        for j in range(POSITIONS):
            k = i * POSITIONS + j
            row += of_position[j] * if_else(v < 0.0, backward[k], forward[k])
        R += hat(along_speed - (i + 1.0)) * row
    bounded = clip(gain * R, -R_max, R_max)
    resisting = if_else(only_adds, if_else(bounded < 0.0, 0.0, bounded), bounded)
    way = sign(v)
    opposed = way * f
    least = if_else(opposed > 0.0, -opposed, 0.0)
    residual = if_else(enable, way * if_else(resisting < least, least, resisting), 0.0)
    return {"u": if_else(enable, f + residual, 0.0), "residual": residual}
