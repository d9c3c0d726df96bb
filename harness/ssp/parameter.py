"""One value of a parameter set."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field, replace

from harness.errors import StartValueError, nearest
from harness.parts.part import Port, StartValue
from harness.ssp.package import converted, known_unit
from harness.ssp.structure import Linear, Transformation
from harness.units import BaseUnit, needed_unit

_LOG = logging.getLogger("harness")


@dataclass(frozen=True)
class Parameter:
    """One value of a parameter set.

    Parameters
    ----------
    value : float, int, bool or str
        The value, in the given unit.
    unit : str or None
        Unit of a float; None stands for the unit of the variable that receives the value.
    base : BaseUnit or None
        The unit in base units; None derives it from the unit name.
    description : str
        One line of text.
    item : bool
        Whether the value is the name of an enumeration item.
    type : str
        Type of FMI 3.0, such as ``Int64``, which SSP 2.0 states; empty for the types of SSP 1.0.
    shape : tuple of int
        Sizes of the array of which the parameter is an element; () for a scalar.
    """

    value: StartValue
    unit: str | None = None
    base: BaseUnit | None = None
    description: str = ""
    item: bool = False
    type: str = ""
    shape: tuple[int, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        """Convert a number with a unit to a float."""
        if self.unit is not None and type(self.value) is int:
            object.__setattr__(self, "value", float(self.value))

    def landed(
        self,
        base: BaseUnit | None,
        where: str,
        *,
        unit: str | None = None,
        suppress: bool = False,
        transformation: Transformation | None = None,
    ) -> Parameter:
        """Return the parameter at a connector or variable with this unit: first converted, then transformed.

        `where` names it in messages; `unit` is the name of its unit, which means the same as an equal name of the
        parameter's unit.
        """
        value, own = self.value, self.base
        if own is None and self.unit is not None and not suppress:
            own = base if self.unit == unit else needed_unit(self.unit, None, f"the value of {where}")
        if own is not None and not suppress and isinstance(value, float):
            base = base or needed_unit(unit, None, where)
            if base is not None:
                factor, offset = converted(own, base, where)
                value = factor * value + offset
        value = (transformation or Linear())(value, where)
        return replace(self, value=value, unit=None, base=base or own)

    def start_value(self, port: Port, where: str) -> StartValue:
        """Return this parameter as the start value of a variable, in its unit; `where` names it in messages."""
        landed = self.landed(known_unit(port.unit, port.base), where, unit=port.unit)
        value = landed.value
        if not port.unit and landed.base not in (None, BaseUnit()) and port.type == "Real":
            _LOG.warning("%s has no unit: the number %s is taken as it is, in [%s]", where, value, landed.base)
        if self.item:
            items = dict(port.items)
            if value not in items:
                raise StartValueError(f"{where} has no item '{value}': {nearest(str(value), items)}")
            return items[str(value)]
        if port.type == "Real" and isinstance(value, (int, float)) and not isinstance(value, bool):
            if isinstance(value, int) and int(float(value)) != value:
                raise StartValueError(f"{where} is {value}, which is not exact as a float: choose a smaller number")
            return float(value)
        if type(value) is {"Integer": int, "Boolean": bool, "String": str}.get(port.type):
            return value
        raise StartValueError(f"{where} is {value!r}, which is not of type {port.type}: give a value of this type")
