"""Inverse of a sampled plant with a zero, or a pair of zeros, outside the unit circle, by preview."""

from casadi import SX, floor, if_else, logic_and, logic_not, logic_or

from friction_fmus.lawkit.law import Command, Input, Output, Parameter, Size, State, Switch, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import clip, filled, limits
from friction_fmus.lawkit.quantities import FORCE, LENGTH, NO_UNIT

LONGEST = 32  # samples of preview, unless the FMU is built for more
POLES = 4
ZEROS = 2


def square(pair: SX) -> SX:
    """Return the squared absolute value of a complex number."""
    return pair[0] ** 2 + pair[1] ** 2


@law(
    "DiscreteInverse",
    "Inverse of a sampled plant, zeros outside the unit circle by preview or zero-phase (ZPETC)",
    source="Gross, Tomizuka, Messner, ASME JDSMC 116(1), 1994; Tomizuka, ASME JDSMC 109(1), 1987",
    cites=("Gross1994", "Tomizuka1987"),
    Ts=1e-3,
    use=Use("feedforward", never="It inverts a linear plant without friction."),
    outputs={
        "u": variables.U_FORWARD,
        "r_now": Output(LENGTH, "reference that the plant follows: r of preview + 1 samples earlier"),
        "u_sat": variables.U_SAT,
    },
    conditions={
        "zero = 0, |zero| > 1 or zero_phase": lambda zero, zero_phase: logic_or(
            logic_or(zero == 0.0, zero**2 > 1.0), zero_phase
        ),
        "pair = 0, |pair| > 1 or zero_phase": lambda pair, zero_phase: logic_or(
            logic_or(square(pair) == 0.0, square(pair) > 1.0), zero_phase
        ),
        "zero and pair not 1": lambda zero, pair: logic_and(zero != 1.0, logic_or(pair[0] != 1.0, pair[1] != 0.0)),
        "preview >= 2 with a pair": lambda preview, pair: logic_or(preview >= 2.0, square(pair) == 0.0),
    },
    sizes={"preview": Size(("line",), most=1024)},
)
def discrete_inverse(
    r: SX = Input(LENGTH, 0.0, "reference position, preview + 1 samples in advance"),
    enable: SX = Command(True, "false: u = 0 and the states are at their start values"),
    reset: SX = Command(False, "true: as if r had always had its present value"),
    line: SX = State(LENGTH, (0.0,) * (LONGEST + 1), "references of the previous samples, latest first"),
    w: SX = State(LENGTH, (0.0,) * POLES, "previewed references of the previous samples, latest first"),
    force: SX = State(FORCE, (0.0,) * ZEROS, "u before its limits in the previous samples, latest first"),
    started: SX = variables.STARTED,
    missed: SX = variables.MISSED,
    K: SX = Parameter(LENGTH + "/(" + FORCE + ")", 1.25e-7, "gain of the plant", min=1e-30),
    zero: SX = Parameter(NO_UNIT, -5.82842712474619, "zero outside the unit circle; 0: none"),
    pair: SX = Parameter(
        NO_UNIT, (0.0, 0.0), "real and imaginary part of a pair of zeros outside the unit circle; 0: none"
    ),
    inner: SX = Parameter(
        NO_UNIT, (-0.1715728752538099, 0.0), "zeros inside the unit circle; 0: none", min=-0.999, max=0.999
    ),
    a: SX = Parameter(NO_UNIT, (-2.0, 1.0, 0.0, 0.0), "coefficients a1 to a4 of the poles"),
    preview: SX = Parameter(NO_UNIT, 12.0, "samples N of preview", min=1.0, max=float(LONGEST)),
    zero_phase: SX = Switch(False, "ZPETC instead of the truncated series"),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
) -> dict[str, SX | list[SX]]:
    """The force with which a sampled linear plant follows a reference that is known N samples in advance.

        plant: A(q) x[k+1] = K B(q) (u[k] - zero u[k-1])
               or A(q) x[k+1] = K B(q) (u[k] - p u[k-1] + n u[k-2])
               with p = 2 pair1, n = pair1^2 + pair2^2
        A(q)  = 1 + a1 q + a2 q^2 + a3 q^3 + a4 q^4,   q x[k] = x[k-1]
        B(q)  = (1 - inner1 q) (1 - inner2 q) = 1 + b1 q + b2 q^2
        s[k]  = r_now[k+1],   r_now[k] = r[k-N-1]
        w[k]  = -(s[k+1]/zero + s[k+2]/zero^2 + ... + s[k+N]/zero^N)
        w[k]  = g2 s[k+2] + g3 s[k+3] + ... + gN s[k+N]      for a pair,
                g1 = 0, g2 = 1/n, n g[i+2] = p g[i+1] - g[i]
        w[k]  = (s[k] - zero s[k+1]) / (1 - zero)^2          if zero_phase
        w[k]  = (s[k] - p s[k+1] + n s[k+2]) / (1 - p + n)^2 for a pair
        w[k]  = s[k]                                         without such zeros
        u[k]  = A(q) w[k] / K - b1 u[k-1] - b2 u[k-2]

    A zero outside the unit circle has no stable causal inverse, but a stable inverse with preview. Truncated after N
    samples, the inverse has exactly the error

        r_now[k] - x[k] = r_now[k+N] / zero^N
        r_now[k] - x[k] = n g[N+1] r_now[k+N-1] - gN r_now[k+N]    for a pair

    Gross, Tomizuka, Messner, ASME Journal of Dynamic Systems, Measurement, and Control 116(1), 1994 (the series);
    Tomizuka, same journal 109(1), 1987 (zero phase error tracking controller, ZPETC).
    ZPETC needs only one sample of preview (two for a pair) and has no phase lag at any frequency, but the gain |1 -
    zero z^-1|^2 / (1 - zero)^2, which decreases towards high frequencies for a negative zero.

    |zero| > 1 and |pair| > 1 are required unless zero_phase is true: the series of a zero inside the circle diverges
    with N, and the series of a zero on the circle never settles. zero_phase allows zeros anywhere except at 1, where it
    divides by 0. A pair replaces zero and needs two samples of preview.

    The start values describe a mass of 1 kg after a hold with a delay of half a sample of 1 ms: zeros -3 -/+ 2 sqrt(2).

    Use it for plants with fractional delays, with more than two poles in excess of the zeros, or with an inverse
    response, where derivatives of the reference do not suffice. Give r_now, not r, to the other controllers. An error
    of 1e-6 needs N = 14 / ln|zero| samples. For N above 32, up to 1024, set the start value of preview when the FMU is
    built or the C code is generated; preview is then fixed, and a sample takes about N/32 times as long.

    In the first sample and in a sample with reset, the plant is assumed to rest at r, and u is the force that holds it
    there. While enable is false, u, u_sat, r_now and the states are 0. u jumps to this force when enabled. The limits
    do not affect the states. N is rounded down. Feedforward does not change the stability of the loop. After missing
    samples, the references lie on the line through the last sample before them and this one, and u is the force of a
    motion at this velocity.

    Limits: zeros inside the circle must be real, and at most two may be outside: a pair, or a double zero (pair2 = 0).
    N grows for zeros near the circle. Friction needs a separate law. The plant model must be accurate at all
    frequencies of r. u_min must not exceed u_max.
    """
    N = floor(preview)
    longest = line.numel() - 1
    fresh = logic_not(logic_and(started, logic_not(reset)))
    past = [r, *filled(r, [if_else(fresh, r, line[j]) for j in range(longest + 1)], missed)]
    p, n = 2.0 * pair[0], square(pair)
    paired = n > 0.0
    zero = if_else(paired, 0.0, zero)
    single = zero != 0.0
    # without if_else, of which clang computes 1/0 too
    over_n, over_zero = 1.0 / (n + (n == 0.0)), 1.0 / (zero + (zero == 0.0))

    # w[k+N], w[k+N-1], ... w[k] by w[i] - zero w[i-1] = s[i], or w[i] - p w[i-1] + n w[i-2] = s[i], solved for the last
    # term
    first, second = if_else(paired, p * over_n, over_zero), if_else(paired, -over_n, 0.0)
    later, series = SX(0.0), SX(0.0)
    after, now, ahead, beyond = past[:1] * 4  # N + 1, N, N - 1 and N - 2 samples earlier
    for j in range(longest):
        within = j < N if longest == LONGEST else SX(1.0)  # otherwise every sample counts
        newer = if_else(paired, over_n * past[j - 1] if j else 0.0, -over_zero * past[j])
        found = first * series + second * later + newer
        later, series = if_else(within, series, later), if_else(within, found, series)
        after, now = if_else(within, past[j + 2], after), if_else(within, past[j + 1], now)
        ahead, beyond = if_else(within, past[j], ahead), if_else(within, past[max(j - 1, 0)], beyond)
    gap = 1.0 - zero - p + n
    even = (now - (zero + p) * ahead + n * beyond) / (gap + (gap == 0.0)) ** 2
    w_now = if_else(zero_phase, even, if_else(logic_or(paired, single), series, now))
    again = logic_or(fresh, missed > 0.0)  # w and u of a motion at constant velocity
    change = (past[0] - past[1]) / (gap + (gap == 0.0))
    w_past = [if_else(again, w_now - (i + 1.0) * change, w[i]) for i in range(POLES)]

    b = -(inner[0] + inner[1]), inner[0] * inner[1]
    stiffness = (1.0 + a[0] + a[1] + a[2] + a[3]) / (1.0 + b[0] + b[1]) / K
    damping = (a[0] + 2.0 * a[1] + 3.0 * a[2] + 4.0 * a[3]) / (1.0 + b[0] + b[1]) / K
    lag = (b[0] + 2.0 * b[1]) / (1.0 + b[0] + b[1])
    hold = [stiffness * (w_now + (lag - (i + 1.0)) * change) - damping * change for i in range(ZEROS)]
    u_past = [if_else(again, hold[i], force[i]) for i in range(ZEROS)]
    wanted = (w_now + sum(a[i] * w_past[i] for i in range(POLES))) / K - sum(b[i] * u_past[i] for i in range(ZEROS))

    def kept(values: list[SX]) -> list[SX]:
        return [if_else(enable, value, 0.0) for value in values]

    return {
        "u": if_else(enable, clip(wanted, u_min, u_max), 0.0),
        "u_sat": if_else(enable, limits(wanted, u_min, u_max), 0.0),
        "r_now": if_else(enable, after, 0.0),
        "line": kept(past[: longest + 1]),
        "w": kept([w_now, *w_past[: POLES - 1]]),
        "force": kept([wanted, *u_past[: ZEROS - 1]]),
        "started": if_else(enable, 1.0, 0.0),
        "missed": SX(0.0),
    }
