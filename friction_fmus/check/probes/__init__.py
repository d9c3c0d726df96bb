"""What is done with the binary of an FMU, in a process of its own.

The process imports this package by its folder and nothing else of the project, so that it starts quickly: its modules
use the standard library only.
"""
