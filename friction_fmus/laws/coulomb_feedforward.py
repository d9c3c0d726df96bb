"""Feedforward of inertia and Coulomb friction from the reference."""

from casadi import SX, if_else, logic_and

from friction_fmus.lawkit.law import Friction, Parameter, Switch, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import direction, limited
from friction_fmus.lawkit.quantities import FORCE


@law(
    "CoulombFeedforward",
    "Feedforward of inertia and Coulomb friction computed from the reference",
    source="Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994",
    cites=("ArmstrongHelouvry1994",),
    Ts=1e-3,
    friction=Friction("Fc"),
    use=Use("feedforward", models=("Coulomb", "Stribeck"), tuned={"m": "0", "v_rest": "1e-6 * speed"}),
    outputs=variables.FEEDFORWARD,
)
def coulomb_feedforward(
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    enable: SX = variables.ENABLE,
    gain: SX = variables.GAIN,
    m: SX = variables.INERTIA,
    Fc: SX = variables.FC,
    v_rest: SX = variables.V_REST,
    asymmetric: SX = Switch(False, "rd < 0 uses its own parameter Fc_neg"),
    Fc_neg: SX = Parameter(FORCE, 1.0, "Coulomb friction for rd < 0", min=0.0),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
) -> dict[str, SX]:
    """The force that moves a known mass with Coulomb friction along the reference.

        F_hat = Fc sgn(rd),   sgn(rd) = 0 for |rd| <= v_rest
        u     = clip(m rdd + gain F_hat, u_min, u_max)

    Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994 (survey). The friction model is the block Coulomb
    in motion. Fc is half the difference of the forces of two slow motions in opposite directions.

    Use it as a first compensation: one parameter, no state, no tuning. StaticFeedforward adds Stribeck and viscous
    friction.

    Connect u to the input f of a position controller, whose parameter m must then be 0. While enable is false, u, F_hat
    and u_sat are 0. The law has no state, so u jumps when enabled in motion. Feedforward does not change the stability
    of the loop.

    A computed reference that rests often has a velocity of 1e-17 instead of 0, so that u would be the whole friction
    force: v_rest must exceed this rounding.

    Limits: u jumps by 2 Fc at reversals of the reference, whereas presliding friction changes gradually. For motion
    within the presliding range (some micrometres), the law can be worse than no compensation. At rest, nothing is
    compensated. u_min must not exceed u_max.
    """
    F_hat = direction(rd, v_rest) * if_else(logic_and(asymmetric, rd < 0.0), Fc_neg, Fc)
    return limited(m * rdd, F_hat, gain, enable, u_min, u_max)
