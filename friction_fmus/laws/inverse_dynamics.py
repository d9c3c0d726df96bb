"""Inverse dynamics of one mass, or of two masses connected by a spring."""

from casadi import SX

from friction_fmus.lawkit.law import Command, Friction, Input, Output, Parameter, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import limited, when
from friction_fmus.lawkit.quantities import DAMPING, FORCE, JERK, LENGTH, MASS, VELOCITY


@law(
    "InverseDynamics",
    "Feedforward of inertia, viscous friction and a flexible coupling from the reference",
    source="Boerlage, Tousain, Steinbuch, American Control Conference, 2004 (jerk derivative feedforward)",
    cites=("Boerlage2004",),
    Ts=1e-3,
    friction=Friction(viscous="Fv + Fv_load"),
    use=Use("feedforward", models=("Viscous", "Stribeck"), tuned={"m": "0"}),
    outputs={
        "u": variables.U_FORWARD,
        "F_hat": Output(FORCE, "viscous friction {force}; u contains gain F_hat"),
        "r_motor": Output(LENGTH, "motor position corresponding to r"),
        "rd_motor": Output(VELOCITY, "motor velocity corresponding to r"),
        "u_sat": variables.U_SAT,
    },
)
def inverse_dynamics(
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    jerk: SX = Input(JERK, 0.0, "third derivative of the reference", optional=True),
    snap: SX = Input(LENGTH + "/s4", 0.0, "fourth derivative of the reference", optional=True),
    r: SX = Input(LENGTH, 0.0, "reference position, for r_motor only", optional=True),
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and r_motor = r"),
    gain: SX = variables.GAIN,
    m: SX = Parameter(MASS, 1.0, "{mass} of the motor, or total {mass} if compliance is 0", min=0.0),
    m_load: SX = Parameter(MASS, 0.0, "{mass} of the load", min=0.0),
    Fv: SX = Parameter(DAMPING, 0.4, "viscous coefficient at the motor", min=0.0),
    Fv_load: SX = Parameter(DAMPING, 0.0, "viscous coefficient at the load", min=0.0),
    compliance: SX = Parameter(
        LENGTH + "/(" + FORCE + ")", 0.0, "inverse of the coupling stiffness; 0: rigid", min=0.0
    ),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
) -> dict[str, SX]:
    """The force on the motor that moves the load exactly along the reference.

        x_m   = r + c (m_load rdd + Fv_load rd),   c: compliance
        F_hat = Fv x_m' + Fv_load rd
        u     = clip(m x_m'' + m_load rdd + gain F_hat, u_min, u_max)

    c = 0 is a single mass with viscous friction: u = clip((m + m_load) rdd + gain F_hat, u_min, u_max). Two masses
    connected by a spring with the stiffness 1/c have no zeros from the motor force to the load position, so the inverse
    is a sum of derivatives of the reference up to the fourth (snap) and needs no filter. For the feedforward of jerk
    and snap see Boerlage, Tousain, Steinbuch, American Control Conference, 2004.

    Use it with a reference whose fourth derivative is bounded, for an axis whose first resonance affects the error at
    the load. Give r_motor and rd_motor to a controller that measures at the motor; with r, the controller would
    counteract the deflection of the spring. Add a friction feedforward with m = 0 to u of this law.

    Connect u to the input f of a position controller, whose parameter m must then be 0. While enable is false, u, F_hat
    and u_sat are 0 and r_motor, rd_motor equal r, rd. The law has no state, so u jumps when enabled in motion.
    Feedforward does not change the stability of the loop.

    Limits: the coupling has no damping. The derivatives must be consistent; a jerk of 0 with a varying rdd causes the
    error m c m_load snap. With gain < 1, the deflection due to friction is still compensated completely. Plants with
    zeros need DiscreteInverse. u_min must not exceed u_max.
    """
    bent = compliance * (m_load * rdd + Fv_load * rd)
    bent_d = compliance * (m_load * jerk + Fv_load * rdd)
    bent_dd = compliance * (m_load * snap + Fv_load * jerk)
    friction = Fv * (rd + bent_d) + Fv_load * rd
    moved = when(enable, r_motor=bent, rd_motor=bent_d)
    return {
        **limited(m * (rdd + bent_dd) + m_load * rdd, friction, gain, enable, u_min, u_max),
        "r_motor": r + moved["r_motor"],
        "rd_motor": rd + moved["rd_motor"],
    }
