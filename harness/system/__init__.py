"""A system: its parts and connections, and the plan of a run."""
