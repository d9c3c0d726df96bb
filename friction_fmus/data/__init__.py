"""Measured records included in the package, each with its citation."""

from friction_fmus.identification.data.record import MeasuredAxis, ServoSettings

from .emps import EMPS_PUBLISHED, load_emps
from .tribometer import load_tribometer

__all__ = ["EMPS_PUBLISHED", "MeasuredAxis", "ServoSettings", "load_emps", "load_tribometer"]
