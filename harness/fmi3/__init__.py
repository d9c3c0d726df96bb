"""FMUs of FMI 3.0, made from those of FMI 2.0 with their sources."""

from harness.fmi3.package import fmi_3

__all__ = ["fmi_3"]
