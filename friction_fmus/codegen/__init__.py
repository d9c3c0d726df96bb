"""A law as plain C for an embedded target: sources, example, and measured cost on two microcontrollers."""

from friction_fmus.codegen.cost import CORES, Core, Cost, measure
from friction_fmus.codegen.export import export_law
from friction_fmus.codegen.layout import Export

__all__ = ["CORES", "Core", "Cost", "Export", "export_law", "measure"]
