"""Which compensators can be put on an axis, and how their parameters follow from what is known of it.

One row for each law and controller of the catalogue. To make the study know a new law, add its row to `CANDIDATES`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import exp, pi, sqrt
from typing import Final, TypeAlias

import numpy as np

from friction_fmus.catalogue import catalogue
from friction_fmus.errors import nearest
from friction_fmus.identification import Array
from harness import FmuPart, open_archive

from .config import ALL, ConfigError, Servo
from .loop import Placed, Plant, block

Values: TypeAlias = Mapping[str, float]

SHARP: Final = 100.0
"""Sharpness n with which a modified Leuven model slides where all its elements slip, as one of Maxwell slip."""


@dataclass(frozen=True)
class Known:
    """What is known of an axis.

    Attributes
    ----------
    servo : Servo
        Its feedback and sensors.
    plant : Plant
        Its mass and best friction model.
    models : mapping of str to mapping
        Parameters of every identified friction model, by name of the block.
    period : int
        Samples after which the reference repeats; 0: it does not.
    speed : float
        Largest reference velocity.
    rotary : bool
        Whether the axis turns.
    """

    servo: Servo
    plant: Plant
    models: Mapping[str, Values]
    period: int = 0
    speed: float = 0.0
    rotary: bool = False

    @property
    def Ts(self) -> float:  # noqa: N802 (the symbol of the sampling period)
        """Sampling period [s]."""
        return self.servo.Ts

    @property
    def m(self) -> float:
        """Moved mass."""
        return self.plant.mass

    @property
    def bandwidth(self) -> float:
        """Natural frequency of the position loop [rad/s]."""
        return sqrt(self.servo.pid[0] / self.m)

    @property
    def corner(self) -> float:
        """Corner frequency of the estimators [Hz]: twice the loop, and at most a tenth of the sampling frequency."""
        return min(2.0 * self.bandwidth / (2.0 * pi), 0.1 / self.Ts)

    @property
    def observed(self) -> float:
        """Three poles of an observer of the position [rad/s]: four times the loop, and at most 1/(2 Ts)."""
        return min(4.0 * self.bandwidth, 0.5 / self.Ts)

    @property
    def x_noise(self) -> float:
        """Standard deviation of the quantised position; a millionth of a sample's way without a quantum."""
        return max(self.servo.quantum / sqrt(12.0), 1e-6 * self.speed * self.Ts, 1e-12)

    @property
    def v_noise(self) -> float:
        """Standard deviation of the velocity, from two such positions."""
        return sqrt(2.0) * self.x_noise / (self.servo.window * self.Ts)

    @property
    def level(self) -> float:
        """Largest friction force close to rest."""
        values = self.plant.values
        parts = [sum(v for name, v in values.items() if name.startswith("W["))]
        return max(*parts, *(values.get(name, 0.0) for name in ("Fc", "Fs", "T_dz")))


@dataclass(frozen=True)
class Candidate:
    """How a law is used.

    Attributes
    ----------
    kind : str
        As in `CompensatorRow.kind`.
    models : tuple of str
        Friction models whose parameters it takes over by name, the first that was identified; empty: none needed.
    renamed : mapping of str to str
        Parameter of the model -> that of the law, where they have other names.
    more : callable
        Further parameters from what is known, and from the model's values.
    output : str
        The output that is added to the force of the servo.
    never : str
        Why the law is not compared; empty: it is.
    """

    kind: str
    models: tuple[str, ...] = ()
    renamed: Mapping[str, str] = field(default_factory=dict)
    more: Callable[[Known, Values], Values] = lambda known, model: {}
    output: str = "u"
    never: str = ""


def _inertia(name: str = "m") -> Callable[[Known, Values], Values]:
    """No inertia feedforward: the servo has it."""
    return lambda known, model: {name: 0.0}


def _karnopp(known: Known, model: Values) -> Values:
    return {"m": 0.0, "DV": model.get("DV", max(5.0 * known.v_noise, 1e-3 * known.speed, 1e-9))}


def _static_feedback(known: Known, model: Values) -> Values:
    damping = known.servo.pid[1]
    return {"vt": max(2.0 * max(model["Fs"], model["Fc"]) / damping, 5.0 * known.v_noise, 1e-9)}


def _elastic(known: Known, model: Values) -> Values:
    limit = model["Fc"] / model["sigma0"]
    return {"elastic": min(max(model.get("z_ba", 0.7 * limit) / limit, 0.0), 0.99)}


