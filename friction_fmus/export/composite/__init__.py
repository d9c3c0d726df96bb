"""A system as one FMU: its parts and the engine, compiled together."""
