"""Inverse dynamics of one mass or of two with a spring between them."""

from __future__ import annotations

from casadi import SX

from friction_fmus.lawkit.law import (
    DAMPING,
    FORCE,
    JERK,
    LENGTH,
    MASS,
    NO_UNIT,
    VELOCITY,
    Command,
    Friction,
    Input,
    Loop,
    Output,
    Parameter,
    Use,
    law,
)
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.feedforward import feedforward, when


@law(
    "InverseDynamics",
    "Feedforward of inertia, viscous friction and a flexible coupling from the reference",
    source="Boerlage, Tousain, Steinbuch, American Control Conference, 2004 (jerk derivative feedforward)",
    Ts=1e-3,
    portrait="inversion",
    quotes=("overcompensation", "inertia"),
    loop=Loop(friction=Friction(viscous="Fv + Fv_load"), inertia="m + m_load"),
    use=Use("feedforward", models=("Viscous", "Stribeck"), tuned={"m": "0"}),
    outputs={
        "u": Output(FORCE, "feedforward force, within u_min and u_max"),
        "F_hat": Output(FORCE, "viscous friction force; u contains gain F_hat"),
        "r_motor": Output(LENGTH, "position of the motor that belongs to r"),
        "rd_motor": Output(VELOCITY, "velocity of the motor that belongs to r"),
        "u_sat": Output(NO_UNIT, "active limit: -1 lower, +1 upper, 0 none"),
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
    m: SX = Parameter(MASS, 1.0, "mass of the motor, or all mass if compliance is 0", min=0.0),
    m_load: SX = Parameter(MASS, 0.0, "mass of the load", min=0.0),
    Fv: SX = Parameter(DAMPING, 0.4, "viscous coefficient at the motor", min=0.0),
    Fv_load: SX = Parameter(DAMPING, 0.0, "viscous coefficient at the load", min=0.0),
    compliance: SX = Parameter(
        LENGTH + "/(" + FORCE + ")", 0.0, "one over the stiffness of the coupling, 0: rigid", min=0.0
    ),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
) -> dict[str, SX]:
    """The force on the motor that moves the load exactly along the reference.

        x_m   = r + c (m_load rdd + Fv_load rd),   c: compliance
        F_hat = Fv x_m' + Fv_load rd
        u     = clip(m x_m'' + m_load rdd + gain F_hat, u_min, u_max)

    One mass with viscous friction is c = 0: u = clip((m + m_load) rdd + gain F_hat, u_min, u_max). Two masses with a
    spring of the stiffness 1/c between them have no zeros from the force at the motor to the load, so their inverse is
    a sum of derivatives of the reference, up to the fourth (snap), and needs no filter: Boerlage, Tousain, Steinbuch,
    American Control Conference, 2004, for the feedforward of jerk and snap (from memory of the paper).

    Use it with a reference whose fourth derivative is bounded, for an axis whose first resonance shows in the error at
    the load. r_motor and rd_motor are the references of a controller that measures at the motor: with r it would work
    against the bending of the spring. A friction feedforward is added to u behind this law, with its own m = 0.

    Connect u to the input f of a position controller, whose parameter m must then be 0. While enable is false, u, F_hat
    and u_sat are 0 and r_motor, rd_motor are r, rd; there is no state. Feedforward does not change the stability of the
    loop.

    Limits: the coupling has no damping. The derivatives must belong together: a jerk of 0 beside a changing rdd is
    wrong by m c m_load snap. With gain below 1 the bending by friction is still that of all friction. Plants with
    zeros need DiscreteInverse. u_min must not exceed u_max.
    """
    bent = compliance * (m_load * rdd + Fv_load * rd)
    bent_d = compliance * (m_load * jerk + Fv_load * rdd)
    bent_dd = compliance * (m_load * snap + Fv_load * jerk)
    friction = Fv * (rd + bent_d) + Fv_load * rd
    moved = when(enable, r_motor=bent, rd_motor=bent_d)
    return {
        **feedforward(m * (rdd + bent_dd) + m_load * rdd, friction, gain, enable, u_min, u_max),
        "r_motor": r + moved["r_motor"],
        "rd_motor": rd + moved["rd_motor"],
    }
