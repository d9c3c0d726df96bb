/* Modes of an FMU, the modes in which each function may be called, and log categories. */

#ifndef FMI2_MODES_H
#define FMI2_MODES_H

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PASTE_(a, b)         a##b
#define PASTE(a, b)          PASTE_(a, b)
#define QUOTE_(name)         #name
#define QUOTE(name)          QUOTE_(name)
#define FMI2_FUNCTION_PREFIX PASTE(MODEL, _)
#include "fmi2Functions.h"

/* Modes, and the modes in which each function may be called (tables in sections 3.2.3 and 4.2.4). Two columns are more
   lenient than the tables, as importers require: inputs may be set directly after fmi2Instantiate. */
/* clang-format off */
enum {
    INSTANTIATED = 1, INITIALIZING = 2, STEP_COMPLETE = 4, STEP_FAILED = 8, TERMINATED = 16,
    EVENT_MODE = 32, CONTINUOUS_TIME = 64 /* in model exchange */
};
enum {
    BEFORE_STEPPING             = INSTANTIATED | INITIALIZING,
    EXCHANGING                  = EVENT_MODE | CONTINUOUS_TIME,
    WITH_RESULTS                = INITIALIZING | STEP_COMPLETE | STEP_FAILED | TERMINATED | EXCHANGING,
    ANY_MODE                    = INSTANTIATED | WITH_RESULTS,
    MAY_SetDebugLogging         = ANY_MODE,
    MAY_SetupExperiment         = INSTANTIATED,
    MAY_EnterInitializationMode = INSTANTIATED,
    MAY_ExitInitializationMode  = INITIALIZING,
    MAY_Terminate               = STEP_COMPLETE | STEP_FAILED | EXCHANGING,
    MAY_Reset                   = ANY_MODE,
    MAY_Get                     = WITH_RESULTS,
    MAY_Set                     = BEFORE_STEPPING | STEP_COMPLETE | EXCHANGING,
    MAY_FMUstate                = ANY_MODE,
    MAY_GetDirectionalDerivative = WITH_RESULTS,
    MAY_SetRealInputDerivatives = BEFORE_STEPPING | STEP_COMPLETE,
    MAY_GetRealOutputDerivatives = STEP_COMPLETE | STEP_FAILED | TERMINATED,
    MAY_DoStep                  = STEP_COMPLETE,
    MAY_GetStatus               = STEP_COMPLETE | STEP_FAILED | TERMINATED,
    MAY_EnterEventMode          = CONTINUOUS_TIME,
    MAY_NewDiscreteStates       = EVENT_MODE,
    MAY_EnterContinuousTimeMode = EVENT_MODE,
    MAY_CompletedIntegratorStep = CONTINUOUS_TIME,
    MAY_SetTime                 = EXCHANGING,
    MAY_SetContinuousStates     = CONTINUOUS_TIME,
    MAY_GetContinuous           = INITIALIZING | EXCHANGING | TERMINATED
};
/* clang-format on */

static const char *const categories[] = {"logStatusWarning", "logStatusDiscard", "logStatusError", "logEvents",
                                         "logAll"};
enum { LOG_WARNING = 1, LOG_DISCARD = 2, LOG_ERROR = 4, LOG_EVENTS = 8, LOG_EVERYTHING = 31, LOG_CATEGORIES = 5 };

enum { GUID_LENGTH = 38 }; /* {8-4-4-4-12} */

#endif
