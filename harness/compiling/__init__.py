"""Compilers and the platforms they build libraries for."""
