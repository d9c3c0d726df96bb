"""A law as plain C for an embedded target: sources, unit test, example, and measured cost on microcontrollers."""

from friction_fmus.codegen.cost import Cost, Spread, measure
from friction_fmus.codegen.emulation import CORES, Core
from friction_fmus.codegen.law_export import export_law
from friction_fmus.codegen.layout import Export

__all__ = ["CORES", "Core", "Cost", "Export", "Spread", "export_law", "measure"]
