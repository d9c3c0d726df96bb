"""LuGre friction compensation with adaptation to the normal force."""

from casadi import SX, fabs, if_else, logic_and

from friction_fmus.lawkit.law import Command, Output, Parameter, SampleTime, State, law, replaces_servo
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import adapted, deflected, limited, relaxed, restarts, stribeck_level
from friction_fmus.lawkit.quantities import DAMPING, FORCE, LENGTH, NO_UNIT


@law(
    "AdaptiveLuGre",
    "Tracking control with LuGre friction compensation that adapts to the normal force",
    source="Canudas de Wit, Lischinsky, Int. J. Adaptive Control and Signal Processing 11, 1997",
    cites=("CanudasLischinsky1997",),
    Ts=1e-3,
    use=replaces_servo("model feedback"),
    outputs={
        **variables.TRACKING,
        "theta": Output(NO_UNIT, "estimated normal force relative to the normal force of the parameters"),
    },
    conditions={
        "theta_min <= theta0 <= theta_max": lambda theta_min, theta0, theta_max: logic_and(
            theta_min <= theta0, theta0 <= theta_max
        )
    },
)
def adaptive_lugre(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    x: SX = variables.X,
    v: SX = variables.V,
    enable: SX = Command(True, "false: u = 0, F_hat = 0, z = 0 and theta = theta0"),
    reset: SX = Command(False, "true: z = 0 and theta = theta0"),
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    z: SX = State(LENGTH, 0.0, "observed mean bristle deflection", nominal=1e-5),
    learned: SX = State(NO_UNIT, 0.0, "theta - theta0"),
    gain: SX = variables.GAIN,
    m: SX = variables.MASS_OR_NONE,
    lam: SX = variables.LAM,
    Ks: SX = Parameter(DAMPING, 127.0, "gain of s", min=0.0),
    Gamma: SX = Parameter("1/(" + FORCE + "." + LENGTH + ")", 2000.0, "rate of adaptation; 0: none", min=0.0),
    theta0: SX = Parameter(NO_UNIT, 1.0, "initial theta"),
    theta_min: SX = Parameter(NO_UNIT, 0.0, "lower limit of theta"),
    theta_max: SX = Parameter(NO_UNIT, 10.0, "upper limit of theta"),
    sigma0: SX = variables.SIGMA0,
    sigma1: SX = variables.SIGMA1,
    sigma2: SX = variables.SIGMA2,
    Fc: SX = variables.POSITIVE_FC,
    Fs: SX = variables.POSITIVE_FS,
    vs: SX = variables.VS,
    delta: SX = variables.DELTA,
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Tracking control of a mass with LuGre friction that is known except for the normal force.

        s          = (rd - v) + lam (r - x)
        z'         = v - sigma0 |v|/g(v) z
        g(v)       = Fc + (Fs - Fc) exp(-|v/vs|^delta)
        F_n        = sigma0 z + sigma1 z'
        F_hat      = theta F_n + sigma2 v
        w          = m (rdd + lam (rd - v)) + Ks s + gain F_hat
        u          = clip(w, u_min, u_max)
        theta_next = theta + Ts Gamma s F_n,  within theta_min and theta_max
        theta_next = theta while u is limited and s pushes further into that limit

    Canudas de Wit, Lischinsky: Adaptive friction compensation with partially known dynamic friction model,
    International Journal of Adaptive Control and Signal Processing 11, 1997. As far as remembered, the paper adapts
    with the position error under a condition of positive realness. With s, the error has relative degree one, and the
    condition is not needed. z follows the exact solution for constant velocity, as in LuGreObserver; F_n in a sample
    uses z before that step.

    In continuous time, with s' m = -Ks s + (theta_true - theta) F_n and the exact z,

        V = m s^2/2 + (theta_true - theta)^2/(2 Gamma),   V' = -Ks s^2

    In sampled time, for constant F_n and up to terms of the order lam Ts, the loop is stable for

        Gamma F_n^2 Ts < Ks,   2 Ks Ts/m < 4 + Gamma F_n^2 Ts^2/m

    The adaptation settles without oscillation for Gamma F_n^2 < Ks^2/(4 m). A slow adaptation has the time constant
    Ks/(Gamma F_n^2), which is 60 ms with the start values.

    Use it if load, wear or lubrication scale the complete dry friction of an axis whose LuGre parameters are known at
    one load. The reference must move, as theta adapts during motion only. The law is a complete controller with Kp = Ks
    lam, Kd = Ks + m lam and no integral action.

    While enable is false, u, F_hat and u_sat are 0, z = 0 and theta = theta0; reset takes effect in the same sample.
    While track is true, theta is held and z is such that w = u_track, as far as |z| <= g(v)/sigma0: the law takes over
    friction, but no load.

    Limits: at rest within the stiction band, F_n cannot be observed from v alone, and theta integrates s until the axis
    breaks away or theta reaches theta_max. Errors of the mass or of sigma2 bias theta. theta_min <= theta0 <= theta_max
    and u_min <= u_max are required.
    """
    theta = theta0 + if_else(reset, 0.0, learned)
    e, ed = r - x, rd - v
    s = ed + lam * e

    level = stribeck_level(fabs(v), Fc, Fs, vs, delta)
    rate = sigma0 * fabs(v) / level
    tracking = m * (rdd + lam * ed) + Ks * s
    rest, stiffness = tracking + gain * ((theta * sigma1 + sigma2) * v), gain * theta * (sigma0 - sigma1 * rate)
    kept = if_else(reset, 0.0, z)
    most = level / sigma0
    old = deflected(track, u_track, rest, stiffness, most, u_min, u_max, kept)
    F_n = sigma0 * old + sigma1 * (v - rate * old)
    F_hat = theta * F_n + sigma2 * v
    outputs = limited(tracking, F_hat, gain, enable, u_min, u_max)

    runs = if_else(restarts(reset, track), 0.0, enable)
    after = adapted(theta, Gamma * s * F_n, s, outputs["u_sat"], theta_min, theta_max, Ts)
    return {
        **outputs,
        "theta": if_else(enable, theta, theta0),
        "z": if_else(runs, relaxed(old, v, rate, Ts), 0.0),
        "learned": if_else(runs, if_else(track, theta, after) - theta0, 0.0),
    }
