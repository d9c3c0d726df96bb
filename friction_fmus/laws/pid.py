"""PID position control."""

from casadi import SX, fabs, if_else, logic_and, logic_or, sign

from friction_fmus.lawkit.law import Parameter, SampleTime, State, law, replaces_servo
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import carried, clip, limits, restarts, tracked, unless_winding_up
from friction_fmus.lawkit.quantities import DAMPING, FORCE, LENGTH, NO_UNIT, STIFFNESS, VELOCITY


@law(
    "PID",
    "PID position controller with inertia feedforward, anti-windup, dead-band and integral reset",
    source="Astrom, Hagglund: Advanced PID Control, ISA 2006",
    cites=("AstromHagglund2006", "ArmstrongAmin1996"),
    Ts=1e-3,
    use=replaces_servo("integral"),
    outputs=variables.CONTROL,
)
def pid(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    x: SX = variables.X,
    v: SX = variables.V,
    f: SX = variables.FED_FORWARD,
    enable: SX = variables.ENABLE_INTEGRAL,
    reset: SX = variables.RESET_INTEGRAL,
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    integral: SX = State(LENGTH + ".s", 0.0, "integral of the position error", nominal=1e-4, sums=True),
    held: SX = State(NO_UNIT, 0.0, "1 while the dead-band holds the integral", flag=True),
    side: SX = State(NO_UNIT, 0.0, "sign of the last velocity above v_zc"),
    Kp: SX = Parameter(STIFFNESS, 12e3, "proportional gain", min=0.0),
    Kd: SX = Parameter(DAMPING, 190.0, "derivative gain", min=0.0),
    Ki: SX = Parameter(FORCE + "/(" + LENGTH + ".s)", 250e3, "integral gain; 0: PD", min=0.0),
    m: SX = variables.starting(variables.INERTIA, 0.0),
    db: SX = Parameter(LENGTH, 0.0, "dead-band: error up to which the integral is held; 0: none", min=0.0),
    db_ratio: SX = Parameter(NO_UNIT, 1.5, "hysteresis: integration continues above db_ratio db", min=1.0),
    reversal: SX = Parameter(
        NO_UNIT, 1.0, "factor of the integral at a reversal; 1: none, 0: reset", min=-1.0, max=1.0
    ),
    Fc_turned: SX = Parameter(
        FORCE, 0.0, "Coulomb friction in the integral, reversed in sign at a reversal; 0: none", min=0.0
    ),
    v_zc: SX = Parameter(VELOCITY, 0.0, "speed above which a reversal counts", min=0.0),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """PID position control with feedforward of the reference acceleration, sampled every Ts.

        e      = r - x
        u      = clip(Kp e + Kd (rd - v) + Ki I + m rdd + f, u_min, u_max)
        I_next = I + Ts e
        I_next = I while u is limited and e pushes further into that limit
        I_next = I while |e| <= db, and after that until |e| > db_ratio db
        I      = reversal I + 2 Fc_turned sgn(v)/Ki, before it is used, at a
                 reversal: |v| > v_zc, and the sign of v differs from that
                 of the last v with |v| > v_zc
        I      = (u_track - Kp e - Kd (rd - v) - m rdd - f)/Ki  while track
                 is true, so that u = u_track

    Astrom, Hagglund: Advanced PID Control, ISA 2006 (conditional integration against windup, tracking); Hanus,
    Kinnaert, Henrotte: Conditioning technique, a general anti-windup and bumpless transfer method, Automatica 23(6),
    1987. Ki = 0 is PD control. The start values place three poles near 10 Hz for a mass of 1 kg without friction.

    The integral used in a sample does not contain the error of that sample. While reset is true, the integral is 0, in
    the same sample and in the next one. While enable is false, u, u_sat and the integral are 0. When enable becomes
    true again, u does not jump if the reference starts at the state of the axis (r = x, rd = v, rdd = 0).

    To take over an axis without a jump, set track in the first sample with enable, and u_track to the force that acts:
    u is then u_track, within u_min and u_max, and continues from it. The integral also absorbs the jump of a
    compensator at f that is enabled in such a sample. With Ki = 0 there is no memory, and track has no effect.

    Dead-band and reversal act against hunting; the start values disable them. A dead-band with db_ratio > 1 does not
    chatter with a noisy error. reversal = 0 resets the integral, -1 reverses its sign like Coulomb friction, and values
    in between scale it. Fc_turned reverses only friction and keeps other contributions to the integral, such as a load:
    before the reversal, Ki I contains -Fc sgn(v), after it Fc sgn(v), where v is the new velocity; set reversal = 1 in
    this case. Fc_turned must not exceed Coulomb friction, or it drives the axis; with Ki = 0, it has no effect.

    With reversal = -1 or Fc_turned, the spring-back of the contact after a slip must count as a reversal: v_zc must
    exceed the noise of v and be below the speed of the spring-back, some 0.1 mm/s for LuGre friction. Otherwise the
    integral changes only after break-away, which increases hunting.

    The linear loop with viscous friction s2 is stable for (Kd + s2) Kp > mass Ki, if Ts is short compared with its time
    constants.

    Limits: if static friction exceeds Coulomb friction, the integral action causes hunting around a constant reference
    for all stabilising gains (Armstrong, Amin, Automatica 32(5), 1996). Without it, an error of up to Fs/Kp remains. A
    dead-band stops hunting only if it is wider than one slip, and leaves an error of this size. A reset at reversals
    shortens the period of hunting but does not stop it. reversal = -1 and Fc_turned = Fc leave an oscillation of some
    0.1 mm with the gains of the LuGre paper. Under a load, reversal = -1 reverses the load as well and increases the
    error. If f contains the inertia force, like u of StaticFeedforward, m must be 0. u_min must not exceed u_max.
    """
    start = 0.0
    moves = fabs(v) > v_zc
    flip = if_else(Ki > 0.0, 2.0 * Fc_turned * sign(v) / if_else(Ki > 0.0, Ki, 1.0), 0.0)
    turned = if_else(logic_and(moves, side * v < 0.0), reversal * integral + flip, integral)
    e = r - x
    feedback, ahead = Kp * e + Kd * (rd - v), m * rdd + f
    free = if_else(reset, start, turned)
    wanted = tracked(track, u_track, Ki, feedback + Ki * free + m * rdd + f)
    u = clip(wanted, u_min, u_max)
    old = carried(track, u, feedback + ahead, Ki, free)
    hold = logic_or(fabs(e) <= db, logic_and(held, fabs(e) <= db_ratio * db))
    u_sat = limits(wanted, u_min, u_max)
    rate = if_else(hold, 0.0, unless_winding_up(e, u_sat))
    return {
        "u": if_else(enable, u, 0.0),
        "u_sat": if_else(enable, u_sat, 0.0),
        "integral": if_else(restarts(reset, track), start, if_else(enable, old + Ts * rate, start)),
        "held": if_else(enable, hold, 0.0),
        "side": if_else(enable, if_else(moves, sign(v), side), 0.0),
    }
