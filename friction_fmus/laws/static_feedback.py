"""Stribeck friction computed from the measured velocity."""

from casadi import SX, fabs

from friction_fmus.lawkit.law import Friction, Parameter, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import clip, limited, stribeck_level
from friction_fmus.lawkit.quantities import VELOCITY


@law(
    "StaticFeedback",
    "Feedback of Stribeck friction computed from the measured velocity",
    source="Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994",
    cites=("ArmstrongHelouvry1994",),
    Ts=1e-3,
    friction=Friction("Fc", "Fs", "Fv", "vs", "delta"),
    use=Use("model feedback", models=("Stribeck",), tuned={"vt": "max(2 * max(Fs, Fc) / Kd, 5 * v_noise, 1e-9)"}),
    outputs=variables.COMPENSATION,
)
def static_feedback(
    v: SX = variables.V,
    enable: SX = variables.ENABLE,
    gain: SX = variables.GAIN,
    vt: SX = Parameter(VELOCITY, 1e-2, "velocity up to which the sign is linear", min=1e-12),
    Fc: SX = variables.FC,
    Fs: SX = variables.FS,
    Fv: SX = variables.FV,
    vs: SX = variables.VS,
    delta: SX = variables.DELTA,
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
) -> dict[str, SX]:
    """Positive feedback of Stribeck friction at the measured velocity.

        g(v)  = Fc + (Fs - Fc) exp(-|v/vs|^delta)
        sat   = v/vt, limited to -1 and 1
        F_hat = sat g(v) + Fv v
        u     = clip(gain F_hat, u_min, u_max)

    Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994 (survey). Fs = Fc is Coulomb friction alone. The
    parameters are the same as in the block Stribeck. Connect u to the input f of a position controller. While enable is
    false, u, F_hat and u_sat are 0. The law has no state, so u jumps when enabled in motion.

    Use it if no reference is known in advance, as in hand guiding or force control, and the velocity signal is good. It
    needs the Stribeck curve; compensate less than all of the friction.

    Within vt, the law is a negative damping of at most gain (Fs/vt + Fv), for Fs >= Fc. A frictionless axis with the
    damping Kd stays stable for

        Kd > gain (Fs/vt + Fv)

    and a sample time that is short compared with mass/Kd. If the real friction exceeds gain F_hat at every velocity,
    the law supplies no net energy, and the loop settles even with a smaller Kd. If gain g exceeds the real friction, a
    limit cycle occurs, whose amplitude grows with the excess.

    Limits: at rest, nothing is compensated, so the stiction error of the position loop remains. A large vt leaves
    friction uncompensated after a reversal; a small vt feeds back noise. Presliding is not modelled. With a delay of
    the velocity signal, the loop becomes unstable before the limit of the condition. u_min must not exceed u_max.
    """
    F_hat = clip(v / vt, SX(-1.0), SX(1.0)) * stribeck_level(fabs(v), Fc, Fs, vs, delta) + Fv * v
    return limited(SX(0.0), F_hat, gain, enable, u_min, u_max)
