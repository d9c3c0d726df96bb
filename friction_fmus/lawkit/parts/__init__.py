"""Expressions that a group of laws shares, one module for each group."""
