"""Measured records that travel with the package, each with its citation."""

from .emps import EMPS_PUBLISHED, MeasuredAxis, ServoSettings, load_emps

__all__ = ["EMPS_PUBLISHED", "MeasuredAxis", "ServoSettings", "load_emps"]
