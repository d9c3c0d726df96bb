"""Search for parameters: unknowns, simulation, least squares, standard errors."""
