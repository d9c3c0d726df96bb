"""Explanation of a static friction below the Coulomb friction by the points of the record near rest."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from friction_fmus.identification.data.record import Array, AxisUnits

#: Static over Coulomb friction below which it needs an explanation.
BELOW = 0.98

#: Fewest points near rest that can explain it.
FEWEST = 5


def explanation(parameters: Mapping[str, float], v: Array, friction: Array, units: AxisUnits) -> str:
    """Return why Fs is below Fc, or that the record does not show it; empty if it is not below."""
    if not {"Fc", "Fs", "vs"} <= parameters.keys() or parameters["Fs"] >= BELOW * parameters["Fc"]:
        return ""
    Fc, Fs, vs = (parameters[name] for name in ("Fc", "Fs", "vs"))
    speed = np.abs(v)
    against = friction * np.sign(v) - parameters.get("Fv", parameters.get("sigma2", 0.0)) * speed
    near, beyond = (speed > 0.1 * vs) & (speed <= vs), (speed > 2.0 * vs) & (speed <= 4.0 * vs)
    text = f"Fs = {Fs:.3g} {units.force} is below Fc = {Fc:.3g} {units.force}"
    if np.count_nonzero(near) < FEWEST or np.count_nonzero(beyond) < FEWEST:
        return (
            f"{text}, but the record has only {np.count_nonzero(near)} points between {0.1 * vs:.2g} and {vs:.2g} "
            f"{units.velocity}, around vs, that could show it; measure slow constant velocities in both directions"
        )
    low, high = float(np.mean(against[near])), float(np.mean(against[beyond]))
    means = (
        f"the {np.count_nonzero(near)} points of the record near rest, up to vs, have a mean friction without its "
        f"viscous part of {low:.3g} {units.force}, those at two to four times vs {high:.3g} {units.force}"
    )
    if low < high:
        return f"{text}: the friction of this axis increases with speed from rest on; {means}"
    return f"{text}, but {means}: friction near rest is not smaller; fix Fs, or measure slow constant velocities"
