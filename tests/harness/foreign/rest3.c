/* The functions of FMI 3.0 that types3.c lacks: they return an error, or no instance. */

#define ABSENT(name)                                                                                                   \
    int fmi3##name(void) { return 3; }
#define NO_INSTANCE(name)                                                                                              \
    void *fmi3##name(void) { return 0; }
NO_INSTANCE(InstantiateModelExchange)
NO_INSTANCE(InstantiateScheduledExecution)
ABSENT(GetString)
ABSENT(GetBinary)
ABSENT(SetBinary)
ABSENT(GetClock)
ABSENT(GetNumberOfVariableDependencies)
ABSENT(GetVariableDependencies)
ABSENT(GetDirectionalDerivative)
ABSENT(GetAdjointDerivative)
ABSENT(GetIntervalFraction)
ABSENT(GetShiftFraction)
ABSENT(SetIntervalDecimal)
ABSENT(SetIntervalFraction)
ABSENT(SetShiftDecimal)
ABSENT(SetShiftFraction)
ABSENT(EvaluateDiscreteStates)
ABSENT(GetOutputDerivatives)
ABSENT(ActivateModelPartition)
