"""System Structure and Parameterization 1.0 and 2.0: systems as .ssp archives, parameter sets as .ssv files."""

from harness.ssp.ssd import read_ssp, write_ssp
from harness.ssp.ssv import Parameter, ParameterSet, read_ssv, ssv_bytes, write_ssv

__all__ = ["Parameter", "ParameterSet", "read_ssp", "read_ssv", "ssv_bytes", "write_ssp", "write_ssv"]
