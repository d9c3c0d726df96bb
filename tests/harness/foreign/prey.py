"""Lotka and Volterra's prey as a pythonfmu FMU: x' = x (birth - eaten y), exact for y held during a step."""

import math

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real, String


class Prey(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.x, self.y, self.birth, self.eaten = 2.0, 1.0, 1.1, 0.4
        self.species = "hare"
        self.letters = 0.0
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        self.register_variable(Real("letters", causality=Fmi2Causality.output))
        self.register_variable(Real("y", causality=Fmi2Causality.input))
        for name in ("birth", "eaten"):
            variability = Fmi2Variability.tunable
            self.register_variable(Real(name, causality=Fmi2Causality.parameter, variability=variability))
        variability = Fmi2Variability.fixed
        self.register_variable(String("species", causality=Fmi2Causality.parameter, variability=variability))

    def exit_initialization_mode(self):
        self.letters = float(len(self.species))

    def do_step(self, t, h):
        self.x *= math.exp(h * (self.birth - self.eaten * self.y))
        return True
