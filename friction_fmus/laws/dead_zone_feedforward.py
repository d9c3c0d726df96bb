"""Feedforward of friction with a dead zone of the motor force."""

from casadi import SX, fabs, if_else, logic_or, sign

from friction_fmus.lawkit.law import Friction, Input, Output, Parameter, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import clip, limited
from friction_fmus.lawkit.quantities import FORCE, VELOCITY


@law(
    "DeadZoneFeedforward",
    "Feedforward of friction with a dead-zone torque (interpretation)",
    source="Interpretation of a description without an identified source",
    cites=("DeadZoneTorque",),
    Ts=1e-3,
    friction=Friction("Fc", "T_dz", "Fv"),
    use=Use(
        "feedforward",
        models=("DeadZoneTorque",),
        tuned={"m": "0", "DV": "either(DV, max(5 * v_noise, 1e-3 * speed, 1e-9))"},
    ),
    outputs={
        "u": Output(FORCE, "linear and friction {force}, within u_min and u_max"),
        "F_hat": variables.F_HAT,
        "u_sat": variables.U_SAT,
    },
)
def dead_zone_feedforward(
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    f: SX = Input(FORCE, 0.0, "{force} of the linear controller", optional=True),
    enable: SX = variables.ENABLE,
    gain: SX = variables.GAIN,
    m: SX = variables.INERTIA,
    Fc: SX = variables.FC,
    T_dz: SX = Parameter(FORCE, 1.5, "force (torque of a rotating axis) up to which friction balances u_lin", min=0.0),
    Fv: SX = variables.FV,
    DV: SX = Parameter(VELOCITY, 1e-3, "velocity below which the dead zone applies", min=0.0),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
) -> dict[str, SX]:
    """Friction feedforward that, at low reference velocity, adds the force of the linear part again, up to T_dz.

        u_lin = m rdd + f
        |rd| <  DV:  F_hat = sgn(u_lin) min(|u_lin|, T_dz)
        |rd| >= DV:  F_hat = Fc sgn(rd) + Fv rd
        u = clip(u_lin + gain F_hat, u_min, u_max)

    This is an interpretation of a description, not a published equation. A comparison of compensators mentions a
    torque-based friction model in feedforward, similar to Karnopp's model, with a dead-zone torque for friction below
    the stiction torque. Its source could not be identified.

    F_hat is the force of the block DeadZoneTorque with the external force u_lin, except in one case: in the band and
    with |u_lin| > T_dz, the block returns sliding friction, this law T_dz. Without f, the law equals KarnoppFeedforward
    with Fs = T_dz.

    Use it if the drive torque is known and the controller force is available: the force at rest then depends on the
    controller force instead of the sign of the reference. Connect u to the plant or, without f, to the input f of a
    position controller, whose parameter m must then be 0.

    While enable is false, u, F_hat and u_sat are 0. The law has no state, so u jumps when enabled.

    Limits: the law is an interpretation. With f from a feedback controller, it is not a feedforward: in the band, it
    multiplies the gains of that controller by 1 + gain, which the stability margin must allow. F_hat jumps at |rd| =
    DV. Presliding is not modelled. u_min must not exceed u_max.
    """
    u_lin = m * rdd + f
    rest = logic_or(fabs(rd) < DV, rd == 0.0)
    F_hat = if_else(rest, clip(u_lin, -T_dz, T_dz), sign(rd) * Fc + Fv * rd)
    return limited(u_lin, F_hat, gain, enable, u_min, u_max)
