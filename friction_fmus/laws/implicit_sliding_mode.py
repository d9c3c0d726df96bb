"""Sliding mode with implicit discretisation."""

from casadi import SX

from friction_fmus.lawkit.law import Output, Parameter, SampleTime, law, replaces_servo
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import clip, limited
from friction_fmus.lawkit.quantities import FORCE, NO_UNIT


@law(
    "ImplicitSlidingMode",
    "First-order sliding mode without chattering, by implicit discretisation",
    source="Acary, Brogliato, Systems and Control Letters 59(5), 2010",
    cites=("AcaryBrogliato2010", "Kikuuwe2006"),
    Ts=1e-3,
    use=replaces_servo("sliding mode"),
    outputs={
        "u": variables.U_CONTROL,
        "F_hat": Output(
            FORCE, "sliding-mode {force}; while sliding with gain = 1, the friction in the previous sample"
        ),
        "u_sat": variables.U_SAT,
    },
)
def implicit_sliding_mode(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    x: SX = variables.X,
    v: SX = variables.V,
    f: SX = variables.FED_FORWARD,
    enable: SX = variables.ENABLE,
    gain: SX = Parameter(NO_UNIT, 1.0, "fraction of the sliding-mode {force}", min=0.0, max=1.0),
    m: SX = variables.MASS_OR_NONE,
    lam: SX = variables.LAM,
    K: SX = Parameter(
        FORCE, 5.0, "bound of the sliding-mode {force}, above the friction not compensated by f", min=0.0
    ),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Sliding mode that uses the sign of s in the next sample, which turns the law into a saturation.

        s     = (rd - v) + lam (r - x)
        F_hat = clip(m s/Ts, -K, K)
        u     = clip(m (rdd + lam (rd - v)) + f + gain F_hat, u_min, u_max)

    Acary, Brogliato: Implicit Euler numerical scheme and chattering-free implementation of sliding mode systems,
    Systems and Control Letters 59(5), 2010; Kikuuwe, Fujimoto: Proxy-based sliding mode control, IEEE ICRA 2006. The
    continuous law is u = m (rdd + lam (rd - v)) + K sgn(s). Its implicit Euler step without friction,

        m (s_next - s)/Ts = -K sgn(s_next),   sgn(0) = anything from -1 to 1

    has the unique solution s_next = s - Ts/m clip(m s/Ts, -K, K): |s| decreases by K Ts/m per sample and is exactly 0
    after

        n = ceil(m |s|/(K Ts))

    samples, whereas the explicit sign would oscillate permanently with the amplitude K Ts/m. With a friction force F,
    |F| <= K, the law settles at s = F Ts/m for any K, and F_hat is F in the previous sample. (This holds for gain = 1,
    and up to terms of the order lam Ts of one step of s, as r - x changes within a sample.)

    Use it for robust tracking with an upper bound of friction as the only model. Unlike in the explicit law, a bound
    that is too high does no harm. There is no state, so nothing winds up. Connect a friction feedforward without its
    inertia part to f. With gain < 1, only this fraction of the step to s = 0 is made, which is less sensitive to noise
    of v and to a mass smaller than m.

    While enable is false, u, F_hat and u_sat are 0. Without a state, u jumps when enabled unless f carries the load of
    the axis.

    Limits: within K, the law is a proportional controller with the gain of a dead-beat step, gain m/Ts on s. A delay, a
    flexible load or a true mass below gain m/2 makes it unstable, and noise of v enters u with this factor. F_hat lags
    by one sample, so the error is proportional to Ts; with ImplicitSuperTwisting, it is proportional to Ts^2. u_min
    must not exceed u_max.
    """
    ed = rd - v
    s = ed + lam * (r - x)
    return limited(m * (rdd + lam * ed) + f, clip(m * s / Ts, -K, K), gain, enable, u_min, u_max)
