"""The parts of a law: declarations, equations, conditions, and the block generated from it."""
