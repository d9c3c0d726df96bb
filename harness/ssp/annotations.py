"""Annotations for what an SSD cannot express: settings of the experiment, sample times and delays.

The communication step is also written to the annotations of the Open Simulation Platform and of OpenModelica, which
libcosim and OMSimulator read.
"""

import logging
from collections.abc import Callable, Mapping
from contextlib import suppress
from types import MappingProxyType
from typing import Any, Final

from lxml import etree

from harness.errors import ExperimentError, SystemFileError
from harness.parts.fmu import FmuPart
from harness.ssp.package import SPACES, sub
from harness.system.experiment import Experiment
from harness.system.wire import manipulator_table, read_manipulator

#: Type of the annotations for each prefix of their content.
TYPES: Final = MappingProxyType(
    {"harness": "friction-fmus.harness", "osp": "com.opensimulationplatform", "oms": "org.openmodelica"}
)

_LOG = logging.getLogger("harness")
_SCALARS: Final[Mapping[str, Callable[[str], Any]]] = MappingProxyType(
    {"step": float, "master": str, "decimate": int, "extrapolation": int}
    | dict.fromkeys(("tolerance", "loop_tolerance", "coupling_tolerance", "step_tolerance"), float)
)
_PART: Final[Mapping[str, Callable[[Any], Any]]] = MappingProxyType({"every": int, "model": str})
_LISTS: Final = ("record", "order")


def annotate(element: etree._Element, tag: str, **attributes: str) -> etree._Element:
    """Append an annotation ``prefix:name`` to an element, after existing ones, and return its content."""
    group = element.find("ssd:Annotations", SPACES)
    group = sub(element, "ssd:Annotations") if group is None else group
    return sub(sub(group, "ssc:Annotation", type=TYPES[tag.split(":")[0]]), tag, **attributes)


def write_experiment(root: etree._Element, experiment: Experiment) -> None:
    """Append the DefaultExperiment."""
    element = sub(root, "ssd:DefaultExperiment", startTime=repr(experiment.start), stopTime=repr(experiment.stop))
    settings = annotate(element, "harness:Experiment", **_texts({key: getattr(experiment, key) for key in _SCALARS}))
    for key in _LISTS:
        for name in getattr(experiment, key):
            sub(settings, f"harness:{key}", name=name)
    for manipulator in experiment.manipulators:
        sub(settings, "harness:manipulator", **_texts(manipulator_table(manipulator)))
    sub(annotate(element, "osp:Algorithm"), "osp:FixedStepAlgorithm", baseStepSize=repr(experiment.step))


def write_step(system: etree._Element, experiment: Experiment) -> None:
    """Append the communication step for OMSimulator, whose master uses 0 for a missing tolerance."""
    information = sub(annotate(system, "oms:Annotations"), "oms:SimulationInformation")
    tolerance = repr(1e-4 if experiment.tolerance is None else experiment.tolerance)
    sub(
        information,
        "oms:FixedStepMaster",
        description="oms-ma",
        stepSize=repr(experiment.step),
        absoluteTolerance=tolerance,
        relativeTolerance=tolerance,
    )


def read_experiment(root: etree._Element, where: str) -> Experiment | None:
    """Return the experiment, or None if the stop time or the communication step is missing or invalid."""
    element = root.find("ssd:DefaultExperiment", SPACES)
    if element is None:
        return None
    times = {"start": element.get("startTime", "0"), "stop": element.get("stopTime")}
    own = _find(element, "harness:Experiment")
    osp = _find(element, "osp:Algorithm")
    try:
        if own is not None:
            return _own_experiment({**times, **{str(k): v for k, v in own.items()}}, own)
        steps = [] if osp is None else [item.get("baseStepSize") for item in osp]
        if times["stop"] is None or not steps:
            return None
        return Experiment(float(times["stop"]), float(steps[0] or ""), float(times["start"] or ""))
    except ExperimentError as error:
        _LOG.warning("%s: its experiment is ignored, give stop and step for a run: %s", where, error)
        return None
    except (KeyError, TypeError, ValueError) as error:
        raise SystemFileError(f"{where} has a malformed experiment ({error}): write it again") from error


def write_part(element: etree._Element, part: FmuPart) -> None:
    """Append the settings of a part that are not in its FMU, if there are any."""
    settings: dict[str, object] = {} if part.every == 1 else {"every": part.every}
    settings |= {"model": part.model}
    texts = _texts(settings)
    if texts:
        annotate(element, "harness:Part", **texts)


def read_part(element: etree._Element, where: str) -> dict[str, Any]:
    """Return the arguments of the part that `write_part` wrote."""
    own = _find(element, "harness:Part")
    try:
        return {} if own is None else {key: read(own.get(key)) for key, read in _PART.items() if key in own.attrib}
    except ValueError as error:
        raise SystemFileError(f"{where} has a malformed annotation ({error}): write it again") from error


def read_wire(element: etree._Element, where: str) -> tuple[int, float | None, tuple[float, float] | None]:
    """Return delay and initial value of a connection, and gain and offset of the original connection if stated."""
    own = _find(element, "harness:Wire")
    if own is None:
        return 0, None, None
    try:
        gain, offset, initial = own.get("gain"), own.get("offset"), own.get("initial")
        exact = None if gain is None or offset is None else (float(gain), float(offset))
        return int(own.get("delay", "0")), None if initial is None else float(initial), exact
    except ValueError as error:
        raise SystemFileError(f"{where} has a malformed annotation ({error}): write it again") from error


def _own_experiment(texts: dict[str, Any], element: etree._Element) -> Experiment:
    settings = {key: read(texts[key]) for key, read in _SCALARS.items() if key in texts}
    for key in _LISTS:
        settings[key] = tuple(item.get("name", "") for item in element.iterfind(f"harness:{key}", SPACES))
    settings["manipulators"] = tuple(
        read_manipulator({str(key): _number(str(text)) for key, text in item.items()})
        for item in element.iterfind("harness:manipulator", SPACES)
    )
    return Experiment(start=float(texts["start"]), stop=float(texts["stop"]), **settings)


def _texts(values: Mapping[str, object]) -> dict[str, str]:
    return {key: str(value) for key, value in values.items() if value is not None}


def _number(text: str) -> str | float | int:
    """Return a text as a number if it is one, else unchanged."""
    for read in (int, float):
        with suppress(ValueError):
            return read(text)
    return text


def _find(element: etree._Element, tag: str) -> etree._Element | None:
    """Return the content ``prefix:name`` of an annotation of the type for this prefix."""
    for annotation in element.iterfind("ssd:Annotations/ssc:Annotation", SPACES):
        if annotation.get("type") == TYPES[tag.split(":")[0]]:
            return annotation.find(tag, SPACES)
    return None
