/* snprintf and vsnprintf for the messages of FMUs of this project, which use %s %d %u %x %g and %%, with width,
   precision and the flag 0. The functions of the C library, which also prints long double, would be a third of a
   module. Numbers are exact: all digits of a double are computed, then rounded. */

#include <math.h>
#include <stdarg.h>
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

/* Decimal digits of a number 0.d1 d2 d3 ... times 10^point. 2^-1074 has 767 digits. */
typedef struct {
    unsigned char digit[800];
    int count, point;
} Decimal;

static void twice(Decimal *d)
{
    int carry = 0;
    for (int k = d->count; k-- > 0;) {
        const int value = 2 * d->digit[k] + carry;
        carry = value > 9;
        d->digit[k] = (unsigned char)(value - 10 * carry);
    }
    if (carry) {
        memmove(d->digit + 1, d->digit, (size_t)d->count++);
        d->digit[0] = 1;
        d->point++;
    }
}

static void half(Decimal *d)
{
    int rest = 0;
    for (int k = 0; k < d->count; k++) {
        const int value = 10 * rest + d->digit[k];
        d->digit[k] = (unsigned char)(value / 2);
        rest = value % 2;
    }
    if (rest)
        d->digit[d->count++] = 5;
    if (d->digit[0] == 0) {
        memmove(d->digit, d->digit + 1, (size_t)--d->count);
        d->point--;
    }
}

/* Return all digits of a positive finite number. */
static Decimal decimal(double x)
{
    int exponent;
    uint64_t whole = (uint64_t)ldexp(frexp(x, &exponent), 53);
    Decimal d = {.count = 17, .point = 17};
    for (int k = 17; k-- > 0; whole /= 10)
        d.digit[k] = (unsigned char)(whole % 10);
    while (d.digit[0] == 0) {
        memmove(d.digit, d.digit + 1, (size_t)--d.count);
        d.point--;
    }
    for (exponent -= 53; exponent > 0; exponent--)
        twice(&d);
    for (; exponent < 0; exponent++)
        half(&d);
    return d;
}

/* Round to this number of digits, a tie to an even digit, and remove zeros at the end. */
static void round_to(Decimal *d, int precision)
{
    if (d->count > precision) {
        int more = d->digit[precision] >= 5;
        if (d->digit[precision] == 5) {
            int k = precision + 1;
            while (k < d->count && d->digit[k] == 0)
                k++;
            more = k < d->count || d->digit[precision - 1] % 2 == 1;
        }
        d->count = precision;
        int k = precision;
        while (more && k-- > 0) {
            more = d->digit[k] == 9;
            d->digit[k] = (unsigned char)(more ? 0 : d->digit[k] + 1);
        }
        if (more) {
            d->digit[0] = 1;
            d->point++;
        }
    }
    while (d->count > 1 && d->digit[d->count - 1] == 0)
        d->count--;
}

static void put_digits(Sink *s, const Decimal *d, int from, int end)
{
    for (int k = from; k < end; k++)
        put(s, (char)('0' + (k >= 0 && k < d->count ? d->digit[k] : 0)));
}

/* %g with this precision. */
static void put_number(Sink *s, double x, int precision)
{
    if (signbit(x))
        put(s, '-');
    if (!isfinite(x) || x == 0.0) {
        put_text(s, isnan(x) ? "nan" : isinf(x) ? "inf" : "0", SIZE_MAX);
        return;
    }
    Decimal d = decimal(fabs(x));
    round_to(&d, precision > 0 ? precision : 1);
    const int exponent = d.point - 1;
    const int before = exponent < -4 || exponent >= precision ? 1 : d.point; /* digits before the decimal point */
    put_digits(s, &d, before > 0 ? 0 : -1, before > 0 ? before : 0);
    if (d.count > before) {
        put(s, '.');
        put_digits(s, &d, before, d.count);
    }
    if (before != d.point) {
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
