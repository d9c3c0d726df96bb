"""Feedforward of inertia and Dahl friction from the reference."""

from casadi import SX, expm1, fabs, if_else, log1p, logic_and, sign

from friction_fmus.lawkit.law import Friction, Output, Parameter, State, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import deflected, increment, limited, when
from friction_fmus.lawkit.quantities import DAMPING, LENGTH, NO_UNIT, STIFFNESS


def closed(gap: SX, path: SX, n: SX) -> SX:
    """Return the part of the gap 1 - sgn sigma z / Fc > 0 to steady sliding that closes over sigma |dr| / Fc > 0."""
    above = n - 1.0
    power = above * path * gap**above
    arrives = power <= -1.0  # n < 1
    exact = if_else(above == 0.0, path, log1p(if_else(arrives, 0.0, power)) / if_else(above == 0.0, 1.0, above))
    return if_else(arrives, 1.0, -expm1(-exact))


@law(
    "DahlFeedforward",
    "Feedforward of inertia and Dahl friction computed from the reference",
    source="Lampaert, Swevers, Al-Bender, American Control Conference, 2004; Dahl, AIAA Journal 14(12), 1976",
    cites=("Lampaert2004", "Dahl1976"),
    Ts=1e-3,
    friction=Friction("Fc", viscous="Fv"),
    use=Use("feedforward", models=("Dahl",), tuned={"m": "0"}),
    outputs={
        "u": variables.U_FORWARD,
        "F_hat": variables.F_HAT,
        "z_hat": Output(LENGTH, "deflection of the contact in this sample"),
        "u_sat": variables.U_SAT,
    },
)
def dahl_feedforward(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    enable: SX = variables.ENABLE_STATES,
    reset: SX = variables.RESET,
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    z: SX = State(LENGTH, 0.0, "deflection of the contact", nominal=1e-5),
    last: SX = variables.LAST,
    started: SX = variables.STARTED,
    gain: SX = variables.GAIN,
    m: SX = variables.INERTIA,
    sigma: SX = Parameter(STIFFNESS, 1e5, "stiffness at zero {force}", min=1e-9),
    Fc: SX = variables.POSITIVE_FC,
    n: SX = Parameter(NO_UNIT, 1.0, "exponent of the softening, ductile above 1", min=0.0, max=100.0),
    Fv: SX = Parameter(DAMPING, 0.0, "viscous coefficient", min=0.0),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
) -> dict[str, SX]:
    """The force that moves a known mass with Dahl friction along the reference.

        dr = r - last,   last: reference in the previous sample
        w  = 1 - sgn(dr) sigma z / Fc
        n = 1:   w becomes w exp(-sigma |dr| / Fc)
        n /= 1:  |w|^(1-n) becomes |w|^(1-n) - (1 - n) sigma |dr| / Fc
        F_hat = sigma z + Fv rd,   z of the new w
        u     = clip(m rdd + gain F_hat, u_min, u_max)

    Dahl friction depends on the path only, so the step over the displacement dr is exact for any motion of the
    reference without a reversal in between. The friction model is the block Dahl, with the same parameters. Lampaert,
    Swevers, Al-Bender, American Control Conference, 2004, compare it in feedforward with the LuGre, Leuven and GMS
    models.

    Use it for small motions of bearings and guides, where friction changes within micrometres after a reversal and the
    sign of the velocity is too abrupt. It has two parameters: the level Fc and the stiffness sigma after a reversal.

    The first sample and a sample with reset start at r: dr = 0 and z = 0. While enable is false, u, F_hat, u_sat and
    the states are 0; when enable becomes true again, dr is 0, however far r has moved. While track is true, z is such
    that u = u_track, as far as |z| <= Fc/sigma. Connect u to the input f of a position controller, whose parameter m
    must then be 0. Feedforward does not change the stability of the loop.

    Limits: the model has no Stribeck effect, and z drifts under a constant force with vibration. z is the deflection of
    a contact that moves like the reference; it keeps its value after the last motion, even during a long rest. A
    reversal between two samples is missed. u_min must not exceed u_max.
    """
    dr = increment(r, last, started, reset)
    before = if_else(reset, 0.0, z)
    gap = sign(dr) * Fc / sigma - before  # distance to the deflection of steady sliding
    size, path = fabs(gap) * sigma / Fc, fabs(dr) * sigma / Fc
    moves = logic_and(path != 0.0, size != 0.0)
    moved = before + if_else(moves, gap * closed(if_else(moves, size, 1.0), path, n), 0.0)
    rest = m * rdd + gain * (Fv * rd)
    now = deflected(track, u_track, rest, gain * sigma, Fc / sigma, u_min, u_max, moved)
    return {
        **limited(m * rdd, sigma * now + Fv * rd, gain, enable, u_min, u_max),
        **when(enable, z_hat=now, z=now, last=r, started=1.0),
    }
