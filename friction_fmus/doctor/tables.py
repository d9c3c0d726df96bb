"""What the doctor knows of blocks: one row for each plant, friction model and law.

To make the doctor know a law, add its row to LAWS: the names of its parameters in, the symbols of the conditions out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from friction_fmus.conditions import SampledLaw
from friction_fmus.doctor import compensators as rules
from friction_fmus.doctor.axis import Contact, Gains, Law, Level, Plant, Values
from friction_fmus.doctor.learning import periods_contract, trials_contract
from friction_fmus.doctor.linear import linearised, local_function


def levels(
    p: Values, viscous: str = "", vs: bool = True, delta: float | None = None, Fs: float | None = None
) -> tuple[Level, Level]:
    """Friction forward and backward, from the names that the blocks share: Fc, Fs, vs, delta, and the same with _neg.

    Parameters
    ----------
    p : mapping
        The values.
    viscous : str
        Parameter for the viscous friction.
    vs : bool
        Whether there is a Stribeck velocity.
    delta, Fs : float or None
        Instead of the parameters of that name.
    """

    def side(suffix: str) -> Level:
        def get(name: str, default: float = 0.0) -> float:
            return p.get(name + suffix, p.get(name, default))

        Fc = get("Fc")
        return Level(
            Fc,
            get("Fs", Fc) if Fs is None else Fs,
            get(viscous) if viscous else 0.0,
            get("vs") if vs else None,
            get("delta", 2.0) if delta is None else delta,
        )

    return side(""), side("_neg" if p.get("asymmetric") else "")


def stribeck(p: Values, viscous: str) -> tuple[Level, Level]:
    """Levels of a block whose curve may be the Lorentzian one (shape 1), of which the steepest fall is not known."""
    return levels(p, viscous, vs=not p.get("shape"))


def elements(p: Values, name: str) -> float:
    """Sum of the vector elements that are in use."""
    return sum(p[f"{name}[{i + 1}]"] for i in range(int(p["N"])))


def lugre(p: Values) -> Contact:
    """LuGre and its relatives."""
    return Contact(levels(p, "sigma2"), p["sigma0"], p["sigma1"], p["sigma2"])


def both(level: Level) -> tuple[Level, Level]:
    """The same in both directions."""
    return level, level


PLANTS: Final[Mapping[str, Plant]] = {
    "Mass": Plant(("F_drive", "F_load"), ("F_friction",), lambda p: p["m"], "d", "k"),
    "TwoMass": Plant(("F_drive", "F_load"), ("F_friction1", "F_friction2"), lambda p: p["m1"] + p["m2"], flexible=True),
    "Belt": Plant(("F_load",), ("F_friction",), lambda p: p["m"], "d", "k"),
    "KarnoppMass": Plant(("F_ext",), (), lambda p: p["m"]),
}

FRICTION: Final[Mapping[str, Callable[[Values], Contact]]] = {
    "Viscous": lambda p: Contact(both(Level(0.0, 0.0, p["Fv"]))),
    "Coulomb": lambda p: Contact(levels(p, vs=False)),
    "Stiction": lambda p: Contact(levels(p, "Fv", vs=False)),
    "Karnopp": lambda p: Contact(levels(p, "Fv", vs=False)),
    "KarnoppMass": lambda p: Contact(levels(p, "Fv", vs=False)),
    "DeadZoneTorque": lambda p: Contact(levels(p, "Fv", vs=False, Fs=p["T_dz"])),
    "Tustin": lambda p: Contact(levels(p, "Fv", delta=1.0)),
    "Stribeck": lambda p: Contact(stribeck(p, "Fv")),
    "SevenParameter": lambda p: Contact(levels(p, "Fv", vs=False, Fs=p["Fc"] + p["Fs_inf"]), p["kt"]),
    "Dahl": lambda p: Contact(levels(p, vs=False), p["sigma"]),
    "LuGre": lugre,
    "ElastoPlastic": lugre,
    "Leuven": lambda p: Contact(levels(p, "sigma2"), p["A"] / p["zc"], p["sigma1"], p["sigma2"]),
    "ModifiedLeuven": lambda p: Contact(levels(p, "sigma2"), elements(p, "k"), p["sigma1"], p["sigma2"]),
    "GMS": lambda p: Contact(levels(p, "sigma2"), elements(p, "k"), p["N"] * p["sigma"], p["sigma2"]),
    "MaxwellSlip": lambda p: Contact(both(Level(elements(p, "W"), elements(p, "W"))), elements(p, "k")),
}

SENSORS: Final = ("Encoder", "Differentiator", "Quantiser")
"""Blocks between a plant and its laws, whose step and difference quotient count."""

BETWEEN: Final = ("Actuator", "Cogging", "Prefilter", "PreviewPrefilter")
"""Other blocks around an axis that are known."""


def per_sample(p: Values, steps: float) -> Gains:
    """An implicit sliding mode near its surface, which takes back `steps` times m/Ts of s."""
    on_s = steps * p["m"] / p["Ts"]
    return Gains(on_s * p["lam"], on_s + p["m"] * p["lam"])


def at_rest(name: str, **fixed: float) -> Callable[[Values, float], SampledLaw]:
    """The part of the sampled loop that a law has by its own equations, with some parameters at fixed values."""
    return lambda p, Ts: linearised(name, {**p, **fixed}, Ts)


def inertia_of(name: str) -> Callable[[Values], float]:
    """The mass of an inertia feedforward, from the parameter of that name."""
    return lambda p: p[name]


_OPEN: Final = {"gain": 0.0, "sigma0": 0.0, "sigma1": 0.0, "sigma2": 0.0}
"""A law without its bristles: in steady sliding they add a constant force."""

LAWS: Final[Mapping[str, Law]] = {
    "PID": Law(
        gains=lambda p: Gains(p["Kp"], p["Kd"], p["Ki"], p.get("db", 0.0), p["m"]),
        linear=at_rest("PID", db=0.0, v_zc=0.0),
    ),
    "CascadePPI": Law(
        gains=lambda p: Gains(p["kv"] * p["kp"] + p["ki"], p["kv"], p["ki"] * p["kp"], p.get("db", 0.0), p["m"]),
        linear=at_rest("CascadePPI"),
    ),
    "ResetPID": Law(
        gains=lambda p: Gains(p["Kp"], p["Kd"], p["Ki"], m=p["m"]), linear=at_rest("ResetPID"), hunts=False
    ),
    "ModelledOutputKarnopp": Law(
        gains=lambda p: Gains(p["CV"] * p["KP"], p["CV"]),
        levels=lambda p: levels(p, "Fv", vs=False),
        linear=at_rest("ModelledOutputKarnopp"),
    ),
    "ExtendedStateObserver": Law(
        gains=lambda p: Gains(p["m"] * p["wc"] ** 2, 2.0 * p["m"] * p["wc"]),
        linear=at_rest("ExtendedStateObserver"),
        estimates=True,
    ),
    "ImplicitSlidingMode": Law(
        gains=lambda p: per_sample(p, p["gain"]), linear=at_rest("ImplicitSlidingMode"), rules=(rules.covers_friction,)
    ),
    "ImplicitSuperTwisting": Law(
        gains=lambda p: per_sample(p, 1.0 + p["gain"]),
        linear=at_rest("ImplicitSuperTwisting"),
        rules=(rules.follows_friction,),
    ),
    "AdaptiveSlidingMode": Law(
        gains=lambda p: Gains(
            (p["Ks"] + p["K"] / p["phi"]) * p["lam"], p["Ks"] + p["K"] / p["phi"] + p["m"] * p["lam"]
        ),
        linear=at_rest("AdaptiveSlidingMode"),
        rules=(rules.adapts_sliding_mode,),
    ),
    "AdaptiveLuGre": Law(
        gains=lambda p: Gains(p["Ks"] * p["lam"], p["m"] * p["lam"] + p["Ks"]),
        levels=lambda p: levels(p, "sigma2"),
        measured=True,
        at_rest=True,
        linear=at_rest("AdaptiveLuGre", **_OPEN),
        rules=(rules.adapts_normal_force, rules.feeds_stiffness_back),
    ),
    "ANDFC": Law(
        gains=lambda p: Gains(p["Ks"] * p["lam"], p["m"] * p["lam"] + p["Ks"]),
        levels=lambda p: levels(p, "sigma2"),
        measured=True,
        at_rest=True,
        linear=at_rest("ANDFC", **_OPEN),
        rules=(rules.adapts_bristles, rules.feeds_stiffness_back),
    ),
    "CoulombFeedforward": Law(levels=lambda p: levels(p, vs=False), inertia=inertia_of("m")),
    "KarnoppFeedforward": Law(levels=lambda p: levels(p, "Fv", vs=False), inertia=inertia_of("m")),
    "DahlFeedforward": Law(levels=lambda p: levels(p, "Fv", vs=False), inertia=inertia_of("m")),
    "StaticFeedforward": Law(levels=lambda p: levels(p, "Fv"), inertia=inertia_of("m")),
    "LuGreFeedforward": Law(levels=lambda p: levels(p, "sigma2"), inertia=inertia_of("m")),
    "ElastoPlasticFeedforward": Law(levels=lambda p: levels(p, "sigma2"), inertia=inertia_of("m")),
    "GMSFeedforward": Law(levels=lambda p: levels(p, "sigma2"), inertia=inertia_of("m")),
    "LeuvenFeedforward": Law(levels=lambda p: levels(p, "sigma2"), inertia=inertia_of("mass")),
    "ModifiedLeuvenFeedforward": Law(levels=lambda p: levels(p, "sigma2"), inertia=inertia_of("mass")),
    "DeadZoneFeedforward": Law(
        levels=lambda p: levels(p, "Fv", vs=False, Fs=p["T_dz"]),
        inertia=inertia_of("m"),
        amplifies=lambda p: 1.0 + p["gain"],
    ),
    "InverseDynamics": Law(
        levels=lambda p: both(Level(0.0, 0.0, p["Fv"] + p["Fv_load"])),
        inertia=lambda p: p["m"] + p["m_load"],
    ),
    "DiscreteInverse": Law(rules=(rules.looks_ahead,)),
    "StaticFeedback": Law(levels=lambda p: levels(p, "Fv"), measured=True),
    "LuGreObserver": Law(
        levels=lambda p: levels(p, "sigma2"),
        measured=True,
        at_rest=True,
        rules=(rules.injection_of_error, rules.feeds_stiffness_back),
    ),
    "ElastoPlasticEstimator": Law(
        levels=lambda p: levels(p, "Fv", vs=False), measured=True, at_rest=True, rules=(rules.feeds_stiffness_back,)
    ),
    "TustinFeedback": Law(levels=lambda p: levels(p, "Fv", delta=1.0), measured=True),
    "DisturbanceObserver": Law(linear=at_rest("DisturbanceObserver"), estimates=True),
    "KalmanFriction": Law(linear=at_rest("KalmanFriction"), estimates=True),
    "PredictiveFilter": Law(linear=at_rest("PredictiveFilter"), estimates=True),
    "LocalFunctionEstimator": Law(linear=local_function, estimates=True),
    "Dither": Law(rules=(rules.dithers,)),
    "ImpulsiveControl": Law(rules=(rules.pushes,)),
    "IterativeLearning": Law(rules=(trials_contract,)),
    "RepetitiveController": Law(rules=(periods_contract,)),
}
