"""Probes that call the binary of an FMU in a separate process.

To start quickly, the process imports this package by its folder and nothing else of the project; its modules use the
standard library only.
"""
