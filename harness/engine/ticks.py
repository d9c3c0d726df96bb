"""The ticks of a run, in the compiled engine or in Python."""

from __future__ import annotations

from harness.engine.algorithm import attach_lines
from harness.engine.defect import Coupling
from harness.engine.manipulate import Manipulations
from harness.engine.native import NOT_CONVERGED, Engine
from harness.engine.tap import Recorder
from harness.errors import ExperimentError, HarnessError
from harness.system.experiment import Experiment
from harness.system.plan import Plan, Program, Schedule


class NativeTicks:
    """The ticks in C.

    Attributes
    ----------
    memory : dict of str to array
        What the mechanisms of the present run remember from step to step, for a checkpoint.
    """

    def __init__(self, plan: Plan, schedule: Schedule, experiment: Experiment) -> None:
        """Lay out what all runs have in common."""
        self._engine, self._lines = Engine(plan, schedule.operations), schedule.lines
        self._algorithm = schedule.algorithm(self._engine) if schedule.algorithm else None
        self._coupling = None if schedule.implicit else Coupling(self._engine, schedule)
        self._manipulations = Manipulations(plan, schedule, experiment.manipulators)

    def begin(self, recorder: Recorder) -> None:
        """Begin a run, whose parts have been started."""
        self._recorder = recorder
        self._engine.begin(recorder.rows, recorder.columns, recorder.decimate)
        self._manipulations.begin()
        self._manipulations.attach(self._engine)
        if self._lines:
            attach_lines(self._engine, self._lines)
        mechanisms = [each for each in (self._algorithm, self._coupling) if each is not None]
        for mechanism in mechanisms:
            mechanism.begin()
        remembering = (*mechanisms, self._manipulations)
        self.memory = {name: array for each in remembering for name, array in each.memory().items()}

    def run(self, first: int, last: int) -> None:
        """Run the ticks first, ..., last - 1."""
        data = self._engine.data
        data.filled = self._recorder.filled
        try:
            with self._engine.interruptible():
                self._engine.run(first, last)
        except HarnessError:
            if self._algorithm and data.status == NOT_CONVERGED:
                raise self._algorithm.failure(int(data.failed_part), float(data.failed_time)) from None
            raise
        finally:
            self._recorder.filled = int(data.filled)

    def attributes(self) -> dict[str, str | float]:
        """Return what is to be known of the run, for the attributes of the result."""
        mechanisms = [each for each in (self._algorithm, self._coupling) if each is not None]
        return {name: value for each in mechanisms for name, value in each.report().items()}

    def close(self) -> None:
        """Free the states that were saved within steps, and the table."""
        self._engine.end()


class PythonTicks:
    """The ticks in Python, of masters that hold values."""

    def __init__(self, plan: Plan, schedule: Schedule, experiment: Experiment) -> None:
        """Check the master."""
        if not schedule.operations or schedule.lines:
            raise ExperimentError("this master runs in the compiled engine only: leave native as it is")
        self._plan, self._schedule = plan, schedule
        self._manipulations = Manipulations(plan, schedule, experiment.manipulators)

    def begin(self, recorder: Recorder) -> None:
        """Begin a run, whose parts have been started."""
        self._manipulations.begin()
        self._advance = Program(self._plan, self._schedule.operations, self._manipulations)
        self.memory = self._manipulations.memory()

    def run(self, first: int, last: int) -> None:
        """Run the ticks first, ..., last - 1; time is the integer tick and nothing else."""
        for tick in range(first, last):
            self._advance(tick)

    def attributes(self) -> dict[str, str | float]:
        """Return nothing: nothing is measured."""
        return {}

    def close(self) -> None:
        """Do nothing: no state was saved."""
