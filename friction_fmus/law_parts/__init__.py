"""Expressions that groups of laws share."""
