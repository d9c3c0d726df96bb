/* FMI 3.0 around the FMI 2.0 functions of a block or composite, which are included before: every rule on values, steps
   and states is in one place. Here are the modes, arrays, clocks and calls that FMI 3.0 adds. The generated file has
   defined before:

     TOKEN       the instantiation token, as text; GUID_INSIDE: the GUID of FMI 2.0
     REFERENCES  the number of value references of FMI 2.0, each of one element
     INDICATORS_REFERENCE, CLOCK_REFERENCE: value references of the first of INDICATOR_COUNT event indicators, and of
   the clock of samples; that of another variable is its position in modelDescription.xml, from 1 ALL_REFERENCES: one
   more than the last value reference variables_3[] by reference state_variables[], STATE_VARIABLES: references of the
   continuous states, in the order of FMI 2.0 STRUCTURAL  the reference in FMI 2.0 of the structural parameter, if there
   is one HAS_MODEL_EXCHANGE, HAS_EVENT_MODE: 0 or 1 */

#ifndef FMI3_H
#define FMI3_H

#include "fmi3_instance.h"
#include "fmi3_life.h"
#include "fmi3_values.h"
#include "fmi3_events.h"
#include "fmi3_clock.h"
#include "fmi3_step.h"
#include "fmi3_state.h"
#include "fmi3_derivatives.h"
#include "fmi3_exchange.h"

#endif
