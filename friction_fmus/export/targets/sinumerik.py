"""Siemens SINUMERIK: a pulse of the velocity setpoint at each reversal (quadrant error compensation)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from friction_fmus.export.targets import Target

if TYPE_CHECKING:
    from friction_fmus.export.identified_axis import Array, AxisLoop, IdentifiedAxis, ReferenceMotion

MANUAL: Final = (
    "Siemens, SINUMERIK 840D sl, Function Manual Extended Functions 03/2013, 4.6 Friction compensation, p. 293 to 296",
    "https://www.easymanua.ls/siemens/sinumerik-series/manual/275710?p=296",
)
NAMES: Final = (
    *("MD32490 FRICT_COMP_MODE", "MD32500 FRICT_COMP_ENABLE", "MD32510 FRICT_COMP_ADAPT_ENABLE"),
    *("MD32520 FRICT_COMP_CONST_MAX", "MD32540 FRICT_COMP_TIME"),
)
TIMES: Final = 11  # number of time constants that are tried, from a sample on, each twice the one before


def cascade(axis: IdentifiedAxis) -> tuple[AxisLoop, float, float]:
    """Return the servo with integral action, and its gains of velocity [N.s/m] and integral of the velocity [N/m].

    The integral action of a servo without one gets a reset time of four time constants M/kv of the velocity loop.
    """
    from friction_fmus.errors import BuildError

    if axis.loop is None or axis.mass <= 0.0:
        raise BuildError("SINUMERIK needs servo and mass of the axis: export a study that compared compensators.")
    gains = axis.loop.gains
    kv, kp = (gains["Kd"], gains["Kp"] / gains["Kd"]) if "Kd" in gains else (gains["kv"], gains["kp"])
    ki = (gains["Ki"] / kp if "Ki" in gains else gains["ki"]) or kv**2 / (4.0 * axis.mass)
    return replace(axis.loop, gains={**gains, **({"Ki": ki * kp} if "Ki" in gains else {"ki": ki})}), kv, ki


def pulse(motion: ReferenceMotion, time: float, sample_time: float, kv: float, ki: float) -> Array:
    """Return the force, shape (n,) [N], for pulses of 1 m/s that begin with each motion and decay with a time [s]."""
    import numpy as np
    from scipy.signal import lfilter

    from friction_fmus.export.axis_fit import signs

    sign = signs(motion)
    begins = np.where(np.diff(sign, prepend=0.0) != 0.0, sign, 0.0)
    w: Array = lfilter([1.0], [1.0, -np.exp(-sample_time / time)], begins)
    return kv * w + ki * sample_time * (np.cumsum(w) - w)


def circle(motion: ReferenceMotion, sample_time: float, radius: float, feed: float) -> ReferenceMotion:
    """Return two turns of an axis of a circle, from the begin of a motion towards its middle."""
    import numpy as np

    from friction_fmus.export.identified_axis import ReferenceMotion

    side = np.copysign(radius, np.min(motion.r) + np.max(motion.r) - 2.0 * motion.r[0])
    w = feed / radius
    t = sample_time * np.arange(np.ceil(4.0 * np.pi / (w * sample_time)))
    return ReferenceMotion(
        motion.r[0] + side * (1.0 - np.cos(w * t)), side * w * np.sin(w * t), side * w * w * np.cos(w * t)
    )


def write(axis: IdentifiedAxis, folder: Path) -> list[Path]:
    """Write the sheet."""
    import numpy as np

    from friction_fmus.export.axis_fit import AxisFit, rms
    from friction_fmus.export.drive_sheet import Row, lost, text, write_sheet
    from friction_fmus.listings import shown

    (loop, *gains), u = cascade(axis), axis.words
    motion, Ts = loop.motion, loop.sample_time
    radius, feed = 0.25 * float(np.ptp(motion.r)), 0.5 * float(np.max(np.abs(motion.rd)))
    path = circle(motion, Ts, radius, feed)

    def error(force: Array) -> Array:
        return loop.error(force + axis.offset, path)[len(path.r) // 2 :]  # the first turn contains the start

    before = error(np.zeros(len(path.r)))
    found = [(rms(before), 0.0, Ts)]
    for time in Ts * 2.0 ** np.arange(TIMES):
        one = pulse(path, time, Ts, *gains)
        slope = (error(0.1 * feed * one) - before) / (0.1 * feed)
        best = -float(slope @ before) / max(float(slope @ slope), 1e-300)
        found += [(rms(error(size * one)), size, time) for size in (best, 0.5 * best) if size > 0.0]
    least, size, time = min(found)
    factor, unit = (30.0 / np.pi, "rev/min") if axis.rotary else (60e3, "mm/min")
    size, time = float(text(factor * size)) / factor, round(float(time), 5)
    values = ("1", ""), ("1", ""), ("0", ""), (text(factor * size), unit), (text(time), "s")
    rows = [Row(name, *value, "axis machine data", MANUAL) for name, value in zip(NAMES, values, strict=True)]
    force = axis.offset + size * pulse(motion, time, Ts, *gains)
    fit = AxisFit(replace(axis, loop=replace(loop, fed=rms(loop.error(0.0 * force + axis.offset)))))
    notes = [
        f"Tuned to a circle with a radius of {shown(radius, u.m)} and a path velocity of {shown(feed, u.m_s)}: there, "
        f"the tracking error of the axis falls from {shown(found[0][0], u.m)} to {shown(least, u.m)} rms.",
        f"The servo without compensation and with this sheet has integral action, {gains[1]:.4g} {u.N_m}.",
        "A pulse begins with each motion and is taken to decay exponentially. It does not depend on the acceleration "
        "(MD32550 to MD32570).",
        *lost(axis),
    ]
    return write_sheet(fit, folder, "sinumerik", "Siemens SINUMERIK", rows, force, notes)


TARGET = Target("a sheet for the quadrant error compensation of Siemens SINUMERIK", "axis", write)
