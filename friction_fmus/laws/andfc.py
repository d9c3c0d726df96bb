"""Adaptive compensation of dynamic friction with a position measurement only."""

from casadi import SX, exp, fabs, if_else

from friction_fmus.lawkit.law import Command, Output, Parameter, SampleTime, State, law, replaces_servo
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import (
    clip,
    deflected,
    elapsed,
    limited,
    relaxed,
    starts_now,
    stribeck_level,
    unless_winding_up,
)
from friction_fmus.lawkit.quantities import DAMPING, FORCE, LENGTH, NO_UNIT, VELOCITY


@law(
    "ANDFC",
    "Adaptive LuGre compensation with dual observers and an estimated velocity",
    source="Tan, Kanellakopoulos, American Control Conference, 1999",
    cites=("TanKanellakopoulos1999",),
    Ts=1e-3,
    use=replaces_servo("model feedback"),
    outputs={
        **variables.TRACKING,
        "theta_0": Output(NO_UNIT, "estimated factor of sigma0"),
        "theta_1": Output(NO_UNIT, "estimated factor of sigma0 sigma1"),
        "theta_2": Output(NO_UNIT, "estimated factor of sigma1 + sigma2"),
        "v_est": Output(VELOCITY, "estimated velocity"),
    },
)
def andfc(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    x: SX = variables.X,
    u_prev: SX = variables.U_PREV,
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and all states are at their start values"),
    reset: SX = Command(False, "true: all states are reset to their start values"),
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    running: SX = variables.RUNNING,
    missed: SX = variables.MISSED,
    x_hat: SX = variables.X_HAT,
    v_hat: SX = variables.V_HAT,
    F_last: SX = State(FORCE, 0.0, "friction of the model in the previous sample"),
    z0: SX = State(LENGTH, 0.0, "bristle deflection, observed for theta_0", nominal=1e-5),
    z1: SX = State(LENGTH, 0.0, "bristle deflection, observed for theta_1", nominal=1e-5),
    learned0: SX = State(NO_UNIT, 0.0, "theta_0 - 1"),
    learned1: SX = State(NO_UNIT, 0.0, "theta_1 - 1"),
    learned2: SX = State(NO_UNIT, 0.0, "theta_2 - 1"),
    gain: SX = variables.GAIN,
    m: SX = variables.POSITIVE_MASS,
    wo: SX = Parameter("rad/s", 1000.0, "bandwidth of the velocity observer", min=0.0),
    lam: SX = variables.LAM,
    Ks: SX = Parameter(DAMPING, 127.0, "gain of s", min=0.0),
    k0: SX = Parameter(NO_UNIT, 0.02, "injection of s into z0", min=0.0),
    k1: SX = Parameter(DAMPING, 0.5, "injection of s into z1", min=0.0),
    Gamma0: SX = Parameter("1/(" + FORCE + "." + LENGTH + ")", 2000.0, "rate of adaptation of theta_0", min=0.0),
    Gamma1: SX = Parameter("1/(" + FORCE + "." + LENGTH + ")", 20.0, "rate of adaptation of theta_1", min=0.0),
    Gamma2: SX = Parameter("1/(" + FORCE + "." + LENGTH + ")", 20.0, "rate of adaptation of theta_2", min=0.0),
    theta_max: SX = Parameter(NO_UNIT, 3.0, "upper limit of each theta and of friction over max(Fc, Fs)", min=1.0),
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
    """Adaptive compensation of LuGre friction with a position measurement only.

    An observer with two equal poles at p = exp(-wo Ts) estimates velocity and position of the mass:

        x_p   = x_hat + Ts v_hat + Ts^2/(2 m) (u_prev - F_last)
        v_p   = v_hat + Ts/m (u_prev - F_last)
        x_hat = x_p + (1 - p^2) (x - x_p),   v_hat = v_p + (1 - p)^2/Ts (x - x_p)

    Friction is the sum of three terms with separate factors theta, from two observers of the bristle deflection:

        s      = (rd - v_hat) + lam (r - x),   a = |v_hat|/g(v_hat)
        z0'    = v_hat - sigma0 a z0 + k0 s
        z1'    = v_hat - sigma0 a z1 - k1 a s
        f_0    = sigma0 z0,   f_1 = -sigma0 sigma1 a z1
        f_2    = (sigma1 + sigma2) v_hat
        F_hat  = theta_0 f_0 + theta_1 f_1 + theta_2 f_2
        w      = m (rdd + lam (rd - v_hat)) + Ks s + gain F_hat
        u      = clip(w, u_min, u_max)
        theta_i_next = theta_i + Ts Gamma_i s f_i,  within 0 and theta_max

    Tan, Kanellakopoulos: Adaptive nonlinear friction compensation with parametric uncertainties, American Control
    Conference, 1999 (the dual observers; the velocity observer and the scaling are this library's). g(v) =
    Fc + (Fs - Fc) exp(-|v/vs|^delta); z0 and z1 follow the exact solution for constant inputs. F_last is F_hat in the
    previous sample. F_hat is limited to theta_max max(Fc, Fs) + sigma2 |v_hat|, as wrong factors would otherwise make
    the observer unstable. Adaptation and injection stop while u is limited and s pushes further into that limit.

    The signs are for s = rd - v + lam e (publications often use -s). With the true factors th_i and the true deflection
    z,

        V  = m s^2/2 + th_0 sigma0 (z - z0)^2/(2 k0)
             + th_1 sigma0 sigma1 (z - z1)^2/(2 k1)
             + sum (th_i - theta_i)^2/(2 Gamma_i)
        V' = -Ks s^2 - a sigma0 (th_0 sigma0 (z - z0)^2/k0
             + th_1 sigma0 sigma1 (z - z1)^2/k1)

    in continuous time and for the true velocity. With k0 = 0 or k1 = 0 that observer has no injection, and its error
    decays during any motion. In sampled time, the sum of Gamma_i f_i^2 Ts and of the injections sigma0 k0 Ts and sigma1
    a k1 must stay below Ks, with a margin for the lag of the velocity. f_1 and f_2 grow with speed, like sigma1 |v|,
    and nearly cancel, so choose Gamma1 and Gamma2 far below Gamma0.

    Use it on axes with an encoder as the only sensor, if load and lubrication change stiffness, damping and level of
    friction independently; AdaptiveLuGre has a single factor and needs the velocity. u_prev is the force after all
    limits; in a system, it is the input F_ext of the plant.

    The first sample after the start, a reset or a time with enable false adopts x and assumes rest. While enable is
    false, u, F_hat, u_sat, v_est and all states are 0 and each theta is 1. While track is true, each theta is held and
    z0 is such that w = u_track, as far as |z0| <= g(v_hat)/sigma0: the law takes over friction, but no load.

    Limits: the factors converge to their true values only with a reference that excites them; tracking does not require
    this. Fc, Fs and vs are not adapted separately. A wrong mass causes an error of the velocity. u_min must not exceed
    u_max.
    """
    fresh = starts_now(reset, running)
    span = elapsed(missed, Ts)
    p = exp(-wo * span)
    force = (u_prev - F_last) / m
    x_p = x_hat + span * v_hat + span**2 / 2.0 * force
    v_p = v_hat + span * force
    position = if_else(fresh, x, x_p + (1.0 - p**2) * (x - x_p))
    v = if_else(fresh, 0.0, v_p + (1.0 - p) ** 2 / span * (x - x_p))

    a1 = if_else(fresh, 0.0, z1)
    thetas = [1.0 + if_else(fresh, 0.0, part) for part in (learned0, learned1, learned2)]
    level = stribeck_level(fabs(v), Fc, Fs, vs, delta)
    flow = fabs(v) / level
    ed = rd - v
    s = ed + lam * (r - x)
    tracking = m * (rdd + lam * ed) + Ks * s
    others = [-sigma0 * sigma1 * flow * a1, (sigma1 + sigma2) * v]
    rest = tracking + gain * (thetas[1] * others[0] + thetas[2] * others[1])
    stiffness, kept = gain * thetas[0] * sigma0, if_else(fresh, 0.0, z0)
    most = level / sigma0
    a0 = deflected(track, u_track, rest, stiffness, most, u_min, u_max, kept)
    parts = [sigma0 * a0, *others]
    bound = theta_max * if_else(Fs > Fc, Fs, Fc) + sigma2 * fabs(v)
    friction = clip(thetas[0] * parts[0] + thetas[1] * parts[1] + thetas[2] * parts[2], -bound, bound)

    outputs = limited(tracking, friction, gain, enable, u_min, u_max)
    heard = unless_winding_up(s, outputs["u_sat"])
    speeds = (Gamma0, Gamma1, Gamma2)
    after = [
        if_else(track, theta, clip(theta + Ts * speed * heard * part, SX(0.0), theta_max))
        for theta, speed, part in zip(thetas, speeds, parts, strict=True)
    ]
    return {
        **outputs,
        **{f"theta_{i}": if_else(enable, theta, 1.0) for i, theta in enumerate(thetas)},
        "v_est": if_else(enable, v, 0.0),
        "running": enable,
        "missed": SX(0.0),
        "x_hat": if_else(enable, position, 0.0),
        "v_hat": if_else(enable, v, 0.0),
        "F_last": if_else(enable, friction, 0.0),
        "z0": if_else(enable, relaxed(a0, v + k0 * heard, sigma0 * flow, Ts), 0.0),
        "z1": if_else(enable, relaxed(a1, v - k1 * flow * heard, sigma0 * flow, Ts), 0.0),
        **{f"learned{i}": if_else(enable, theta - 1.0, 0.0) for i, theta in enumerate(after)},
    }
