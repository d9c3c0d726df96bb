"""Parts of a system: FMUs, series, Python functions."""
