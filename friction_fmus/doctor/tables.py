"""What the doctor knows of blocks: one row for each plant, friction model and law.

To make the doctor know a law, add its row to LAWS: the names of its parameters in, the symbols of the conditions out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from friction_fmus.doctor.axis import Contact, Gains, Law, Level, Plant, Values
from friction_fmus.doctor.learning import periods_contract, trials_contract
from friction_fmus.doctor.rules import disturbance_observer_poles, injection_of_error


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
    "Mass": Plant(("F_drive", "F_load"), "F_friction", lambda p: p["m"], "d", "k"),
    "KarnoppMass": Plant(("F_ext",), "", lambda p: p["m"]),
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

LAWS: Final[Mapping[str, Law]] = {
    "PID": Law(gains=lambda p: Gains(p["Kp"], p["Kd"], p["Ki"], p.get("db", 0.0), p["m"])),
    "CascadePPI": Law(
        gains=lambda p: Gains(p["kv"] * p["kp"] + p["ki"], p["kv"], p["ki"] * p["kp"], p.get("db", 0.0), p["m"])
    ),
    "AdaptiveLuGre": Law(
        gains=lambda p: Gains(p["Ks"] * p["lam"], p["m"] * p["lam"] + p["Ks"]),
        levels=lambda p: levels(p, "sigma2"),
        measured=True,
        at_rest=True,
    ),
    "CoulombFeedforward": Law(levels=lambda p: levels(p, vs=False), inertia="m"),
    "KarnoppFeedforward": Law(levels=lambda p: levels(p, "Fv", vs=False), inertia="m"),
    "DahlFeedforward": Law(levels=lambda p: levels(p, "Fv", vs=False), inertia="m"),
    "StaticFeedforward": Law(levels=lambda p: levels(p, "Fv"), inertia="m"),
    "LuGreFeedforward": Law(levels=lambda p: levels(p, "sigma2"), inertia="m"),
    "ElastoPlasticFeedforward": Law(levels=lambda p: levels(p, "sigma2"), inertia="m"),
    "GMSFeedforward": Law(levels=lambda p: levels(p, "sigma2"), inertia="m"),
    "StaticFeedback": Law(levels=lambda p: levels(p, "Fv"), measured=True),
    "LuGreObserver": Law(
        levels=lambda p: levels(p, "sigma2"), measured=True, at_rest=True, rules=(injection_of_error,)
    ),
    "TustinFeedback": Law(levels=lambda p: levels(p, "Fv", delta=1.0), measured=True),
    "DisturbanceObserver": Law(rules=(disturbance_observer_poles,)),
    "IterativeLearning": Law(rules=(trials_contract,)),
    "RepetitiveController": Law(rules=(periods_contract,)),
}
