/* Floating-point control of a thread: rounding mode, treatment of denormal numbers and of invalid operations. A part
   that changes it changes the results of all other parts. */

#ifndef FLOATS_H
#define FLOATS_H

#include "engine.h"

#if defined __x86_64__ || defined __i386__
/* Bits 6 to 15: MXCSR (denormals are zero, masks, rounding, flush to zero). Bits 16 to 29: bits 0 to 13 of the x87
   control word (masks, precision, rounding). */
static inline uint32_t float_control(void)
{
    uint32_t sse = 0;
    uint16_t x87 = 0;
    __asm__ volatile("stmxcsr %0" : "=m"(sse));
    __asm__ volatile("fnstcw %0" : "=m"(x87));
    return (sse & 0xffc0U) | ((uint32_t)(x87 & 0x0f3fU) << 16);
}

static inline void set_float_control(uint32_t control)
{
    const uint32_t sse = control & 0xffc0U;
    const uint16_t x87 = (uint16_t)(control >> 16);
    __asm__ volatile("ldmxcsr %0" : : "m"(sse));
    __asm__ volatile("fldcw %0" : : "m"(x87));
}
#elif defined __aarch64__
/* FPCR: rounding, flush to zero, default NaN, traps. */
static inline uint32_t float_control(void)
{
    uint64_t control = 0;
    __asm__ volatile("mrs %0, fpcr" : "=r"(control));
    return (uint32_t)control;
}

static inline void set_float_control(uint32_t control) { __asm__ volatile("msr fpcr, %0" : : "r"((uint64_t)control)); }
#else
static inline uint32_t float_control(void) { return 0; }
static inline void set_float_control(uint32_t control) { (void)control; }
#endif

#endif
