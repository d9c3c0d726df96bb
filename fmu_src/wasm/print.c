/* snprintf and vsnprintf for the messages of FMUs of this project, which use %s %d %u %x %g and %%, with width,
   precision and the flag 0. The functions of the C library, which also prints long double, would be a third of a
   module. Numbers are exact: all digits of a double are computed, then rounded. */

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    char *text;
    size_t room, used; /* `used` also counts what has no room */
} Sink;

static void put(Sink *s, char c)
{
    if (s->used + 1 < s->room)
        s->text[s->used] = c;
    s->used++;
}

/* Write a text, or its beginning. */
static void put_text(Sink *s, const char *text, size_t most)
{
    while (*text && most-- > 0)
        put(s, *text++);
}

static void put_whole(Sink *s, uint64_t value, unsigned base, int width, char padding)
{
    char digits[24];
    int n = 0;
    do
        digits[n++] = "0123456789abcdef"[value % base];
    while ((value /= base) > 0);
    for (int k = n; k < width; k++)
        put(s, padding);
    while (n > 0)
        put(s, digits[--n]);
}

/* Decimal digits: digit[POINT + p] counts 10^p, for p from `low` to `high`. */
enum { POINT = 1076, MOST_DIGITS = POINT + 312 };
typedef struct {
    unsigned char digit[MOST_DIGITS];
    int low, high;
} Decimal;

/* Compute all digits of a positive finite number: those of its 53 bits, doubled or halved as often as needed. */
static void decimal(Decimal *d, double x)
{
    unsigned char *const digit = d->digit + POINT;
    int exponent;
    uint64_t whole = (uint64_t)ldexp(frexp(x, &exponent), 53);
    memset(d, 0, sizeof *d);
    for (; whole > 0; whole /= 10)
        digit[d->high++] = (unsigned char)(whole % 10);
    for (exponent -= 53; exponent > 0; exponent--)
        for (int p = d->low, carry = 0; p <= d->high || carry; p++) {
            const int value = 2 * digit[p] + carry;
            carry = value > 9;
            digit[p] = (unsigned char)(value - 10 * carry);
            d->high = p > d->high ? p : d->high;
        }
    for (; exponent < 0; exponent++)
        for (int p = d->high, rest = 0; p >= d->low || rest; p--) {
            const int value = 10 * rest + digit[p];
            rest = value % 2;
            digit[p] = (unsigned char)(value / 2);
            d->low = p < d->low ? p : d->low;
        }
    while (digit[d->high] == 0)
        d->high--;
}

/* Round to this number of digits, a tie to an even digit, and leave out zeros at the end. */
static void round_to(Decimal *d, int precision)
{
    unsigned char *const digit = d->digit + POINT;
    int last = d->high - precision + 1;
    if (last > d->low) {
        while (d->low < last - 1 && digit[d->low] == 0)
            d->low++;
        const int half = digit[last - 1];
        const bool up = half > 5 || (half == 5 && (d->low < last - 1 || digit[last] % 2 == 1));
        for (d->low = last; up && digit[last] == 9; last++)
            digit[last] = 0;
        digit[last] = (unsigned char)(digit[last] + up);
        d->high = last > d->high ? last : d->high;
    }
    while (d->low < d->high && digit[d->low] == 0)
        d->low++;
}

/* %g with this precision. */
static void put_number(Sink *s, double x, int precision)
{
    if (signbit(x))
        put(s, '-');
    if (!isfinite(x) || x == 0.0) {
        put_text(s, isnan(x) ? "nan" : x == 0.0 ? "0" : "inf", SIZE_MAX);
        return;
    }
    Decimal d;
    decimal(&d, fabs(x));
    round_to(&d, precision);
    const int exponent = d.high;
    const bool scientific = exponent < -4 || exponent >= precision;
    const int point = scientific ? exponent : 0; /* the power of ten before the decimal point */
    const int first = exponent > point ? exponent : point;
    for (int p = first; p >= (d.low < point ? d.low : point); p--) {
        if (p == point - 1)
            put(s, '.');
        put(s, (char)('0' + d.digit[POINT + p]));
    }
    if (scientific) {
        put(s, 'e');
        put(s, exponent < 0 ? '-' : '+');
        put_whole(s, (uint64_t)(exponent < 0 ? -exponent : exponent), 10, 2, '0');
    }
}

static int number_in(const char **format)
{
    int value = 0;
    while (**format >= '0' && **format <= '9')
        value = 10 * value + (*(*format)++ - '0');
    return value;
}

int vsnprintf(char *text, size_t room, const char *format, va_list arguments)
{
    Sink s = {text, room, 0};
    while (*format) {
        if (*format != '%') {
            put(&s, *format++);
            continue;
        }
        format++;
        const char padding = *format == '0' ? '0' : ' ';
        const int width = number_in(&format);
        int precision = -1, longs = 0;
        if (*format == '.') {
            format++;
            precision = number_in(&format);
        }
        for (; *format == 'l'; format++)
            longs++;
        const char kind = *format ? *format++ : '%';
        if (kind == 's') {
            put_text(&s, va_arg(arguments, const char *), precision < 0 ? SIZE_MAX : (size_t)precision);
        } else if (kind == 'g') {
            put_number(&s, va_arg(arguments, double), precision < 0 ? 6 : precision);
        } else if (kind == 'd' || kind == 'u' || kind == 'x') {
            uint64_t value = longs > 1 ? va_arg(arguments, uint64_t) : va_arg(arguments, uint32_t);
            if (kind == 'd' && (longs > 1 ? (int64_t)value < 0 : (int32_t)value < 0)) {
                put(&s, '-');
                value = longs > 1 ? -value : (uint32_t)-value;
            }
            put_whole(&s, value, kind == 'x' ? 16 : 10, width, padding);
        } else {
            put(&s, kind);
        }
    }
    if (room > 0)
        text[s.used < room ? s.used : room - 1] = '\0';
    return (int)s.used;
}

int snprintf(char *text, size_t room, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(text, room, format, arguments);
    va_end(arguments);
    return length;
}
