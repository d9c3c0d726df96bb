"""Feedforward of inertia and generalised Maxwell slip friction from the reference."""

from casadi import SX, ceil, exp, fabs, if_else, logic_and, logic_or

from friction_fmus.lawkit.law import Friction, Input, Output, Parameter, SampleTime, Use, law
from friction_fmus.lawkit.parts import maxwell_slip, variables
from friction_fmus.lawkit.parts.expressions import deflected, elapsed, increment, limited, stribeck_level, when
from friction_fmus.lawkit.parts.maxwell_slip import ELEMENTS, slide, weights
from friction_fmus.lawkit.quantities import DAMPING, FORCE, NO_UNIT


@law(
    "GMSFeedforward",
    "Feedforward of inertia and generalised Maxwell slip friction computed from the reference",
    source="Lampaert, Swevers, Al-Bender, ACC 2004; Al-Bender, Lampaert, Swevers, IEEE TAC 50(11), 2005",
    cites=("Lampaert2004", "AlBender2005"),
    Ts=1e-3,
    friction=Friction("Fc", "Fs", "sigma2", "vs", "delta"),
    use=Use("feedforward", models=("GMS",), tuned={"m": "0"}),
    outputs={
        "u": variables.U_FORWARD,
        "F_hat": variables.F_HAT,
        "F_pre": Output(FORCE, "sum of the {force}s Fi of the elements"),
        "slips": Output(NO_UNIT, "number of slipping elements"),
        "u_sat": variables.U_SAT,
    },
    conditions=maxwell_slip.CONDITIONS,
)
def gms_feedforward(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    Fn: SX = Input("N", 1.0, "normal force", optional=True),
    enable: SX = variables.ENABLE_STATES,
    reset: SX = variables.RESET,
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    Fi: SX = maxwell_slip.FI,
    slipping: SX = maxwell_slip.SLIPPING,
    way: SX = maxwell_slip.WAY,
    last: SX = variables.LAST,
    started: SX = variables.STARTED,
    missed: SX = variables.MISSED,
    gain: SX = variables.GAIN,
    m: SX = variables.INERTIA,
    N: SX = maxwell_slip.N,
    k: SX = maxwell_slip.K,
    alpha: SX = maxwell_slip.ALPHA,
    C: SX = maxwell_slip.C,
    sigma: SX = Parameter(DAMPING, 0.0, "damping of each element", min=0.0),
    sigma2: SX = variables.SIGMA2,
    Fc: SX = variables.POSITIVE_FC,
    Fs: SX = variables.POSITIVE_FS,
    vs: SX = variables.VS,
    delta: SX = variables.DELTA,
    Fn0: SX = Parameter("N", 1.0, "normal force for which the parameters are valid", min=1e-12),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX | list[SX]]:
    """The force that moves a known mass with generalised Maxwell slip (GMS) friction along the reference.

        S(v) = Fc + (Fs - Fc) exp(-|v/vs|^delta)
        dr   = r - last,   w = dr / Ts,   last: reference in the previous sample
        dr = 0 or a reversal:  all elements stick
        stick:  Fi becomes Fi + ki dr; if sgn(dr) Fi reaches alpha_i S(w),
                it is set to that, and the element slips
        slip:   Fi becomes t + (Fi - t) exp(-C Ts / S(w)),
                t = sgn(dr) alpha_i S(w)
        F_hat = (F1 + ... + FN + sigma (z1' + ... + zN')) max(Fn, 0)/Fn0
                + sigma2 rd
        zi'   = rd for a sticking element,
                sgn(dr) C (alpha_i - sgn(dr) Fi/S(w))/ki for a slipping one
        u     = clip(m rdd + gain F_hat, u_min, u_max)

    Al-Bender, Lampaert, Swevers, IEEE TAC 50(11), 2005 (the model); Lampaert, Swevers, Al-Bender, American Control
    Conference, 2004, where it is the best of Dahl, LuGre, Leuven and GMS for feedforward in presliding. Parameters and
    start values are the same as in the block GMS, except that all elements have one attraction C. alpha_i are
    normalised by alpha_1 + ... + alpha_N, which must be positive. N is rounded up.

    If rd = w, F_hat is the force of the block GMS at the end of a step with the velocity w. An element that reaches its
    level within a sample is set to the level. With the attraction C alone, as in the equations sampled by Euler's
    method, it would stay far below its level at a coarse Ts.

    Use it for precise positioning with reversals and small strokes: among the feedforward laws with a state, it is the
    one that remembers all reversal points. It needs the Stribeck curve from steady velocities and the elements from a
    presliding loop.

    The first sample and a sample with reset start at r: dr = 0 and Fi = 0. While enable is false, u, F_hat, u_sat and
    the states are 0; when enable becomes true again, dr is 0, however far r has moved. While track is true, dr is 0 and
    the forces are in proportion to alpha_i and such that u = u_track, as far as |Fi| <= alpha_i Fs. Connect u to the
    input f of a position controller, whose parameter m must then be 0. Feedforward does not change the stability of the
    loop.

    Limits: a reversal between two samples is missed. With noise in r, the elements switch between stick and slip, so
    r must be the reference, not a measurement. u_min must not exceed u_max.
    """
    fresh = logic_or(reset, track)
    dr = increment(r, last, started, fresh)  # 0 if fresh
    span = elapsed(missed, Ts)
    moving, side = dr != 0.0, if_else(dr > 0.0, 1.0, -1.0)
    S = stribeck_level(fabs(dr / span), Fc, Fs, vs, delta)
    shares, total = weights(alpha, N)
    used = if_else(ELEMENTS - 1 < N, ELEMENTS, ceil(N))
    load = if_else(Fn == Fn0, 1.0, if_else(Fn > 0.0, Fn, 0.0) / Fn0)
    rest = m * rdd + gain * ((load * sigma * used + sigma2) * rd)
    carries = deflected(track, u_track, rest, gain * load, Fs, u_min, u_max, SX(0.0))
    forces, slips, creep = [], [], SX(0.0)
    for i, element in enumerate(slide(Fi, slipping, way, k, N, shares, total, dr, S, exp(-C * span / S))):
        elastic = logic_and(sigma > 0.0, logic_and(element.slipped, k[i] > 0.0))
        creep += if_else(elastic, (element.moved - element.level) / if_else(k[i] > 0.0, k[i], 1.0), 0.0)
        kept = if_else(track, shares[i] * (carries / total), if_else(reset, 0.0, Fi[i]))
        forces.append(if_else(moving, side * element.moved, kept))
        slips.append(if_else(moving, element.slips, 0.0))
    F_pre, slipping_now = sum(forces), sum(slips)
    stretching = rd * (used - slipping_now)
    creeping = if_else(moving, side * (C * creep / S), 0.0)
    F_el = F_pre + sigma * (stretching - creeping)
    friction = load * F_el + sigma2 * rd
    return {
        **limited(m * rdd, friction, gain, enable, u_min, u_max),
        **when(
            enable,
            F_pre=F_pre,
            slips=slipping_now,
            way=if_else(moving, side, if_else(fresh, 0.0, way)),
            last=r,
            started=1.0,
        ),
        "missed": SX(0.0),
        "Fi": [if_else(enable, force, 0.0) for force in forces],
        "slipping": [if_else(enable, slip, 0.0) for slip in slips],
    }
