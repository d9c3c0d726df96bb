"""Feedforward of inertia and LuGre friction from the reference."""

from casadi import SX, fabs, if_else, logic_and, sign

from friction_fmus.lawkit.law import Friction, Output, Parameter, SampleTime, State, Switch, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import (
    deflected,
    elapsed,
    fading,
    increment,
    limited,
    load_of,
    relax,
    stribeck_level,
    when,
)
from friction_fmus.lawkit.quantities import DAMPING, FORCE, LENGTH, NO_UNIT, VELOCITY


@law(
    "LuGreFeedforward",
    "Feedforward of inertia and LuGre friction computed from the reference",
    source="Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995; Lampaert, Swevers, Al-Bender, ACC 2004",
    cites=("CanudasDeWit1995", "Lampaert2004"),
    Ts=1e-3,
    friction=Friction("Fc", "Fs", "sigma2", "vs", "delta"),
    use=Use("feedforward", models=("LuGre",), tuned={"m": "0"}),
    outputs={
        "u": variables.U_FORWARD,
        "F_hat": variables.F_HAT,
        "z_hat": Output(LENGTH, "mean bristle deflection in this sample"),
        "u_sat": variables.U_SAT,
    },
)
def lugre_feedforward(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    Fn: SX = variables.FN,
    enable: SX = variables.ENABLE_STATES,
    reset: SX = variables.RESET,
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    z: SX = State(LENGTH, 0.0, "mean bristle deflection", nominal=1e-5),
    last: SX = variables.LAST,
    started: SX = variables.STARTED,
    missed: SX = variables.MISSED,
    gain: SX = variables.GAIN,
    m: SX = variables.INERTIA,
    sigma0: SX = variables.SIGMA0,
    sigma1: SX = variables.SIGMA1,
    sigma2: SX = variables.SIGMA2,
    Fc: SX = variables.POSITIVE_FC,
    Fs: SX = variables.POSITIVE_FS,
    vs: SX = variables.VS,
    delta: SX = variables.DELTA,
    Fn0: SX = variables.FN0,
    v_d: SX = Parameter(VELOCITY, 0.0, "speed at which the bristle damping decays; 0: constant damping", min=0.0),
    asymmetric: SX = Switch(False, "backward motion uses the parameters with the suffix _neg"),
    sigma2_neg: SX = Parameter(DAMPING, 0.4, "viscous coefficient for rd < 0", min=0.0),
    Fc_neg: SX = Parameter(FORCE, 1.0, "Coulomb friction for backward motion", min=1e-9),
    Fs_neg: SX = Parameter(FORCE, 1.5, "static friction for backward motion", min=1e-9),
    vs_neg: SX = Parameter(VELOCITY, 1e-3, "Stribeck velocity for backward motion", min=1e-12),
    delta_neg: SX = Parameter(NO_UNIT, 2.0, "Stribeck exponent for backward motion", min=1e-3, max=100.0),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """The force that moves a known mass with LuGre friction along the reference.

        g(v)  = Fc + (Fs - Fc) exp(-|v/vs|^delta)
        dr    = r - last,   w = dr / Ts,   last: reference in the previous sample
        t     = sgn(dr) g(w) / sigma0
        z     becomes t + (z - t) exp(-sigma0 |dr| / g(w))
        F_hat = (sigma0 z + sigma1(rd) (rd - sigma0 |rd| z/g(rd))) max(Fn, 0)/Fn0
                + sigma2 rd
        sigma1(v) = sigma1 exp(-(v/v_d)^2) if v_d > 0, else sigma1
        u     = clip(m rdd + gain F_hat, u_min, u_max)

    Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995 (the model, start values from its Table I);
    Lampaert, Swevers, Al-Bender, American Control Conference, 2004, compare it in feedforward with the Dahl, Leuven and
    GMS models. The parameters are the same as in the block LuGre.

    z advances by the displacement of the reference since the previous sample, exactly for constant velocity. If rd = w,
    F_hat is therefore the force of the block LuGre at the end of a step with the velocity w. F_hat applies to the time
    of the sample; a law that advances z by Ts rd leads or lags by one sample.

    Use it for axes that reverse often or move by micrometres, where the sign of the velocity is too abrupt. Sliding
    friction must be known within a few per cent, the stiffness much less accurately.

    The first sample and a sample with reset start at r: dr = 0 and z = 0. While enable is false, u, F_hat, u_sat and
    the states are 0; when enable becomes true again, dr is 0, however far r has moved. While track is true, z is such
    that u = u_track, as far as |z| <= g(rd)/sigma0. Connect u to the input f of a position controller, whose parameter
    m must then be 0. Feedforward does not change the stability of the loop.

    Limits: in the model, z drifts under a constant force with vibration, and reversal points are not remembered. If rd
    jumps, F_hat jumps by sigma1 times as much. With the start values, F_hat can even oppose the motion; choose v_d < 4
    sqrt(2 e) Fc / sigma1 to prevent that. GMSFeedforward is better in presliding. A reversal between two samples is
    missed. u_min must not exceed u_max.
    """

    def level(v: SX) -> SX:
        own = logic_and(asymmetric, v < 0.0)
        return stribeck_level(
            fabs(v),
            if_else(own, Fc_neg, Fc),
            if_else(own, Fs_neg, Fs),
            if_else(own, vs_neg, vs),
            if_else(own, delta_neg, delta),
        )

    dr = increment(r, last, started, reset)
    g = level(dr / elapsed(missed, Ts))
    moved = relax(if_else(reset, 0.0, z), sign(dr) * g / sigma0, sigma0 * fabs(dr) / g)
    steady = level(rd)
    rate = sigma0 * fabs(rd) / steady
    viscous = if_else(logic_and(asymmetric, rd < 0.0), sigma2_neg, sigma2)
    damping = fading(sigma1, rd, v_d)
    load = load_of(Fn, Fn0)
    rest = m * rdd + gain * ((damping * load + viscous) * rd)
    stiffness = gain * load * (sigma0 - damping * rate)
    now = deflected(track, u_track, rest, stiffness, steady / sigma0, u_min, u_max, moved)
    stretching = rd - rate * now
    friction = load * (sigma0 * now + damping * stretching) + viscous * rd
    return {
        **limited(m * rdd, friction, gain, enable, u_min, u_max),
        **when(enable, z_hat=now, z=now, last=r, started=1.0),
        "missed": SX(0.0),
    }
