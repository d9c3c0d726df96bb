"""Tools that `reference run` knows, each a program that runs one case: `python -m ... CASE OUTPUT`."""
