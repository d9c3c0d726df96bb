"""A set of cases with proven reference values, which tests tools that import FMUs."""
