"""Disturbance observer with the inverse model of a mass."""

from math import pi, sqrt

from casadi import SX, cos, exp, expm1, if_else, logic_and, logic_not, sin

from friction_fmus.lawkit.law import Command, Input, Output, Parameter, SampleTime, State, Switch, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import carried, clip, elapsed, limited, starts_now
from friction_fmus.lawkit.quantities import FORCE, FREQUENCY, VELOCITY


@law(
    "DisturbanceObserver",
    "Disturbance observer: inverse model of a {mass} and a low-pass filter of order 1 or 2",
    source="Ohnishi, Shibata, Murakami, IEEE/ASME Trans. Mechatronics 1(1), 1996",
    cites=("Ohnishi1996", "Jamaludin2009"),
    Ts=1e-3,
    use=Use("estimator", tuned={"m": "m", "fq": "corner", "second_order": "1"}),
    outputs={
        "u": variables.U_COMPENSATION,
        "F_hat": Output(FORCE, "estimated friction {force} without the part compensated by f_prev"),
        "u_sat": variables.U_SAT,
    },
)
def disturbance_observer(
    v: SX = variables.V,
    u_prev: SX = variables.U_PREV,
    f_prev: SX = Input(FORCE, 0.0, "part of u_prev that already compensates friction", optional=True),
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and the observer is at its start values"),
    reset: SX = Command(False, "true: the observer restarts"),
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    d: SX = State(FORCE, 0.0, "estimated disturbance"),
    d_rate: SX = State(FORCE, 0.0, "time derivative of d divided by 2 pi fq, for order 2"),
    v_last: SX = State(VELOCITY, 0.0, "velocity in the previous sample", nominal=1e-2),
    running: SX = variables.RUNNING,
    missed: SX = variables.MISSED,
    gain: SX = variables.GAIN,
    m: SX = variables.MASS_OR_NONE,
    fq: SX = Parameter(FREQUENCY, 30.0, "corner frequency of the low-pass filter", min=0.0),
    second_order: SX = Switch(False, "low-pass filter of order 2 with damping 1/sqrt(2)"),
    u_min: SX = variables.starting(variables.U_MIN, -100.0),
    u_max: SX = variables.starting(variables.U_MAX, 100.0),
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Low-pass filtered disturbance force on a mass, from its inverse model.

        F_m   = u_prev - f_prev - m (v - v_last)/Ts,   mean of the last interval
        F_hat = Q F_m
        Q     = w/(s + w)  or  w^2/(s^2 + sqrt(2) w s + w^2),   w = 2 pi fq
        u     = clip(gain F_hat, u_min, u_max)

    Q is integrated exactly for F_m constant over the interval:

        order 1:  d = d + (1 - exp(-w Ts)) (F_m - d)
        order 2:  y = d - F_m,  p = d'/w,  q = w Ts/sqrt(2)
                  d = F_m + exp(-q) (y (cos q + sin q) + sqrt(2) p sin q)
                  p = exp(-q) (p (cos q - sin q) - sqrt(2) y sin q)

    Ohnishi, Shibata, Murakami: Motion control for advanced mechatronics, IEEE/ASME Transactions on Mechatronics 1(1),
    1996 (the observer); Jamaludin, Van Brussel, Swevers, IEEE Transactions on Industrial Electronics 56(10), 2009 (with
    friction feedforward, in machine tools). Only the idea is from these papers; the equations are derived here.

    Use it together with a position controller and, optionally, a friction feedforward: connect u to the input f of the
    controller, and the feedforward's part of u_prev to f_prev, so that only the remaining friction is estimated. u_prev
    is the force after all limits, so that nothing winds up if the actuator saturates. In a system file, the connections
    to u_prev and f_prev need a delay. With order 1, the law equals PredictiveFilter with a = 1 - exp(-w Ts) in every
    sample.

    For friction that grows at the rate c, the estimate of order 1 lags by c Ts (1/a - 1/2). The first sample and a
    sample with reset set F_hat to 0. While enable is false, u, F_hat, u_sat and all states are 0. While track is true,
    p = 0 and F_hat is such that u = u_track, within the limits; with gain = 0 it is not changed.

    The loop is stable if |Q D| < 1 at all frequencies, where D is the relative error of the inverse model. In
    presliding, the plant is 1/(m s^2 + Kt), and D is not small: stability then depends on the poles of the loop with
    the contact stiffness Kt, which are stable but slow under PD control. With gain 1 and order 1, a freely sliding mass
    M gives the pole 1 - (1 - exp(-w Ts)) m/M.

    Limits: velocity noise appears in F_hat with the factor m w and, from sample to sample, with m/Ts (1 - exp(-w Ts)).
    With a wrong mass, F_hat contains the difference of the inertia forces. u_min must not exceed u_max.
    """
    new = starts_now(reset, running)
    span = elapsed(missed, Ts)
    F_m = if_else(new, 0.0, u_prev - f_prev) - m * (v - if_else(new, v, v_last)) / span
    w_Ts = 2.0 * pi * fq * span
    old = if_else(new, 0.0, d)
    first = old - expm1(-w_Ts) * (F_m - old)
    q = w_Ts / sqrt(2.0)
    y, p_old = old - F_m, if_else(new, 0.0, d_rate)
    second = F_m + exp(-q) * (y * (cos(q) + sin(q)) + sqrt(2.0) * p_old * sin(q))
    p = exp(-q) * (p_old * (cos(q) - sin(q)) - sqrt(2.0) * y * sin(q))
    F_hat = carried(track, clip(u_track, u_min, u_max), SX(0.0), gain, if_else(second_order, second, first))
    return {
        **limited(SX(0.0), F_hat, gain, enable, u_min, u_max, track, u_track),
        "d": if_else(enable, F_hat, 0.0),
        "d_rate": if_else(enable, if_else(logic_and(second_order, logic_not(track)), p, 0.0), 0.0),
        "v_last": if_else(enable, v, 0.0),
        "running": enable,
        "missed": SX(0.0),
    }
