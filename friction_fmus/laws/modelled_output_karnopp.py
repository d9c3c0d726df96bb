"""Cascade with command feedforward and Karnopp friction of a modelled velocity."""

from casadi import SX, exp, fabs, if_else, sign

from friction_fmus.lawkit.law import Command, Parameter, SampleTime, State, law, replaces_servo
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import clip, limited
from friction_fmus.lawkit.quantities import DAMPING, MASS, VELOCITY


@law(
    "ModelledOutputKarnopp",
    "Cascade with command feedforward and Karnopp friction of the modelled velocity",
    source="Karnopp, ASME J. Dynamic Systems, Measurement and Control 107, 1985 (the friction)",
    cites=("Karnopp1985",),
    Ts=1e-3,
    use=replaces_servo("model feedback"),
    outputs=variables.TRACKING,
)
def modelled_output_karnopp(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    x: SX = variables.X,
    v: SX = variables.V,
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and v_model = 0"),
    reset: SX = Command(False, "true: v_model = 0"),
    v_model: SX = State(VELOCITY, 0.0, "velocity of the modelled loop", nominal=1e-2),
    gain: SX = variables.GAIN,
    m: SX = Parameter(MASS, 1.0, "{mass} of the model", min=1e-12),
    KP: SX = variables.KP,
    CV: SX = Parameter(DAMPING, 127.0, "gain of the velocity loop", min=0.0),
    Kv1: SX = variables.KV1,
    Ka: SX = variables.KA,
    Kv2: SX = variables.KV2,
    Fc: SX = variables.FC,
    Fs: SX = variables.FS,
    Fv: SX = variables.FV_OF_KARNOPP,
    DV: SX = variables.DV,
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Position and velocity loop with command feedforward and friction at the velocity of a loop model.

        Vs      = KP (r - x) + Kv1 rd
        v_model = Gsys(s) Vs
        Gsys    = CV G/(1 + CV G) = 1/(1 + s m/CV)   for G = 1/(m s)
        F_hat   = clip(CV (Vs - v_model), -Fs, Fs)   for |v_model| < DV
        F_hat   = Fc sgn(v_model) + Fv v_model       otherwise
        u       = clip(CV (Vs - v) + Ka rdd + Kv2 rd + gain F_hat, u_min, u_max)

    The friction model is from Karnopp, ASME Journal of Dynamic Systems, Measurement and Control 107, 1985: inside the
    band, it balances the acting force, which is here the force of the model, m dv_model/dt = CV (Vs - v_model). The
    multi-loop structure follows a summary of a paper that was not found. v_model follows the exact solution for a
    constant Vs, v_model_next = Vs + (v_model - Vs) exp(-CV Ts/m); F_hat uses v_model before that step.

    Use it to extend the usual cascade if the velocity signal is too poor for the sign of friction, and the reference
    alone does not suffice because the position loop also moves the axis, as for steps and corrections. With Kv1 = 1 and
    Ka = mass, the modelled velocity nearly equals the reference velocity, and the law equals Karnopp friction of the
    reference; the mass of the model then hardly matters in slow motion. The compensation fails if a load that is not in
    the model moves the axis.

    F_hat depends on r - x through KP and thus closes a loop. Inside the band, it adds m s/(1 + s m/CV) KP (r - x), and
    a free mass M without friction is stable in continuous time for all positive parameters, as Routh's condition is
    satisfied:

        (M + m) (CV + 2 m KP) > M m KP

    Outside the band, F_hat is a relay of the modelled velocity, a positive feedback that real friction of at least Fc
    must balance. Compensate less if the friction is uncertain.

    While enable is false, u, F_hat, u_sat and v_model are 0; reset takes effect in the same sample. The law has no
    integral action that could carry a load, so u jumps when enabled on a loaded axis.

    Limits: v_model lags Vs by m/CV, so F_hat changes its sign late. DV must exceed the change of v_model per sample;
    otherwise, v_model skips the band and the relay oscillates at rest. A constant load leaves an error of load/(CV KP).
    u_min must not exceed u_max.
    """
    old = if_else(reset, 0.0, v_model)
    Vs = KP * (r - x) + Kv1 * rd
    drive = CV * (Vs - old)
    stuck = clip(drive, -Fs, Fs)
    F_hat = if_else(fabs(old) < DV, stuck, Fc * sign(old) + Fv * old)
    loop = CV * (Vs - v) + Ka * rdd + Kv2 * rd
    after = Vs + (old - Vs) * exp(-CV * Ts / m)
    return {
        **limited(loop, F_hat, gain, enable, u_min, u_max),
        "v_model": if_else(reset, 0.0, if_else(enable, after, 0.0)),
    }
