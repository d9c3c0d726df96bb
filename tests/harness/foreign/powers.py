"""Powers of the time as a pythonfmu3 FMU: an array, integers of 64 bits, a Boolean, and a decay by Euler's method."""

import numpy as np
from pythonfmu3 import Boolean, Dimension, Float64, Fmi3Causality, Fmi3Slave, Fmi3Variability, Int64


class Powers(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.rate, self.decay = 0.0, 2.0, 1.0
        self.powers = np.zeros(3)
        self.steps, self.late = 0, False
        continuous, discrete = Fmi3Variability.continuous, Fmi3Variability.discrete
        self.register_variable(Float64("time", causality=Fmi3Causality.independent, variability=continuous))
        size = [Dimension(start="3")]
        output = Fmi3Causality.output
        self.register_variable(Float64("powers", causality=output, variability=continuous, dimensions=size))
        self.register_variable(Int64("steps", causality=output, variability=discrete))
        self.register_variable(Boolean("late", causality=output, variability=discrete))
        self.register_variable(Float64("decay", causality=output, variability=continuous))
        self.register_variable(Float64("rate", causality=Fmi3Causality.input, variability=continuous))

    def do_step(self, t, h):
        self.powers = np.array([t + h, (t + h) ** 2, (t + h) ** 3])
        self.steps += 1
        self.late = t + h > 0.45
        self.decay *= 1.0 - h * self.rate
        return True