def _elements_of_gms(known: Known, model: Values) -> Values:
    """The elements of GMS, which slip one after the other: no other rounding of the transition, no bristle damping.

    `identify` does not take ModifiedLeuven: its sharpness n and the elements are correlated in a record.
    """
    level = max(model["Fs"], model["Fc"])
    shares = {name: value for name, value in model.items() if name.startswith("alpha[")}
    total = sum(shares.values()) or 1.0
    # together a little more than the level, below which the deflection would grow without bound
    slip = {name.replace("alpha", "W"): (1.0 + 1e-9) * level * share / total for name, share in shares.items()}
    return {"mass": 0.0, "n": SHARP, "sigma1": 0.0, **slip}


def _predictive(known: Known, model: Values) -> Values:
    share = 1.0 - exp(-2.0 * pi * known.corner * known.Ts)  # of the new sample
    size = max(known.level, 1e-9)
    return {"m": known.m, "F_size": size, "v_noise": size * known.Ts / known.m * sqrt(1.0 / share - 1.0)}


def _kalman(known: Known, model: Values) -> Values:
    # a random walk of the force, seen through two integrators, has three poles at (F_step/(m x_noise Ts))^(1/3)
    step = known.m * known.x_noise * known.Ts * known.observed**3
    return {"m": known.m, "x_noise": known.x_noise, "v_noise": known.v_noise, "F_step": step}


def _repetitive(known: Known, model: Values) -> Values:
    gains = dict(zip(("Kp", "Kd", "Ki"), known.servo.pid, strict=True))
    return {"N": known.period, "m": known.m, "fq": known.corner, **gains}


_ITSELF: Final = "It replaces the feedback controller, and so cannot be compared at the same feedback gains."
_BEFORE: Final = "It passes the force of a feedforward through the reference, for servos without an input for a force."

_LUGRE: Final = ("LuGre",)
_STRIBECK: Final = ("Stribeck",)

CANDIDATES: Final[Mapping[str, Candidate]] = {
    "CoulombFeedforward": Candidate("feedforward", ("Coulomb", "Stribeck"), more=_inertia()),
    "StaticFeedforward": Candidate("feedforward", _STRIBECK, more=_inertia()),
    "KarnoppFeedforward": Candidate("feedforward", ("Karnopp", "Stribeck"), more=_karnopp),
    "DeadZoneFeedforward": Candidate("feedforward", ("DeadZoneTorque",), more=_karnopp),
    "DahlFeedforward": Candidate("feedforward", ("Dahl",), more=_inertia()),
    "LuGreFeedforward": Candidate("feedforward", _LUGRE, more=_inertia()),
    "ElastoPlasticFeedforward": Candidate("feedforward", ("ElastoPlastic",), more=_inertia()),
    "GMSFeedforward": Candidate("feedforward", ("GMS",), more=_inertia()),
    "LeuvenFeedforward": Candidate("feedforward", ("Leuven",), more=_inertia("mass")),
    "ModifiedLeuvenFeedforward": Candidate("feedforward", ("GMS",), more=_elements_of_gms),
    "InverseDynamics": Candidate("feedforward", ("Viscous", "Stribeck"), more=_inertia()),
    "StaticFeedback": Candidate("model feedback", _STRIBECK, more=_static_feedback),
    "TustinFeedback": Candidate(
        "model feedback",
        ("Tustin", "Stribeck"),
        more=lambda known, model: {"v_min": max(5.0 * known.v_noise, 1e-3 * known.speed, 1e-9)},
    ),
    "LuGreObserver": Candidate("model feedback", _LUGRE),
    "ElastoPlasticEstimator": Candidate("model feedback", ("ElastoPlastic", "LuGre"), {"sigma2": "Fv"}, _elastic),
    "DisturbanceObserver": Candidate(
        "estimator", more=lambda known, model: {"m": known.m, "fq": known.corner, "second_order": True}
    ),
    "PredictiveFilter": Candidate("estimator", more=_predictive),
    "KalmanFriction": Candidate("estimator", more=_kalman),
    "LocalFunctionEstimator": Candidate(
        "estimator",
        more=lambda known, model: {"m": known.m, "window": max(3, round(1.0 / (pi * known.corner * known.Ts)))},
    ),
    "ExtendedStateObserver": Candidate(
        "estimator",
        more=lambda known, model: {"m": known.m, "wo": known.observed, "wc": known.bandwidth},
        output="F_hat",  # its u would be a whole controller
    ),
    "Dither": Candidate("dither", more=lambda known, model: {"Ad": 1.5 * known.level, "frequency": 0.1 / known.Ts}),
    "RepetitiveController": Candidate("learning", more=_repetitive),
    "IterativeLearning": Candidate(
        "learning", never="It learns from trial to trial, and the study runs the reference once (see procedures)."
    ),
    "ImpulsiveControl": Candidate("other", never="It pushes an axis that is stuck off its target, not a moving one."),
    "DiscreteInverse": Candidate("other", never="It inverts a linear plant, and knows no friction."),
    "Prefilter": Candidate("other", never=_BEFORE),
    "PreviewPrefilter": Candidate("other", never=_BEFORE),
    **{
        name: Candidate("controller", never=_ITSELF)
        for name in (
            "PID",
            "CascadePPI",
            "ResetPID",
            "ModelledOutputKarnopp",
            "AdaptiveLuGre",
            "ANDFC",
            "AdaptiveSlidingMode",
            "ImplicitSlidingMode",
            "ImplicitSuperTwisting",
        )
    },
}


