"""Elasto-plastic friction estimated from displacements only."""

from casadi import SX, exp, fabs, if_else, sign

from friction_fmus.lawkit.law import Command, Friction, Input, Parameter, State, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import clip, deflected, limited, starts_now
from friction_fmus.lawkit.quantities import LENGTH, NO_UNIT, STIFFNESS, VELOCITY


@law(
    "ElastoPlasticEstimator",
    "Feedback of elasto-plastic friction computed from displacements, independent of the sample time",
    source="Hayward, Armstrong, Altpeter, Dupont, IEEE TCST 17(3), 2009",
    cites=("Hayward2009", "Dupont2002"),
    Ts=1e-3,
    friction=Friction("Fc", viscous="Fv", stiffness="sigma0"),
    use=Use(
        "model feedback",
        models=("ElastoPlastic", "LuGre"),
        renamed={"sigma2": "Fv"},
        tuned={"elastic": "min(max(either(z_ba, 0.7 * (Fc / sigma0)) / (Fc / sigma0), 0), 0.99)"},
    ),
    outputs=variables.COMPENSATION,
)
def elasto_plastic_estimator(
    x: SX = variables.X,
    v: SX = Input(VELOCITY, 0.0, "measured velocity, for viscous friction only", optional=True),
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and z = 0"),
    reset: SX = Command(False, "true: z = 0"),
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    running: SX = variables.RUNNING,
    x_last: SX = State(LENGTH, 0.0, "position in the previous sample", nominal=1e-3),
    z: SX = State(LENGTH, 0.0, "elastic deflection", nominal=1e-5),
    gain: SX = variables.GAIN,
    sigma0: SX = Parameter(STIFFNESS, 1e5, "stiffness of the contact", min=1e-9),
    Fc: SX = variables.POSITIVE_FC,
    elastic: SX = Parameter(NO_UNIT, 0.7, "fraction of Fc up to which the contact is elastic", min=0.0, max=0.999),
    Fv: SX = variables.FV,
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
) -> dict[str, SX]:
    """Presliding and Coulomb friction as a function of the path, independent of velocity and sample time.

        dz/dx = 1 - alpha(z, dx) z/(z_m sgn(dx))
        z_m   = Fc/sigma0,   z_b = elastic z_m
        alpha = 0                       if z opposes the motion, or |z| <= z_b
        alpha = (|z| - z_b)/(z_m - z_b)  beyond
        F_hat = sigma0 z + Fv v,   u = clip(gain F_hat, u_min, u_max)

    Hayward, Armstrong, Altpeter, Dupont: Discrete-time elasto-plastic friction estimation, IEEE Transactions on Control
    Systems Technology 17(3), 2009 (the idea; the equations are those of the elasto-plastic model of Dupont et
    al., IEEE TAC 47(5), 2002). The linear alpha in place of the published sine is specific to this library and makes
    every sample exact. In the direction of motion, after the elastic part up to z_b, y = z_m - |z| decreases over the
    remaining path p as

        y_next = D y q/(D - y (1 - q))
        D = 2 z_m - z_b,   q = exp(-D p/(z_m (z_m - z_b)))

    so samples at any spacing give the same z on the same path, provided that they include the reversal points.

    Use it with an encoder as the only sensor, at any or at a varying sample rate, and if friction holds the axis:
    motion within z_b, such as the last digit of the encoder or vibration, moves z along a single line without drift.
    Connect u to the input f of a position controller. v is needed for Fv only.

    The first sample, a sample with reset, and the first sample after a time with enable false start with z = 0. While
    enable is false, u, F_hat, u_sat and all states are 0. While track is true, z is such that u = u_track, as far as
    |z| <= z_m.

    Limits: the model has no Stribeck effect and no lag; identify Fc at the working speed. Below break-away, the law is
    a positive feedback with the stiffness gain sigma0, which must not exceed the sum of the stiffnesses of the real
    contact and of the position loop. After a start at rest, z is unknown until the axis has moved by about 3 z_m. u_min
    must not exceed u_max.
    """
    fresh = starts_now(reset, running)
    # the difference is 0, or NaN if x is NaN
    step = x - if_else(fresh, x, x_last)
    old = if_else(fresh, 0.0, z)
    z_m = Fc / sigma0
    z_b = elastic * z_m

    along, path = sign(step) * old, fabs(step)
    free = clip(z_b - along, SX(0.0), path)
    y = z_m - (along + free)
    D = 2.0 * z_m - z_b
    q = exp(-D * (path - free) / (z_m * (z_m - z_b)))
    moved = if_else(step == 0.0, old, sign(step) * (z_m - D * y * q / (D - y * (1.0 - q))))
    after = deflected(track, u_track, gain * (Fv * v), gain * sigma0, z_m, u_min, u_max, moved)

    return {
        **limited(SX(0.0), sigma0 * after + Fv * v, gain, enable, u_min, u_max),
        "running": enable,
        "x_last": if_else(enable, x, 0.0),
        "z": if_else(enable, after, 0.0),
    }
