"""Friction feedback with observed forces of generalised Maxwell slip elements."""

from casadi import SX, exp, fabs, if_else, logic_and, logic_not

from friction_fmus.lawkit.law import Command, Friction, Parameter, SampleTime, Use, law
from friction_fmus.lawkit.parts import maxwell_slip, variables
from friction_fmus.lawkit.parts.expressions import deflected, limited, restarts, stribeck_level
from friction_fmus.lawkit.parts.maxwell_slip import ELEMENTS, slide, weights


@law(
    "GMSObserver",
    "Friction feedback with observed {force}s of generalised Maxwell slip elements",
    source="Al-Bender, Lampaert, Swevers, IEEE TAC 50(11), 2005 (model); this library (observer)",
    cites=("AlBender2005", "CanudasDeWit1995"),
    Ts=1e-3,
    friction=Friction("Fc", "Fs", "sigma2", "vs", "delta", stiffness="sum(k)"),
    use=Use("model feedback", models=("GMS",)),
    outputs=variables.COMPENSATION,
    conditions=maxwell_slip.CONDITIONS,
)
def gms_observer(
    r: SX = variables.R,
    x: SX = variables.X,
    v: SX = variables.V,
    enable: SX = Command(True, "false: u = 0, F_hat = 0 and the elements are at their start values"),
    reset: SX = Command(False, "true: the elements are reset to their start values"),
    track: SX = variables.TRACK,
    u_track: SX = variables.U_TRACK,
    Fi: SX = maxwell_slip.FI,
    slipping: SX = maxwell_slip.SLIPPING,
    way: SX = maxwell_slip.WAY,
    gain: SX = variables.GAIN,
    k_e: SX = Parameter("1/s", 0.0, "injection of the position error; 0: observer without correction", min=0.0),
    N: SX = maxwell_slip.N,
    k: SX = maxwell_slip.K,
    alpha: SX = maxwell_slip.ALPHA,
    C: SX = maxwell_slip.C,
    sigma2: SX = variables.SIGMA2,
    Fc: SX = variables.POSITIVE_FC,
    Fs: SX = variables.POSITIVE_FS,
    vs: SX = variables.VS,
    delta: SX = variables.DELTA,
    u_min: SX = variables.U_MIN,
    u_max: SX = variables.U_MAX,
    Ts: SX = SampleTime(),
) -> dict[str, SX | list[SX]]:
    """Positive feedback of generalised Maxwell slip (GMS) friction observed from the measured velocity.

        F_hat = F1 + ... + FN + sigma2 v
        u     = clip(gain F_hat, u_min, u_max)
        w     = v + k_e (r - x)
        S     = Fc + (Fs - Fc) exp(-|w/vs|^delta)
        w = 0 or a reversal:  all elements stick
        stick:  Fi becomes Fi + ki w Ts; if sgn(w) Fi reaches alpha_i S,
                it is set to that, and the element slips
        slip:   Fi becomes t + (Fi - t) exp(-C Ts / S),
                t = sgn(w) alpha_i S

    Al-Bender, Lampaert, Swevers, IEEE TAC 50(11), 2005 (the model). The observer has the form of the LuGre
    observer of Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995, with these elements in place of the
    bristles (specific to this library). Parameters and start values are the same as in the block GMS, except that all
    elements have one attraction C and no damping. alpha_i are normalised by their sum, which must be positive. N is
    rounded up. Connect u to the input f of a position controller.

    Between samples the elements follow the exact solution for constant w. With k_e = 0 and the exact model, F_hat is
    the friction of the block GMS in the same motion, and a wrong start value is forgotten as soon as each element has
    slipped in one direction. Injection (k_e > 0) loads the elements in the direction of the error, also at rest. It
    corrects the distribution of the forces, but not a wrong Stribeck level: |F1 + ... + FN| settles at S or below, also
    while u is limited.

    In a test on simulated GMS friction, a sine of 30 um leaves less than 1 % of the tracking error, and k_e = 20 1/s
    reduces the rest to less than half; with 400 1/s the error is larger than without injection. In the record of the
    tribometer, ten elements fitted to one window leave 6 % of the rms friction in another; Dahl leaves 12 %.

    Use it if the motion is not known in advance, reversals are nested, and a GMS model of the axis is available. With a
    known reference, GMSFeedforward needs no measured velocity.

    While enable is false, u, F_hat, u_sat and the elements are 0; reset sets the elements to 0 in the same sample.
    While track is true, all elements stick with forces in proportion to alpha_i such that u = u_track, as far as |Fi|
    <= alpha_i Fs.

    Limits: the law needs a measured velocity; its delay counts, and its noise at rest moves the elements to and fro. No
    condition on k_e is known; increase it from 0 until the error no longer falls. If the parameters exceed the
    parameters of the axis, the estimate drives the axis; set gain < 1 in this case. u_min must not exceed u_max.
    """
    shares, total = weights(alpha, N)
    carries = deflected(track, u_track, gain * (sigma2 * v), gain, Fs, u_min, u_max, SX(0.0))
    started = [share * (carries / total) for share in shares]
    observed = if_else(reset, 0.0, sum(Fi[i] for i in range(ELEMENTS)))
    F_hat = if_else(track, carries, observed) + sigma2 * v
    w = v + k_e * (r - x)  # winds nothing up: the elements are limited by S
    S = stribeck_level(fabs(w), Fc, Fs, vs, delta)
    moving, side = logic_and(w != 0.0, logic_not(track)), if_else(w > 0.0, 1.0, -1.0)
    elements = slide(Fi, slipping, way, k, N, shares, total, w * Ts, S, exp(-C * Ts / S))
    kept = [if_else(track, start, Fi[i]) for i, start in enumerate(started)]
    forces = [if_else(moving, side * element.moved, kept[i]) for i, element in enumerate(elements)]
    slips = [if_else(moving, element.slips, 0.0) for element in elements]
    active = logic_and(enable, logic_not(restarts(reset, track)))
    return {
        **limited(SX(0.0), F_hat, gain, enable, u_min, u_max),
        "Fi": [if_else(active, force, 0.0) for force in forces],
        "slipping": [if_else(active, value, 0.0) for value in slips],
        "way": if_else(active, if_else(moving, side, if_else(track, 0.0, way)), 0.0),
    }