@dataclass(frozen=True)
class Choice:
    """A candidate for this axis: what to place, or why not.

    Attributes
    ----------
    name, kind, model : str
        Law, its kind, and the friction model that gives its parameters.
    placed : Placed or None
        None if it does not apply.
    reason : str
        Why it does not.
    """

    name: str
    kind: str
    model: str
    placed: Placed | None
    reason: str = ""


def candidates(wanted: Sequence[str] | str, known: Known) -> list[Choice]:
    """What is to be compared.

    Parameters
    ----------
    wanted : sequence of str or "all"
        Names of laws.
    known : Known
        The axis.

    Raises
    ------
    ConfigError
        A name is none of `CANDIDATES`.
    """
    check_names(wanted)
    names = list(CANDIDATES) if wanted == ALL else list(wanted)
    return [_choice(name, CANDIDATES[name], known) for name in names]


def check_names(wanted: Sequence[str] | str) -> None:
    """Refuse names that are no compensators; the error is that of `candidates`."""
    for name in () if isinstance(wanted, str) else wanted:
        if name not in CANDIDATES:
            hint = nearest(name, CANDIDATES)
            raise ConfigError(f"[compensation], compensators, names {name!r}, which is no law{hint}; choose another.")


def _choice(name: str, row: Candidate, known: Known) -> Choice:
    if row.never:
        return Choice(name, row.kind, "", None, row.never)
    model = next((model for model in row.models if model in known.models), "")
    if row.models and not model:
        return Choice(
            name, row.kind, "", None, f"It needs the parameters of {row.models[0]}, which was not identified."
        )
    path = block(name, known.rotary)
    if name == "RepetitiveController" and not 0 < known.period <= (most := int(open_archive(path).variables["N"].max)):
        text = f"repeats after {known.period} samples, and {most} are possible" if known.period else "does not repeat"
        return Choice(name, row.kind, "", None, f"It needs a periodic reference, and this one {text}.")
    given = known.models.get(model, {})
    part = FmuPart("law", path)
    settable = {port.name for port in part.parameters}
    taken = {row.renamed.get(parameter, parameter): value for parameter, value in given.items()}
    values = {parameter: value for parameter, value in taken.items() if parameter in settable}
    return Choice(name, row.kind, model, Placed(name, row.output, {**values, **row.more(known, given)}))


def laws() -> list[str]:
    """Laws and controllers of the catalogue."""
    return [name for name, block in catalogue().items() if block.kind in ("law", "controller")]


def period_of(r: Array, least: int) -> int:
    """Samples after which a reference repeats; 0 if it does not, or not twice.

    Parameters
    ----------
    r : array, shape (n,)
        The reference.
    least : int
        Shortest period that counts.
    """
    span = float(np.ptp(r))
    if span == 0.0:
        return 0
    # mean square of r[k + lag] - r[k], of which a period is a minimum
    lags = np.arange(least, len(r) // 2 + 1)
    power = np.append(0.0, np.cumsum(np.square(r - r.mean())))
    likeness = np.fft.irfft(np.abs(np.fft.rfft(r - r.mean(), 2 * len(r))) ** 2)[lags]
    change = (power[len(r) - lags] + power[-1] - power[lags] - 2.0 * likeness) / (len(r) - lags)
    for lag in lags[change < 1e-9 * span**2]:
        if np.max(np.abs(r[lag:] - r[:-lag])) < 1e-6 * span:
            return int(lag)
    return 0
