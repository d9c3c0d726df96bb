"""Feedforward of inertia and Karnopp friction from the reference."""

from casadi import SX, fabs, if_else, logic_or, sign

from friction_fmus.lawkit.law import Friction, Parameter, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import clip, limited
from friction_fmus.lawkit.quantities import MASS, VELOCITY


@law(
    "KarnoppFeedforward",
    "Feedforward of inertia and Karnopp friction computed from the reference",
    source="Karnopp, ASME Journal of Dynamic Systems, Measurement, and Control 107(1), 1985; Johnson, Lorenz, 1992",
    cites=("Karnopp1985", "JohnsonLorenz1992"),
    Ts=1e-3,
    friction=Friction("Fc", "Fs", "Fv"),
    use=Use(
        "feedforward",
        models=("Karnopp", "Stribeck"),
        tuned={"m": "0", "DV": "either(DV, max(5 * v_noise, 1e-3 * speed, 1e-9))"},
    ),
    outputs=variables.FEEDFORWARD,
)
def karnopp_feedforward(
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    enable: SX = variables.ENABLE,
    gain: SX = variables.GAIN,
    m: SX = Parameter(MASS, 1.0, "{mass}, for the inertia feedforward and for the {force} at rest", min=0.0),
    Fc: SX = variables.FC,
    Fs: SX = variables.FS,
    Fv: SX = variables.FV,
    DV: SX = Parameter(VELOCITY, 1e-3, "half width of the velocity band treated as standstill", min=0.0),
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
) -> dict[str, SX]:
    """Inertia force and Karnopp friction along the reference.

        |rd| <  DV:  F_hat = clip(m rdd, -Fs, Fs)
        |rd| >= DV:  F_hat = Fc sgn(rd) + Fv rd
        u = clip(m rdd + gain F_hat, u_min, u_max)

    The friction model is the block Karnopp (Karnopp, ASME Journal of Dynamic Systems, Measurement, and Control 107(1),
    1985) with the inertia force m rdd as external force: in the band, friction balances this force, up to Fs. With DV =
    0, the band is rd = 0. Johnson and Lorenz (IEEE Transactions on Industry Applications 28(6), 1992) compensate with
    this model in feedforward and in feedback.

    Use it if the reference starts and stops and friction at rest must not be compensated by a sign: F_hat follows the
    force needed for the start, and jumps at the edges of the band instead of at rd = 0.

    Connect u to the input f of a position controller, whose parameter m must then be 0. While enable is false, u, F_hat
    and u_sat are 0. The law has no state, so u jumps when enabled in motion. Feedforward does not change the stability
    of the loop.

    For feedback, connect rd to the measured velocity. DV must then also exceed its noise and the velocity of
    oscillations in presliding; otherwise F_hat, a relay of the velocity, makes the axis oscillate at rest.

    Limits: F_hat jumps at |rd| = DV by Fc + Fv DV minus the force in the band. In the band, nothing is compensated at
    constant velocity, so DV must be below the slowest relevant speed. Presliding is not modelled. u_min must not exceed
    u_max.
    """
    force = m * rdd
    rest = logic_or(fabs(rd) < DV, rd == 0.0)
    F_hat = if_else(rest, clip(force, -Fs, Fs), sign(rd) * Fc + Fv * rd)
    return limited(force, F_hat, gain, enable, u_min, u_max)
