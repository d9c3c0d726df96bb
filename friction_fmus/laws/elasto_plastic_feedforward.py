"""Feedforward of inertia and elasto-plastic friction from the reference."""

import math

from casadi import SX, atan2, cos, expm1, fabs, if_else, log1p, logic_and, sign, sin

from friction_fmus.lawkit.law import Friction, Output, Parameter, SampleTime, State, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import (
    at_most,
    deflected,
    elapsed,
    fading,
    increment,
    limited,
    relax,
    stribeck_level,
    when,
)
from friction_fmus.lawkit.quantities import LENGTH, VELOCITY


def approach(y: SX, k: SX, p: SX) -> SX:
    """Return the distance to steady sliding after the path p from the distance y, relative to that at break-away.

    With k = 1 - z_ba / z_max, dy/dp = -sin^2(pi y/2) - k y cos^2(pi y/2). A substitution makes this nearly linear: c =
    cot(pi y/2) has dc/dp = pi/2 + k c^2 atan(1/c), which tends to k c, and a, defined by 1 + 2 k c / pi = exp(k a), has

        da/dp = 1 - (2 k / pi) (c - c^2 atan(1/c)) / exp(k a)

    Five Runge-Kutta steps then have an error of 1e-5 of the range of y for all y, k and p (compared with a solution of
    the differential equation to 1e-12). y decreases at least like exp(-k p) and is negligible from k p = 45 on.
    """

    def rate(a: SX) -> SX:
        grown = expm1(at_most(k * a, 80.0))
        c = 0.5 * math.pi / k * grown
        return 1.0 - 2.0 * k / math.pi * (c - c**2 * atan2(1.0, c)) / (1.0 + grown)

    a = log1p(2.0 * k / math.pi * cos(0.5 * math.pi * y) / sin(0.5 * math.pi * y)) / k
    first = at_most(p, 2.0)
    for step in (*[first / 4.0] * 4, at_most(p - first, 6.0)):
        k1 = rate(a)
        k2 = rate(a + 0.5 * step * k1)
        k3 = rate(a + 0.5 * step * k2)
        k4 = rate(a + step * k3)
        a += step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    a += if_else(p > 8.0, p - 8.0, 0.0)
    return if_else(k * p > 45.0, 0.0, 2.0 / math.pi * atan2(1.0, 0.5 * math.pi / k * expm1(at_most(k * a, 80.0))))


def slid(z: SX, u: SX, z_max: SX, z_ba: SX) -> SX:
    """Return the deflection in the direction of motion after the path u at constant z_max: elastic, then plastic."""
    begin = if_else(z_ba < z_max, z_ba, z_max)
    room = begin - z
    elastic = if_else(room > 0.0, room, 0.0)
    entered, rest = if_else(room > 0.0, begin, z), u - elastic
    # these are positive where they are used; fabs shows that they are not -0.0, which saves operations in generated C
    width, distance = fabs(z_max - begin), fabs(z_max - entered)
    between = logic_and(entered < z_max, rest > 0.0)
    span = if_else(between, width, 1.0)
    y, k = if_else(between, distance / span, 1.0), if_else(between, fabs(width / z_max), 1.0)
    plastic = z_max - width * approach(y, k, if_else(between, rest / span, 0.0))
    beyond = relax(entered, z_max, if_else(rest > 0.0, rest, 0.0) / z_max)
    return if_else(rest <= 0.0, z + u, if_else(between, plastic, beyond))


