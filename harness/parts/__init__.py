"""Parts of a system: FMUs, series and Python functions."""
