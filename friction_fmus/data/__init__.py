"""Measured records included in the package, each with its citation."""

from .emps import EMPS_PUBLISHED, MeasuredAxis, ServoSettings, load_emps
from .tribometer import load_tribometer

__all__ = ["EMPS_PUBLISHED", "MeasuredAxis", "ServoSettings", "load_emps", "load_tribometer"]
