"""Siemens SINUMERIK: a pulse of the velocity setpoint at each reversal (quadrant error compensation)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from friction_fmus.export.targets import Target

if TYPE_CHECKING:
    from friction_fmus.export.axis_loop import Array, AxisLoop, Motion
    from friction_fmus.export.identified_axis import IdentifiedAxis

MANUALS: Final = (
    (
        "Siemens, SINUMERIK 840D sl, Function Manual Extended Functions 03/2013, K3, p. 296",
        "https://www.easymanua.ls/siemens/sinumerik-series/manual/275710?p=296",
    ),
    (
        "Siemens, SINUMERIK 808D, Function Manual, Friction compensation (quadrant error compensation)",
        "https://www.manualslib.com/manual/1238451/Siemens-Sinumerik-808d.html?page=117",
    ),
)
TIMES: Final = 11  # number of time constants that are tried, from a sample on, each twice the one before


def cascade(axis: IdentifiedAxis) -> tuple[AxisLoop, float, float]:
    """Return the servo with integral action, and its gains of velocity [N.s/m] and integral of the velocity [N/m].

    The integral action of a servo without one gets a reset time of four time constants M/kv of the velocity loop.
    """
    from friction_fmus.errors import BuildError

    if axis.loop is None or axis.mass <= 0.0:
        raise BuildError("SINUMERIK needs servo and mass of the axis: export a study that compared compensators.")
    gains = {**axis.loop.gains}
    pid = "Kp" in gains
    kv, kp = (gains["Kd"], gains["Kp"] / gains["Kd"]) if pid else (gains["kv"], gains["kp"])
    ki = (gains["Ki"] / kp if pid else gains["ki"]) or kv**2 / (4.0 * axis.mass)
    gains |= {"Ki": ki * kp} if pid else {"ki": ki}
    return replace(axis.loop, gains=gains), kv, ki


def pulse(motion: Motion, time: float, sample_time: float, kv: float, ki: float) -> Array:
    """Return the force, shape (n,) [N], for pulses of 1 m/s that begin with each motion and decay with a time [s]."""
    import numpy as np
    from scipy.signal import lfilter

    from friction_fmus.export.axis_fit import signs

    sign = signs(motion)
    begins = np.where(np.diff(sign, prepend=0.0) != 0.0, sign, 0.0)
    w: Array = lfilter([1.0], [1.0, -np.exp(-sample_time / time)], begins)
    return kv * w + ki * sample_time * (np.cumsum(w) - w)


def circle(motion: Motion, sample_time: float) -> tuple[Motion, float, float]:
    """Return two turns of an axis of a circle, its radius [m] and its path velocity [m/s]."""
    import numpy as np

    from friction_fmus.export.axis_loop import Motion

    radius, feed = 0.25 * float(np.ptp(motion.r)), 0.5 * float(np.max(np.abs(motion.rd)))
    w = feed / radius
    t = sample_time * np.arange(np.ceil(4.0 * np.pi / (w * sample_time)))
    way = radius * np.sin(w * t), radius * np.cos(w * t)
    return Motion(motion.r[0] + radius - way[1], w * way[0], w * w * way[1]), radius, feed


def write(axis: IdentifiedAxis, folder: Path) -> list[Path]:
    """Write the sheet."""
    import numpy as np

    from friction_fmus.export.axis_fit import AxisFit, rms
    from friction_fmus.export.drive_sheet import Row, Sheet, Source, lost, text, write_sheet
    from friction_fmus.listings import shown

    (loop, *gains), u = cascade(axis), axis.words
    path, radius, feed = circle(loop.motion, loop.sample_time)
    still = np.full(len(path.r), axis.offset)
    second = slice(len(still) // 2, None)  # the first turn contains the start
    before = loop.error(still, path)[second]
    found = [(rms(before), 0.0, loop.sample_time)]
    for time in loop.sample_time * 2.0 ** np.arange(TIMES):
        column, probe = pulse(path, time, loop.sample_time, *gains), 0.1 * feed
        slope = (loop.error(still + probe * column, path)[second] - before) / probe
        size = -float(slope @ before) / max(float(slope @ slope), 1e-300)
        sizes = (size, 0.5 * size) if size > 0.0 else ()
        found += [(rms(loop.error(still + each * column, path)[second]), each, time) for each in sizes]
    least, size, time = min(found)
    factor, unit = (30.0 / np.pi, "rev/min") if axis.rotary else (60e3, "mm/min")
    size, time = float(text(factor * size)) / factor, round(float(time), 5)
    rows = [
        Row("MD32490 FRICT_COMP_MODE", "1", "", "axis machine data", Source(*MANUALS[0])),
        Row("MD32500 FRICT_COMP_ENABLE", "1", "", "axis machine data", Source(*MANUALS[0])),
        Row("MD32510 FRICT_COMP_ADAPT_ENABLE", "0", "", "axis machine data", Source(*MANUALS[0])),
        Row("MD32520 FRICT_COMP_CONST_MAX", text(factor * size), unit, "axis machine data", Source(*MANUALS[0])),
        Row("MD32540 FRICT_COMP_TIME", text(time), "s", "axis machine data", Source(*MANUALS[1])),
    ]
    force = axis.offset + size * pulse(loop.motion, time, loop.sample_time, *gains)
    fit = AxisFit(replace(axis, loop=replace(loop, fed=rms(loop.error(0.0 * force + axis.offset)))))
    notes = [
        f"Tuned to a circle with a radius of {shown(radius, u.m)} and a path velocity of {shown(feed, u.m_s)}: there, "
        f"the tracking error of the axis falls from {shown(found[0][0], u.m)} to {shown(least, u.m)} rms.",
        "The pulse begins with each motion and is taken to decay exponentially. It does not depend on the acceleration "
        "(MD32550 to MD32570).",
        *lost(axis),
    ]
    if loop.gains != axis.loop.gains:
        notes.insert(
            1, f"The servo of the record has no integral action; here it has one, with {gains[1]:.4g} {u.N_m}."
        )
    return write_sheet(Sheet("Siemens SINUMERIK", rows, force, notes), fit, folder, "sinumerik")


TARGET = Target("a sheet for the quadrant error compensation of Siemens SINUMERIK", "axis", write)
