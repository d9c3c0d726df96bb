"""Feedforward of gravity from the reference, and the normal force of a contact under load."""

from math import pi

from casadi import SX, cos, fabs, floor, sign, sin

from friction_fmus.lawkit.law import Command, Output, Parameter, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import direction, limited, when
from friction_fmus.lawkit.quantities import DAMPING, FORCE, LENGTH, MASS, NO_UNIT


@law(
    "LoadFeedforward",
    "Feedforward of gravity and inertia from the reference, and the load of the friction",
    source="Duclusaud, Passault, Padois, Ly, IEEE International Conference on Robotics and Automation, 2025 (load)",
    cites=("Duclusaud2025",),
    Ts=1e-3,
    use=Use("feedforward", never="A study adds it by itself to an axis with gravity or load."),
    outputs={
        "u": variables.U_FORWARD,
        "Fn": Output("N", "normal force of the contact, for the input Fn of other laws"),
        "u_sat": variables.U_SAT,
    },
)
def load_feedforward(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    enable: SX = Command(True, "false: u = 0 and Fn = Fc"),
    m: SX = variables.INERTIA,
    pitch: SX = Parameter(LENGTH, 2.0 * pi, "period of gravity over the position: one turn", min=1e-9),
    G_sin: SX = Parameter(FORCE, 1.0, "{force} against gravity in proportion to the sine of the position"),
    G_cos: SX = Parameter(FORCE, 0.0, "{force} against gravity in proportion to the cosine of the position"),
    offset: SX = Parameter(FORCE, 0.0, "constant {force} that the drive needs, such as that of a weight"),
    m_moved: SX = Parameter(MASS, 1.0, "{moving_mass}, whose acceleration loads the contact", min=0.0),
    Fv: SX = Parameter(DAMPING, 0.0, "viscous coefficient, whose {force} loads the contact", min=0.0),
    Fc: SX = Parameter(FORCE, 1.0, "Coulomb friction without load", min=0.0),
    a_drive: SX = Parameter(NO_UNIT, 0.1, "friction over {force} of the drive", min=0.0, max=0.9),
    a_external: SX = Parameter(NO_UNIT, 0.1, "friction over external {force}", min=0.0),
    v_rest: SX = variables.V_REST,
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
) -> dict[str, SX]:
    """The force that holds and accelerates an arm or a weight, and the normal force that it gives a contact.

        G  = G_sin sin(2 pi r/pitch) + G_cos cos(2 pi r/pitch) + offset
        u  = clip(m rdd + G, u_min, u_max)
        b  = a_external G + a_drive (G + m_moved rdd + Fv rd)
        y  = (b + a_drive s Fc) / (1 - a_drive s sgn(b + a_drive s Fc))
        s  = sgn(rd), 0 for |rd| <= v_rest
        Fn = Fc + |y|

    The load is that of the block TransmissionLoad with base = Fc, Duclusaud, Passault, Padois, Ly, IEEE International
    Conference on Robotics and Automation, 2025: Fn = Fc + |a_drive F_drive + a_external G|. The drive also moves the
    friction s Fn, which the load contains, so that F_drive = G + m_moved rdd + Fv rd + s Fn; y solves this equation,
    uniquely, as a_drive is below 1.

    Connect Fn to the input Fn of a friction feedforward or observer with Fn0 = Fc, and u to the input f of a position
    controller whose parameter m is 0; or set m = 0 here and m there. An identification with the terms gravity and load
    returns the parameters: G_sin, G_cos, OF as offset, M as m_moved, Fc, and a for both coefficients. For a linear axis
    with a weight, set G_sin = 0 and the weight as offset.

    While enable is false, u and u_sat are 0, and Fn is Fc. The law has no state, so u jumps when enabled in motion.
    Feedforward does not change the stability of the loop.

    Limits: Fn is the load along the reference; an axis that does not follow has another one. A viscous friction in the
    contact and a friction that falls with velocity load it by their own force, too, of which only Fv is considered.
    u_min must not exceed u_max.
    """
    angle = 2.0 * pi * (r / pitch - floor(r / pitch + 0.5))  # small for a small r, which a float then resolves
    G = G_sin * sin(angle) + G_cos * cos(angle) + offset
    way = direction(rd, v_rest)
    b = a_external * G + a_drive * (G + m_moved * rdd + Fv * rd)
    moving = b + a_drive * way * Fc
    y = moving / (1.0 - a_drive * way * sign(moving))
    found = limited(m * rdd, G, SX(1.0), enable, u_min, u_max)
    return {"u": found["u"], "u_sat": found["u_sat"], "Fn": Fc + when(enable, y=fabs(y))["y"]}
