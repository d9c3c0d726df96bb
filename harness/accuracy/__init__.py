"""Accuracy: how far a result is off, from the same run with other steps."""
