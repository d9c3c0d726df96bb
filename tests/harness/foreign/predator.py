"""Lotka and Volterra's predator as a pythonfmu FMU: y' = y (growth x - death), exact for x held during a step."""

import math

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Predator(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y, self.x, self.death, self.growth = 1.0, 1.0, 0.4, 0.1
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(Real("x", causality=Fmi2Causality.input))
        for name in ("death", "growth"):
            variability = Fmi2Variability.tunable
            self.register_variable(Real(name, causality=Fmi2Causality.parameter, variability=variability))

    def do_step(self, t, h):
        self.y *= math.exp(h * (self.growth * self.x - self.death))
        return True