@law(
    "ElastoPlasticFeedforward",
    "Feedforward of inertia and elasto-plastic friction computed from the reference",
    source="Dupont, Hayward, Armstrong, Altpeter, IEEE TAC 47(5), 2002",
    cites=("Dupont2002",),
    Ts=1e-3,
    friction=Friction("Fc", "Fs", "sigma2", "vs", "delta"),
    use=Use("feedforward", models=("ElastoPlastic",), tuned={"m": "0"}),
    outputs={
        "u": variables.U_FORWARD,
        "F_hat": variables.F_HAT,
        "z_hat": Output(LENGTH, "mean bristle deflection in this sample"),
        "u_sat": variables.U_SAT,
    },
)
def elasto_plastic_feedforward(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
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
    v_d: SX = Parameter(VELOCITY, 0.0, "speed at which the bristle damping decays; 0: constant damping", min=0.0),
    z_ba: SX = Parameter(LENGTH, 0.7e-5, "break-away deflection, below Fc/sigma0", min=0.0),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """The force that moves a known mass with elasto-plastic friction along the reference.

        S(v)  = Fc + (Fs - Fc) exp(-|v/vs|^delta)
        dr    = r - last,   w = dr / Ts,   last: reference in the previous sample
        dz/dr = 1 - alpha(z, sgn(dr)) sgn(dr) sigma0 z / S(w)     over dr
        dz/dt = rd (1 - alpha(z, sgn(rd)) sgn(rd) sigma0 z / S(rd))
        F_hat = sigma0 z + sigma1(rd) dz/dt + sigma2 rd
        u     = clip(m rdd + gain F_hat, u_min, u_max)

    Dupont, Hayward, Armstrong, Altpeter, IEEE TAC 47(5), 2002. alpha, sigma1(v) and the parameters are the same as in
    the block ElastoPlastic: alpha is 0 up to the break-away deflection z_ba and for motion against the deflection, 1
    beyond S/sigma0, and a half sine in between.

    z advances by the displacement of the reference since the previous sample, as if the velocity had been constant:
    exactly for an elastic contact, with an error of about 2e-5 (S/sigma0 - z_ba) in the half sine.

    Use it instead of LuGreFeedforward if the reference rests or moves by less than z_ba in small steps and F_hat must
    not drift: z then equals the displacement.

    The first sample and a sample with reset start at r: dr = 0 and z = 0. While enable is false, u, F_hat, u_sat and
    the states are 0; when enable becomes true again, dr is 0, however far r has moved. While track is true, z is such
    that u = u_track, as far as |z| <= z_ba. Connect u to the input f of a position controller, whose parameter m must
    then be 0. Feedforward does not change the stability of the loop.

    Limits: choose 0 < z_ba < min(Fc, Fs)/sigma0; a larger z_ba is replaced by S/sigma0. A jump of rd causes a jump of
    F_hat by sigma1 times the jump of rd, as in LuGreFeedforward. A reversal between two samples is missed. u_min must
    not exceed u_max.
    """
    dr = increment(r, last, started, reset)
    side = sign(dr)
    z_max = stribeck_level(fabs(dr / elapsed(missed, Ts)), Fc, Fs, vs, delta) / sigma0
    before = if_else(reset, 0.0, z)
    moved = if_else(dr == 0.0, before, side * slid(side * before, fabs(dr), z_max, z_ba))

    steady = stribeck_level(fabs(rd), Fc, Fs, vs, delta) / sigma0
    damping = fading(sigma1, rd, v_d)
    # up to the break-away deflection, where alpha = 0
    rest, elastic = m * rdd + gain * ((damping + sigma2) * rd), at_most(z_ba, steady)
    now = deflected(track, u_track, rest, gain * sigma0, elastic, u_min, u_max, moved)
    along = sign(rd) * now
    inside = logic_and(along > z_ba, along < steady)
    phase = 0.5 * math.pi * (along - z_ba) / if_else(inside, fabs(steady - z_ba), 1.0)
    alpha = if_else(inside, sin(phase) ** 2, along >= steady)
    stretching = rd * (1.0 - alpha * along / steady)
    friction = sigma0 * now + damping * stretching + sigma2 * rd
    return {
        **limited(m * rdd, friction, gain, enable, u_min, u_max),
        **when(enable, z_hat=now, z=now, last=r, started=1.0),
        "missed": SX(0.0),
    }
