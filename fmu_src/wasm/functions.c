/* exp2 and log from functions without a table: the tables of the C library's own, 4 kB each, would be a fifth of a
   module. The files of this project are compiled to call these. */

#include <math.h>

double wasm_exp2(double x);
double wasm_log(double x);

double wasm_exp2(double x)
{
    static const volatile double two = 2.0; /* the compiler would make exp2(x) of pow(2.0, x) */
    return pow(two, x);
}

/* x = 2^exponent (1 + rest) with |rest| < 0.42, ln 2 = high + low; high times an exponent is exact. */
double wasm_log(double x)
{
    static const double high = 0x1.62e42feep-1, low = 0x1.a39ef35793c76p-33;
    int exponent = 0;
    double part = frexp(x, &exponent);
    if (part < 0.70710678118654752) {
        part *= 2.0;
        exponent--;
    }
    if (!(x > 0.0 && x < HUGE_VAL))
        return log1p(x - 1.0);
    return exponent * high + (log1p(part - 1.0) + exponent * low);
}
