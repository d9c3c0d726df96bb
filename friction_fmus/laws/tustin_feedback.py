"""Tustin friction and cogging from position-dependent tables."""

from casadi import SX, exp, fabs, floor, if_else, sign

from friction_fmus.lawkit.law import Friction, Output, Parameter, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import limited, periodic_table
from friction_fmus.lawkit.quantities import FORCE, LENGTH, NO_UNIT, VELOCITY

POINTS = 16


@law(
    "TustinFeedback",
    "Feedback of Tustin friction and cogging with tables over the position",
    source="Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994",
    cites=("ArmstrongHelouvry1994", "Tustin1947"),
    Ts=1e-3,
    friction=Friction("Fc", "Fs", "Fv", "vs", "1"),
    use=Use("model feedback", models=("Tustin", "Stribeck"), tuned={"v_min": "max(5 * v_noise, 1e-3 * speed, 1e-9)"}),
    outputs={
        "u": Output(FORCE, "compensation {force}, within u_min and u_max"),
        "F_hat": Output(FORCE, "estimated friction {force} without cogging; u contains gain F_hat"),
        "u_sat": variables.U_SAT,
    },
)
def tustin_feedback(
    x: SX = variables.X,
    v: SX = variables.V,
    enable: SX = variables.ENABLE,
    gain: SX = Parameter(NO_UNIT, 1.0, "fraction of friction and cogging that is compensated", min=0.0, max=1.0),
    v_min: SX = Parameter(VELOCITY, 1e-3, "speed above which friction is compensated", min=0.0),
    Fc: SX = variables.FC,
    Fs: SX = variables.FS,
    Fv: SX = variables.FV,
    vs: SX = variables.VS,
    pitch: SX = Parameter(LENGTH, 0.024, "period of the tables", min=1e-9),
    x0: SX = Parameter(LENGTH, 0.0, "position of the first point of the tables"),
    level: SX = Parameter(NO_UNIT, (1.0,) * POINTS, "friction at this point relative to the curve", min=0.0),
    cogging: SX = Parameter(FORCE, (0.0,) * POINTS, "{force} that holds the axis against cogging at this point"),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
) -> dict[str, SX]:
    """Friction at the measured velocity with a position-dependent level, and cogging of a linear motor.

        F(v)  = (Fc + (Fs - Fc) exp(-|v|/vs)) sgn(v) + Fv v
        F_hat = level(x) F(v)  for |v| >= v_min, else 0
        u     = clip(gain (F_hat + cogging(x)), u_min, u_max)

    Tustin's curve has the exponent 1, so its slope at rest is not 0. Armstrong-Helouvry, Dupont, Canudas de Wit,
    Automatica 30(7), 1994. level(x) and cogging(x) are interpolated linearly between 16 points at x0, x0 + pitch/16,
    ..., with the period pitch. For an axis without a period, choose a pitch longer than the stroke.

    Use it for linear motors and ball screws, where friction and cogging vary along the axis. The tables follow from the
    forces u_p(x) and u_n(x) of iterative learning control, or of a slow feedback, at the same constant speed in both
    directions:

        F(x) = (u_p - u_n)/2,   cogging(x) = (u_p + u_n)/2

    The paper with this scheme was not found; tables and threshold follow a summary. Connect u to the input f of a
    position controller. With x and v connected to the reference position and velocity, the law is feedforward. While
    enable is false, u, F_hat and u_sat are 0. The law has no state, so u jumps when enabled in motion.

    v_min suppresses the effect of velocity noise at rest; without it, the compensation switches by 2 Fs at each change
    of sign. Cogging is also compensated at rest.

    Limits: F_hat jumps by Fs at v_min, which causes oscillation at speeds near v_min; below v_min, the position
    controller must overcome friction. The tables cannot resolve variations shorter than pitch/8. Overcompensation of
    friction drives the axis. u_min must not exceed u_max.
    """
    phase = (x - x0) / pitch
    place = POINTS * (phase - floor(phase))
    curve = (Fc + (Fs - Fc) * exp(-fabs(v) / vs)) * sign(v) + Fv * v
    F_hat = if_else(fabs(v) < v_min, 0.0, periodic_table(place, level) * curve)
    return limited(gain * periodic_table(place, cogging), F_hat, gain, enable, u_min, u_max)
