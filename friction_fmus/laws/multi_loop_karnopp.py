"""Multi-loop cascade with Karnopp friction of a modelled velocity; controller and plant model of any order."""

from dataclasses import dataclass

from casadi import SX, fabs, if_else, sign, vertcat

from friction_fmus.lawkit.law import Command, Output, Parameter, SampleTime, Size, State, law, replaces_servo
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import clip, limited
from friction_fmus.lawkit.quantities import FORCE, MASS, NO_UNIT, VELOCITY

ORDER = 2  # of CV and G, unless the FMU is built for more
ZEROS = (0.0,) * ORDER


def at_edge(coefficients: SX, Ts: SX) -> SX:
    """Return a polynomial with descending powers of s at s = 2/Ts, divided by the highest power of s."""
    total = coefficients[-1]
    for i in reversed(range(coefficients.numel() - 1)):
        total = coefficients[i] + Ts / 2.0 * total
    return total


def counted(coefficients: SX, order: SX) -> SX:
    """Return the coefficients up to this order, and 0 beyond; all of them if the order is fixed."""
    if coefficients.numel() > ORDER + 1:
        return coefficients
    return vertcat(coefficients[0], *(if_else(order >= i, coefficients[i], 0.0) for i in range(1, ORDER + 1)))


@dataclass(frozen=True)
class Tustin:
    """A transfer function discretised by Tustin's rule, as a chain of trapezoidal integrators.

    In this form, trailing zeros of both polynomials, a common factor s, leave integrators at rest and change nothing.
    """

    num: SX
    den: SX
    states: SX
    Ts: SX

    @property
    def edge(self) -> SX:
        """Denominator at 2/Ts, which a condition keeps from 0."""
        edge = at_edge(self.den, self.Ts)
        return if_else(edge == 0.0, 1.0, edge)

    @property
    def direct(self) -> SX:
        """Gain from the input to the output of the same sample."""
        return at_edge(self.num, self.Ts) / self.edge

    def output(self, given: SX) -> SX:
        """Return the output of this sample."""
        return self.direct * given + at_edge(self.states, self.Ts) / self.edge

    def after(self, given: SX, output: SX) -> list[SX]:
        """Return the states of the next sample."""
        following: list[SX] = []
        rate = integral = SX(0.0)
        for i in reversed(range(self.states.numel())):
            rate = self.num[i + 1] * given - self.den[i + 1] * output + integral
            following.insert(0, self.states[i] + self.Ts * rate)
            integral = self.states[i] + self.Ts / 2.0 * rate
        return following


def no_pole(CV_num: SX, CV_den: SX, G_num: SX, G_den: SX) -> SX:
    """Return whether neither CV nor G nor CV G/(1 + CV G) has a pole where the polynomials have these values."""
    return CV_den * G_den * (CV_den * G_den + CV_num * G_num) != 0.0


