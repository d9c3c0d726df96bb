"""Variables shared by many laws, with unit, start value, description and limits: ``rd: SX = variables.RD``.

A law whose variable has another description, start value or limits declares it itself.
"""

from dataclasses import replace
from typing import Any

from friction_fmus.lawkit.declarations import Command, Input, Output, Parameter, State
from friction_fmus.lawkit.quantities import ACCELERATION, DAMPING, FORCE, LENGTH, MASS, NO_UNIT, STIFFNESS, VELOCITY


def starting(variable: Any, start: float) -> Any:
    """Return a variable with another start value."""
    return replace(variable, start=start)


# ---- signals ---------------------------------------------------------------------------------------------------------

R: Any = Input(LENGTH, 0.0, "reference position")
RD: Any = Input(VELOCITY, 0.0, "reference velocity")
RDD: Any = Input(ACCELERATION, 0.0, "reference acceleration")
X: Any = Input(LENGTH, 0.0, "measured position")
V: Any = Input(VELOCITY, 0.0, "measured velocity")
FED_FORWARD: Any = Input(FORCE, 0.0, "feedforward {force}, added before the limits", optional=True)
FN: Any = Input("N", 1.0, "normal force of the contact, such as of LoadFeedforward", optional=True)
U_TRACK: Any = Input(FORCE, 0.0, "{force} from which u continues while track is true", optional=True)
U_PREV: Any = Input(FORCE, 0.0, "{force} applied since the last sample, after all limits")

# ---- commands --------------------------------------------------------------------------------------------------------

ENABLE: Any = Command(True, "false: u = 0 and F_hat = 0")
ENABLE_STATES: Any = Command(True, "false: u = 0, F_hat = 0 and the states are at their start values")
ENABLE_INTEGRAL: Any = Command(True, "false: u = 0 and the integral is at its start value")
RESET: Any = Command(False, "true: the states are reset to their start values")
RESET_INTEGRAL: Any = Command(False, "true: the integral is reset to its start value")
TRACK: Any = Command(False, "true: the states are set so that u = u_track")

# ---- states ----------------------------------------------------------------------------------------------------------

LAST: Any = State(LENGTH, 0.0, "reference in the previous sample")
STARTED: Any = State(NO_UNIT, 0.0, "1 if there is a previous sample", flag=True)
RUNNING: Any = State(NO_UNIT, 0.0, "1 after the first sample", flag=True)
MISSED: Any = replace(
    State(NO_UNIT, 0.0, "number of samples missed before this one, as an input was invalid"), tally=True, min=0.0
)
X_HAT: Any = State(LENGTH, 0.0, "estimated position", nominal=1e-3)
V_HAT: Any = State(VELOCITY, 0.0, "estimated velocity", nominal=1e-2)

# ---- limits, share and mass ------------------------------------------------------------------------------------------

GAIN: Any = Parameter(NO_UNIT, 1.0, "fraction of the friction that is compensated", min=0.0, max=1.0)
U_MIN: Any = Parameter(FORCE, -1000.0, "lower limit of u")
U_MAX: Any = Parameter(FORCE, 1000.0, "upper limit of u")
LAM: Any = Parameter("1/s", 63.0, "decay rate of the position error while s = 0", min=0.0)
INERTIA: Any = Parameter(MASS, 1.0, "{mass} of the inertia feedforward; 0: none", min=0.0)
MASS_OR_NONE: Any = Parameter(MASS, 1.0, "{moving_mass}", min=0.0)
POSITIVE_MASS: Any = Parameter(MASS, 1.0, "{moving_mass}", min=1e-12)

# ---- multi-loop scheme -----------------------------------------------------------------------------------------------

KP: Any = Parameter("1/s", 63.0, "gain of the position loop", min=0.0)
KV1: Any = Parameter(NO_UNIT, 1.0, "velocity feedforward to the velocity command", min=0.0)
KA: Any = Parameter(MASS, 1.0, "acceleration feedforward to the {force}", min=0.0)
KV2: Any = Parameter(DAMPING, 0.4, "velocity feedforward to the {force}", min=0.0)
FV_OF_KARNOPP: Any = Parameter(DAMPING, 0.0, "viscous coefficient of the Karnopp model, in addition to Kv2", min=0.0)
DV: Any = Parameter(VELOCITY, 1e-3, "half width of the velocity band treated as standstill", min=1e-12)

# ---- friction --------------------------------------------------------------------------------------------------------

FC: Any = Parameter(FORCE, 1.0, "Coulomb friction", min=0.0)
POSITIVE_FC: Any = Parameter(FORCE, 1.0, "Coulomb friction", min=1e-9)
FS: Any = Parameter(FORCE, 1.5, "static friction (usually above Fc)", min=0.0)
POSITIVE_FS: Any = Parameter(FORCE, 1.5, "static friction (usually above Fc)", min=1e-9)
FV: Any = Parameter(DAMPING, 0.4, "viscous coefficient", min=0.0)
V_REST: Any = Parameter(VELOCITY, 0.0, "|rd| up to which the reference rests, above the rounding of rd", min=0.0)
FN0: Any = Parameter("N", 1.0, "normal force for which the parameters are valid", min=1e-12)
VS: Any = Parameter(VELOCITY, 1e-3, "Stribeck velocity", min=1e-12)
DELTA: Any = Parameter(NO_UNIT, 2.0, "Stribeck exponent", min=1e-3, max=100.0)
SIGMA0: Any = Parameter(STIFFNESS, 1e5, "bristle stiffness", min=1e-9)
SIGMA1: Any = Parameter(DAMPING, 316.22776601683796, "bristle damping", min=0.0)
SIGMA2: Any = Parameter(DAMPING, 0.4, "viscous coefficient", min=0.0)

# ---- outputs ---------------------------------------------------------------------------------------------------------

U_SAT: Any = Output(NO_UNIT, "active limit: -1 lower, +1 upper, 0 none")
F_HAT: Any = Output(FORCE, "estimated friction {force}; u contains gain F_hat")
U_CONTROL: Any = Output(FORCE, "control {force}, within u_min and u_max")
U_FORWARD: Any = Output(FORCE, "feedforward {force}, within u_min and u_max")
U_COMPENSATION: Any = Output(FORCE, "compensation {force} gain F_hat, within u_min and u_max")

CONTROL = {"u": U_CONTROL, "u_sat": U_SAT}
TRACKING = {"u": U_CONTROL, "F_hat": F_HAT, "u_sat": U_SAT}
FEEDFORWARD = {"u": U_FORWARD, "F_hat": F_HAT, "u_sat": U_SAT}
COMPENSATION = {"u": U_COMPENSATION, "F_hat": F_HAT, "u_sat": U_SAT}
