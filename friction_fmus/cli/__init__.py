"""The command line ``friction-fmus``.

A command is a module of `friction_fmus.cli.commands`, found by its file. Its docstring is the help text, its name that
of the command, and it has two functions: ``add_arguments(parser)`` and ``run(options)``. At the top it imports only
what the help needs; ``run`` imports the rest, so that no command waits for the libraries of another.
"""