@law(
    "MultiLoopKarnopp",
    "Multi-loop cascade with Karnopp friction of a modelled velocity, by transfer functions of any order",
    source="Karnopp, ASME J. Dynamic Systems, Measurement and Control 107, 1985 (the friction)",
    cites=("Karnopp1985",),
    Ts=1e-3,
    use=replaces_servo("model feedback"),
    outputs={
        "u": variables.U_CONTROL,
        "F_hat": variables.F_HAT,
        "v_model": Output(VELOCITY, "velocity of the modelled loop"),
        "u_sat": variables.U_SAT,
    },
    conditions={
        "CV_den[1] and G_den[1] not 0": lambda CV_den, G_den: CV_den[0] * G_den[0] != 0.0,
        "2/Ts is not a pole of CV, G or CV G/(1 + CV G)": lambda CV_num, CV_den, G_num, G_den, order, Ts: no_pole(
            *(at_edge(counted(each, order), Ts) for each in (CV_num, CV_den, G_num, G_den))
        ),
    },
    sizes={"order": Size(("in_loop", "in_model", "in_plant", "CV_num", "CV_den", "G_num", "G_den"), most=16)},
)
def multi_loop_karnopp(
    r: SX = variables.R,
    rd: SX = variables.RD,
    rdd: SX = variables.RDD,
    x: SX = variables.X,
    v: SX = variables.V,
    enable: SX = Command(True, "false: u = 0, F_hat = 0, v_model = 0 and the states are 0"),
    reset: SX = Command(False, "true: the states are 0 before the sample"),
    in_loop: SX = State(FORCE, ZEROS, "integrators of CV in the velocity loop"),
    in_model: SX = State(FORCE, ZEROS, "integrators of CV in the model"),
    in_plant: SX = State(VELOCITY, ZEROS, "integrators of G", nominal=1e-2),
    gain: SX = variables.GAIN,
    order: SX = Parameter(
        NO_UNIT, float(ORDER), "order of CV and G; further coefficients are ignored", min=0.0, max=float(ORDER)
    ),
    KP: SX = variables.KP,
    CV_num: SX = Parameter(NO_UNIT, (127.0, *ZEROS), "numerator of CV in SI units, highest power of s first"),
    CV_den: SX = Parameter(NO_UNIT, (1.0, *ZEROS), "denominator of CV, from the same power of s"),
    G_num: SX = Parameter(NO_UNIT, (0.0, 1.0, *ZEROS[1:]), "numerator of G in SI units, highest power of s first"),
    G_den: SX = Parameter(NO_UNIT, (1.0, *ZEROS), "denominator of G, from the same power of s"),
    Ka_model: SX = Parameter(MASS, 0.0, "acceleration feedforward to the {force} of the model; 0: none", min=0.0),
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
) -> dict[str, SX | list[SX]]:
    """Position and velocity loop with command feedforward and friction at the velocity of a loop model.

        Vs      = KP (r - x) + Kv1 rd
        v_model = Gsys(s) Vs + G/(1 + CV G) Ka_model rdd
        Gsys    = CV G/(1 + CV G)
        F_model = CV(s) (Vs - v_model) + Ka_model rdd
        F_hat   = clip(F_model, -Fs, Fs)             for |v_model| < DV
        F_hat   = Fc sgn(v_model) + Fv v_model       otherwise
        u       = clip(CV(s) (Vs - v) + Ka rdd + Kv2 rd + gain F_hat, u_min, u_max)

    CV and G are quotients of polynomials, given by their coefficients from the highest power of s on. Numerator and
    denominator begin at the same power; the unused coefficients at the end are 0. Examples are

        PI control  CV = kv + ki/s      CV_num = kv, ki    CV_den = 1
        a mass      G  = 1/(m s + d)    G_num  = 0, 1      G_den  = m, d
        with a lag  G  = 1/(m s (tau s + 1))
                                        G_num  = 0, 0, 1   G_den  = m tau, m

    For orders above 2, up to 16, set the start value of order when the FMU is built or the C code is generated. The
    first coefficient of a denominator must not be 0.

    All transfer functions are discretised by Tustin's rule, s = (2/Ts) (z - 1)/(z + 1); the discretised Gsys is that of
    the discretised CV and G. With a gain as CV and a mass as G, u without F_hat equals that of ModelledOutputKarnopp,
    whose v_model is that of a Vs held between samples and thus one sample older. A survey describes this
    structure; the paper that it summarises was not found. The friction model, which balances the force of the model
    inside the band, is that of Karnopp, ASME Journal of Dynamic Systems, Measurement and Control 107, 1985.

    Use it in place of ModelledOutputKarnopp if the velocity loop has an integral or a filter, or if the model lags.
    With Kv1 = 1, Ka_model = mass and G = 1/(mass s), the modelled velocity is the reference velocity plus the answer to
    KP (r - x): the model lags only in corrections. The compensation fails if a load that is not in the model moves the
    axis.

    F_hat depends on r - x through KP and thus closes a loop, which must be stable: with a mass M and without friction,
    inside the band, the roots of

        M s^2 + CV (s + KP) + KP CV/(1 + CV G) = 0

    The states of CV in the velocity loop are held while u is limited and Vs - v pushes further into that limit. While
    enable is false, all outputs and states are 0; reset takes effect in the same sample. The integrators then start at
    0, so u jumps when enabled on a loaded axis.

    Limits: the model does not know the limits of u. DV must exceed the change of v_model per sample; otherwise, v_model
    skips the band and the relay oscillates at rest. An integral in CV causes hunting if static friction exceeds Coulomb
    friction. 2/Ts must not be a pole of CV, G or Gsys. u_min must not exceed u_max.
    """

    CV_num, CV_den, G_num, G_den = (counted(each, order) for each in (CV_num, CV_den, G_num, G_den))
    in_loop, in_model, in_plant = (if_else(reset, 0.0, states) for states in (in_loop, in_model, in_plant))
    velocity_loop = Tustin(CV_num, CV_den, in_loop, Ts)
    modelled_loop = Tustin(CV_num, CV_den, in_model, Ts)
    plant = Tustin(G_num, G_den, in_plant, Ts)

    Vs = KP * (r - x) + Kv1 * rd
    answer = plant.output(modelled_loop.output(Vs) + Ka_model * rdd)
    closed = 1.0 + plant.direct * modelled_loop.direct
    v_model = answer / if_else(closed == 0.0, 1.0, closed)
    modelled_control = modelled_loop.output(Vs - v_model)
    F_model = modelled_control + Ka_model * rdd
    stuck = clip(F_model, -Fs, Fs)
    F_hat = if_else(fabs(v_model) < DV, stuck, Fc * sign(v_model) + Fv * v_model)

    control = velocity_loop.output(Vs - v)
    results = limited(control + Ka * rdd + Kv2 * rd, F_hat, gain, enable, u_min, u_max)
    winds_up = (Vs - v) * results["u_sat"] > 0.0

    def kept(states: list[SX]) -> list[SX]:
        return [if_else(enable, state, 0.0) for state in states]

    following = velocity_loop.after(Vs - v, control)
    return {
        **results,
        "v_model": if_else(enable, v_model, 0.0),
        "in_loop": kept([if_else(winds_up, in_loop[i], state) for i, state in enumerate(following)]),
        "in_model": kept(modelled_loop.after(Vs - v_model, modelled_control)),
        "in_plant": kept(plant.after(F_model, v_model)),
    }
