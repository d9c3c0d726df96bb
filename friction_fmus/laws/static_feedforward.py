"""Feedforward of inertia and Stribeck friction from the reference."""

from casadi import SX, fabs, if_else, logic_and

from friction_fmus.lawkit.law import Friction, Parameter, Switch, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import direction, limited, load_of, stribeck_level
from friction_fmus.lawkit.quantities import DAMPING, FORCE, NO_UNIT, VELOCITY


@law(
    "StaticFeedforward",
    "Feedforward of inertia and Stribeck friction computed from the reference",
    source="Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994",
    cites=("ArmstrongHelouvry1994",),
    Ts=1e-3,
    friction=Friction("Fc", "Fs", "Fv", "vs", "delta"),
    use=Use("feedforward", models=("Stribeck",), tuned={"m": "0", "v_rest": "1e-6 * speed"}),
    outputs=variables.FEEDFORWARD,
)
def static_feedforward(
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    Fn: SX = variables.FN,
    enable: SX = variables.ENABLE,
    gain: SX = variables.GAIN,
    m: SX = variables.INERTIA,
    Fc: SX = variables.FC,
    Fs: SX = variables.FS,
    Fv: SX = variables.FV,
    vs: SX = variables.VS,
    delta: SX = variables.DELTA,
    Fn0: SX = variables.FN0,
    v_rest: SX = variables.V_REST,
    offset: SX = Parameter(FORCE, 0.0, "constant {force} at all velocities, including rest"),
    asymmetric: SX = Switch(False, "rd < 0 uses the parameters with the suffix _neg"),
    Fc_neg: SX = Parameter(FORCE, 1.0, "Coulomb friction for rd < 0", min=0.0),
    Fs_neg: SX = Parameter(FORCE, 1.5, "static friction for rd < 0", min=0.0),
    Fv_neg: SX = Parameter(DAMPING, 0.4, "viscous coefficient for rd < 0", min=0.0),
    vs_neg: SX = Parameter(VELOCITY, 1e-3, "Stribeck velocity for rd < 0", min=1e-12),
    delta_neg: SX = Parameter(NO_UNIT, 2.0, "Stribeck exponent for rd < 0", min=1e-3, max=100.0),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
) -> dict[str, SX]:
    """The force that moves a known mass with Stribeck friction along the reference.

        g(rd) = Fc + (Fs - Fc) exp(-|rd/vs|^delta)
        F_hat = sgn(rd) g(rd) max(Fn, 0)/Fn0 + Fv rd + offset
        sgn(rd) = 0 for |rd| <= v_rest
        u     = clip(m rdd + gain F_hat, u_min, u_max)

    Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994 (survey of the curve and of its feedforward). Fs
    = Fc is Coulomb friction alone. With asymmetric, rd < 0 has its own parameters. The parameters and the sign are as
    in the block Stribeck: F_hat is positive for rd > 0.

    Connect u to the input f of a position controller with the parameter m = 0, or directly to the plant. While enable
    is false, u, F_hat and u_sat are 0. The law has no state, so u jumps when enabled in motion.

    Feedforward does not change the stability of the loop. In sliding, its benefit depends on the accuracy of the
    parameters. gain is limited to 1, because overcompensation drives the axis.

    A computed reference that rests often has a velocity of 1e-17 instead of 0, so that u would be the whole friction
    force: v_rest must exceed this rounding.

    Limits: u jumps by 2 Fs at reversals of the reference, whereas presliding friction changes gradually. For motion
    within the presliding range (some micrometres), the law can be worse than no compensation. At rest (rd = 0), only
    the offset is compensated. u_min must not exceed u_max.
    """
    own = logic_and(asymmetric, rd < 0.0)
    # select the parameters before computing the curve: one power, one exponential, no branch that could overflow
    level = stribeck_level(
        fabs(rd),
        if_else(own, Fc_neg, Fc),
        if_else(own, Fs_neg, Fs),
        if_else(own, vs_neg, vs),
        if_else(own, delta_neg, delta),
    )
    F_hat = direction(rd, v_rest) * level * load_of(Fn, Fn0) + if_else(own, Fv_neg, Fv) * rd + offset
    return limited(m * rdd, F_hat, gain, enable, u_min, u_max)
