"""Dither: a fast oscillation that smooths friction."""

from math import pi

from casadi import SX, fabs, floor, if_else, sin

from friction_fmus.lawkit.law import Command, Input, Output, Parameter, SampleTime, State, Use, law
from friction_fmus.lawkit.parts import variables
from friction_fmus.lawkit.parts.expressions import clip, limits
from friction_fmus.lawkit.quantities import FORCE, FREQUENCY, NO_UNIT


@law(
    "Dither",
    "Fast oscillation added to a {force}: sine, square or triangle",
    source="Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994",
    cites=("ArmstrongHelouvry1994",),
    Ts=1e-4,
    use=Use("dither", tuned={"Ad": "1.5 * level", "frequency": "0.1 / Ts"}, rule="dither_stroke"),
    outputs={"u": Output(FORCE, "f with the dither, within u_min and u_max"), "u_sat": variables.U_SAT},
    conditions={"frequency < 1/(2 Ts)": lambda frequency, Ts: 2.0 * frequency * Ts < 1.0},
)
def dither(
    f: SX = Input(FORCE, 0.0, "{force} to which the dither is added before the limits", optional=True),
    enable: SX = Command(True, "false: u = 0 and the phase is at its start value"),
    reset: SX = Command(False, "true: the phase is reset to its start value"),
    phase: SX = State(NO_UNIT, 0.0, "phase in periods, from 0 to below 1"),
    gain: SX = Parameter(NO_UNIT, 1.0, "fraction of the dither that is added; 0: u = f", min=0.0, max=1.0),
    Ad: SX = Parameter(FORCE, 50.0, "amplitude", min=0.0),
    frequency: SX = Parameter(FREQUENCY, 200.0, "frequency, below 1/(2 Ts)", min=0.0),
    shape: SX = Parameter(NO_UNIT, 0.0, "0 sine, 1 square, 2 triangle", min=0.0, max=2.0),
    u_min: SX = Parameter(FORCE, -60.0, "lower limit of u"),
    u_max: SX = Parameter(FORCE, 60.0, "upper limit of u"),
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """A fast oscillation added to a force, which averages friction.

        u = clip(f + gain Ad w(phase), u_min, u_max)
        phase_next = (phase + frequency Ts) modulo 1
        shape 0:  w = sin(2 pi phase)
        shape 1:  w = 1 in the first half of the period, -1 in the second
        shape 2:  w = 4 phase in the first quarter, 4 phase - 4 in the last one,
                  2 - 4 phase between them

    Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994 (survey); the averages follow by integration. The
    sine gives a permanently sliding mass m a velocity dither with the amplitude A = Ad/(2 pi frequency m). Coulomb
    friction Fc at the velocity v0 + A w, |v0| < A, has the mean

        sine velocity:      (2 Fc/pi) asin(v0/A),  near 0: 2 Fc/(pi A) v0
        triangle velocity:  Fc v0/A
        square velocity:    0

    Use it if the actuator allows an oscillation far above the bandwidth of the position loop. Connect the law between
    the controller and the plant, or connect u to the input f of the controller. The start values move 1 kg by about
    +-30 um at +-40 mm/s.

    frequency < 1/(2 Ts) is required, because of aliasing; at 1/(2 Ts) the sine is 0.

    While enable is false, u and u_sat are 0 and the phase is at its start value. With gain = 0, u = f. reset takes
    effect in the same sample. u jumps to f when enabled; a square wave also jumps by gain Ad.

    Limits: the stroke A/(2 pi frequency) must be large compared with the presliding displacement of the contact
    (Fc/sigma0); otherwise, the contact follows elastically and friction is not averaged. The waveform is held between
    samples: with fewer than about ten samples per period, the mean friction changes in steps. Dither causes wear and
    noise. u_min must not exceed u_max.
    """
    now = if_else(reset, 0.0, phase)
    square = if_else(now < 0.5, 1.0, -1.0)
    triangle = 1.0 - 4.0 * fabs(now - 0.25)
    wave = if_else(
        shape < 0.5, sin(2.0 * pi * now), if_else(shape < 1.5, square, if_else(now < 0.75, triangle, 4.0 * now - 4.0))
    )
    wanted = f + gain * Ad * wave
    later = now + frequency * Ts
    return {
        "u": if_else(enable, clip(wanted, u_min, u_max), 0.0),
        "u_sat": if_else(enable, limits(wanted, u_min, u_max), 0.0),
        "phase": if_else(enable, later - floor(later), 0.0),
    }
