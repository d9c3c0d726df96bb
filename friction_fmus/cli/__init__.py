"""The command line ``friction-fmus``.

Each module of `friction_fmus.cli.commands` is a command with the module's name; its docstring is the help text. The
module has two functions, ``add_arguments(parser)`` and ``run(options)``. At the top it imports only what the help
needs; ``run`` imports everything else, so that no command loads the libraries of another.
"""
