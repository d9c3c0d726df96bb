"""Bumpless start of laws: memories for which the output of a law continues from a given force.

While the input ``track`` is true, a law computes its memory backwards from the input ``u_track`` and continues with it:
Astrom, Hagglund: Advanced PID Control, ISA 2006 (tracking mode and bumpless transfer); Hanus, Kinnaert, Henrotte:
Conditioning technique, a general anti-windup and bumpless transfer method, Automatica 23(6), 1987 (both from memory).
"""

from __future__ import annotations

from casadi import SX, if_else, logic_and, logic_not

from friction_fmus.lawkit.law import clip


def restarts(reset: SX, track: SX) -> SX:
    """Return whether the memory is at its start value: during a reset, unless the law tracks a force."""
    return logic_and(reset, logic_not(track))


def tracked(track: SX, u_track: SX, gain: SX, otherwise: SX) -> SX:
    """Return the output of a law before its limits: u_track itself, or `otherwise` if the law has no memory to set.

    Computed from the memory, it would reach a limit or not as rounding decides.
    """
    return if_else(logic_and(track, gain != 0.0), u_track, otherwise)


def carried(track: SX, u: SX, rest: SX, gain: SX, otherwise: SX) -> SX:
    """Return the memory with which a law begins a sample."""
    follows = logic_and(track, gain != 0.0)
    return if_else(follows, (u - rest) / if_else(follows, gain, 1.0), otherwise)


def deflected(track: SX, u_track: SX, rest: SX, stiffness: SX, most: SX, u_min: SX, u_max: SX, otherwise: SX) -> SX:
    """Return the deflection of a contact with which a law begins a sample, as `carried`."""
    squared = stiffness**2  # of a known sign, unlike the stiffness, so that the generated C need not exclude -0.0
    follows = logic_and(track, squared != 0.0)
    limited_track = clip(u_track, u_min, u_max)
    deflection = (limited_track - rest) * stiffness / if_else(follows, squared, 1.0)
    return if_else(follows, clip(deflection, -most, most), otherwise)
