"""Sliding mode with adapted Coulomb and viscous friction, computed from the reference."""

from casadi import SX, exp, fabs, if_else, sign

from friction_fmus.lawkit.law import Command, Output, Parameter, SampleTime, State, law, replaces_servo
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import adapted, clip, limited
from friction_fmus.lawkit.quantities import DAMPING, FORCE, LENGTH, MASS, VELOCITY


@law(
    "AdaptiveSlidingMode",
    "Sliding mode with a boundary layer and adapted static friction",
    source="Slotine, Li: Applied Nonlinear Control, Prentice Hall 1991",
    cites=("SlotineLi1991",),
    Ts=1e-3,
    use=replaces_servo("sliding mode"),
    outputs={
        **variables.TRACKING,
        "Fc_hat": Output(FORCE, "estimated Coulomb friction"),
        "Fv_hat": Output(DAMPING, "estimated viscous coefficient"),
    },
    conditions={"Fc0 <= Fc_max": lambda Fc0, Fc_max: Fc0 <= Fc_max, "Fv0 <= Fv_max": lambda Fv0, Fv_max: Fv0 <= Fv_max},
)
def adaptive_sliding_mode(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    x: SX = variables.X,
    v: SX = variables.V,
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and the estimates are at their start values"),
    reset: SX = Command(False, "true: the estimates are reset to their start values"),
    learned_c: SX = State(FORCE, 0.0, "Fc_hat - Fc0"),
    learned_v: SX = State(DAMPING, 0.0, "Fv_hat - Fv0"),
    gain: SX = variables.GAIN,
    m: SX = variables.MASS_OR_NONE,
    lam: SX = variables.LAM,
    Ks: SX = Parameter(DAMPING, 127.0, "linear gain of s", min=0.0),
    K: SX = Parameter(FORCE, 0.5, "gain of the saturated s", min=0.0),
    phi: SX = Parameter(VELOCITY, 1e-3, "boundary layer: half width of the linear part of sat", min=1e-12),
    Gamma_c: SX = Parameter(FORCE + "/" + LENGTH, 2000.0, "rate of adaptation of Fc_hat", min=0.0),
    Gamma_v: SX = Parameter(MASS + "/" + LENGTH + "2", 2e4, "rate of adaptation of Fv_hat", min=0.0),
    Fc0: SX = Parameter(FORCE, 1.0, "initial Fc_hat", min=0.0),
    Fv0: SX = Parameter(DAMPING, 0.4, "initial Fv_hat", min=0.0),
    Fc_max: SX = Parameter(FORCE, 100.0, "upper limit of Fc_hat; the lower limit is 0", min=0.0),
    Fv_max: SX = Parameter(DAMPING, 1000.0, "upper limit of Fv_hat; the lower limit is 0", min=0.0),
    excess: SX = Parameter(FORCE, 0.5, "static minus Coulomb friction"),
    vs: SX = variables.VS,
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Sliding-mode tracking control with adaptation of Coulomb and viscous friction.

        s      = (rd - v) + lam (r - x)
        F_hat  = (Fc_hat + excess exp(-(rd/vs)^2)) sgn(rd) + Fv_hat rd
        sgn(0) = 0
        w      = m (rdd + lam (rd - v)) + Ks s + K sat(s/phi) + gain F_hat
        u      = clip(w, u_min, u_max)
        Fc_hat_next = Fc_hat + Ts Gamma_c s sgn(rd),  within 0 and Fc_max
        Fv_hat_next = Fv_hat + Ts Gamma_v s rd,       within 0 and Fv_max

    Both estimates are held while |s| <= phi, and while u is limited and s pushes further into that limit.

    Slotine, Li: Applied Nonlinear Control, Prentice Hall 1991 (robust adaptive sliding control with a boundary layer).
    The paper that combines it with a Stribeck curve of the reference was not found; the law follows a summary. Outside
    the layer, in continuous time and for friction that follows the reference velocity,

        V = m s^2/2 + (Fc - Fc_hat)^2/(2 Gamma_c) + (Fv - Fv_hat)^2/(2 Gamma_v)
        V' = -Ks s^2 - K |s|

    so s enters the layer and stays in it, |r - x| <= phi/lam, provided that K exceeds the error of the friction model.
    In sampled time, up to terms of the order lam Ts, stability requires

        (Gamma_c + Gamma_v rd^2) Ts < Ks,   (Ks + K/phi) Ts < 2 m

    Use it if a static curve describes friction well, friction changes slowly, and the reference covers a range of
    speeds; choose K for the remaining friction. The law is a complete controller with Kp = (Ks + K/phi) lam and Kd = Ks
    + K/phi + m lam in the layer, without integral action.

    While enable is false, u, F_hat and u_sat are 0 and the estimates are Fc0 and Fv0; reset takes effect in the same
    sample. The estimates cannot carry a load, so u jumps when enabled on a loaded axis.

    Limits: the estimates converge only as far as tracking requires; at a single speed, only Fc + Fv |rd| is learned.
    F_hat jumps at reversals of the reference, as in StaticFeedforward. A narrow layer causes chattering;
    ImplicitSlidingMode does not chatter. Fc0 <= Fc_max, Fv0 <= Fv_max and u_min <= u_max are required.
    """
    Fc_hat = Fc0 + if_else(reset, 0.0, learned_c)
    Fv_hat = Fv0 + if_else(reset, 0.0, learned_v)
    ed = rd - v
    s = ed + lam * (r - x)

    F_hat = (Fc_hat + excess * exp(-((rd / vs) ** 2))) * sign(rd) + Fv_hat * rd
    tracking = m * (rdd + lam * ed) + Ks * s + K * clip(s / phi, SX(-1.0), SX(1.0))
    outputs = limited(tracking, F_hat, gain, enable, u_min, u_max)

    outside = if_else(fabs(s) <= phi, 0.0, s)
    active, zero = outputs["u_sat"], SX(0.0)
    after_c = adapted(Fc_hat, Gamma_c * outside * sign(rd), s, active, zero, Fc_max, Ts)
    after_v = adapted(Fv_hat, Gamma_v * outside * rd, s, active, zero, Fv_max, Ts)
    runs = if_else(reset, 0.0, enable)
    return {
        **outputs,
        "Fc_hat": if_else(enable, Fc_hat, Fc0),
        "Fv_hat": if_else(enable, Fv_hat, Fv0),
        "learned_c": if_else(runs, after_c - Fc0, 0.0),
        "learned_v": if_else(runs, after_v - Fv0, 0.0),
    }
