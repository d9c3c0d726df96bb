"""The native engine: each mechanism in C, next to its Python side."""

ENGINES = ("auto", "general", "compiled")
"""How the loop over communication steps is run: by the code for all systems, by code compiled for this one, or by the
latter where it pays."""
