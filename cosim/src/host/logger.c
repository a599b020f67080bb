/* What an FMU passes by address: texts, and the arguments of the fmi2CallbackLogger. Nothing of it is trusted. Any
 * argument may be NULL or an address that cannot be read, and any status may come. So bytes are copied by the system,
 * which refuses where a plain read would crash, and the component environment is passed on as a number (see logging.rs). */
#define _GNU_SOURCE
#include <errno.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#if defined(__linux__)
#include <sys/uio.h>
#include <unistd.h>
#elif defined(__APPLE__)
#include <mach/mach.h>
#elif defined(_WIN32)
#include <windows.h>
#endif

enum {
    TEXT_SIZE = 2048,
    /* Bytes that are readable or not together, on every system. */
    PAGE = 4096,
    /* The greatest number of conversions in a message. Further ones would be read from ever further up the stack. */
    CONVERSIONS = 64,
};

/* Defined in logging.rs. */
void punctual_host_receive(const void *environment, int status, const char *category, const char *text);

/* Copies bytes of one page. False: they cannot be read. */
static int copy(const char *from, char *to, size_t size)
{
#if defined(__linux__)
    struct iovec there = {(void *)(uintptr_t)from, size}, here = {to, size};
    ssize_t read = process_vm_readv(getpid(), &here, 1, &there, 1, 0);

    if (read >= 0 || errno == EFAULT)
        return read == (ssize_t)size;
    /* A sandbox that lacks this call. */
    memcpy(to, from, size);
    return 1;
#elif defined(__APPLE__)
    vm_size_t read = 0;

    return vm_read_overwrite(mach_task_self(), (vm_address_t)from, size, (vm_address_t)to, &read) == KERN_SUCCESS
           && read == size;
#elif defined(_WIN32)
    SIZE_T read = 0;

    return ReadProcessMemory(GetCurrentProcess(), from, to, size, &read) && read == size;
#else
    memcpy(to, from, size);
    return 1;
#endif
}

/* Copies a text to `to`, which has room for `size` bytes, the zero byte at the end among them. Returns its length; a text that
 * is longer, or becomes unreadable, is cut. -1: nothing of it can be read. */
ptrdiff_t punctual_host_text(const char *from, char *to, size_t size)
{
    size_t length = 0;
    int error = errno;

    while (length + 1 < size) {
        size_t part = PAGE - ((uintptr_t)from + length) % PAGE;
        const char *end;

        if (part > size - 1 - length)
            part = size - 1 - length;
        if (!copy(from + length, to + length, part)) {
            if (length == 0)
                length = SIZE_MAX;
            break;
        }
        end = memchr(to + length, '\0', part);
        if (end != NULL) {
            length = (size_t)(end - to);
            break;
        }
        length += part;
    }
    errno = error;
    if (length == SIZE_MAX)
        return -1;
    to[length] = '\0';
    return (ptrdiff_t)length;
}

/* A number of at most four digits, or the next argument for a star, within the same bounds. */
static int number(const char **format, va_list *arguments)
{
    int value = 0;

    if (**format == '*') {
        ++*format;
        value = va_arg(*arguments, int);
        return value < -TEXT_SIZE ? -TEXT_SIZE : value > TEXT_SIZE ? TEXT_SIZE : value;
    }
    for (; **format >= '0' && **format <= '9'; ++*format)
        value = value > TEXT_SIZE ? value : 10 * value + **format - '0';
    return value > TEXT_SIZE ? TEXT_SIZE : value;
}

/* Formats one conversion into `to` and returns the number of its characters in the format; 0 where it is none, or one whose
 * argument is a text that cannot be read. Then it is shown as it stands: in "a%20small%20shop" the per cent sign is a part of
 * the text, and there is no argument. */
static size_t convert(const char *format, va_list *arguments, char *to, size_t size)
{
    static const char LENGTHS[] = "hlqjztL";
    const char *at = format + 1;
    char flags[8] = "", spec[24], text[TEXT_SIZE], length = 'i';
    size_t count = strspn(at, "-+ #0'");
    int width, precision = -1, twice = 0;

    if (count >= sizeof flags)
        return 0;
    memcpy(flags, at, count);
    at += count;
    width = number(&at, arguments);
    if (*at == '.') {
        at++;
        precision = number(&at, arguments);
    }
    for (; *at != '\0' && strchr(LENGTHS, *at) != NULL; at++) {
        twice = length == *at;
        length = *at;
    }
#define AS(kind) (snprintf(spec, sizeof spec, "%%%s*.*%s", flags, kind), spec)
    switch (*at) {
    case 'd': case 'i': {
        long long value = length == 'l' && !twice ? va_arg(*arguments, long)
                          : length == 'z'         ? (long long)va_arg(*arguments, size_t)
                          : length == 't'         ? va_arg(*arguments, ptrdiff_t)
                          : length == 'i' || length == 'h' ? va_arg(*arguments, int)
                                                           : va_arg(*arguments, long long);

        if (length == 'h')
            value = twice ? (signed char)value : (short)value;
        snprintf(to, size, AS("lld"), width, precision, value);
        break;
    }
    case 'u': case 'o': case 'x': case 'X': {
        const char kind[] = {'l', 'l', *at, '\0'};
        unsigned long long value = length == 'l' && !twice ? va_arg(*arguments, unsigned long)
                                   : length == 'z'         ? va_arg(*arguments, size_t)
                                   : length == 't'         ? (unsigned long long)va_arg(*arguments, ptrdiff_t)
                                   : length == 'i' || length == 'h' ? va_arg(*arguments, unsigned)
                                                                    : va_arg(*arguments, unsigned long long);

        if (length == 'h')
            value = twice ? (unsigned char)value : (unsigned short)value;
        snprintf(to, size, AS(kind), width, precision, value);
        break;
    }
    case 'e': case 'E': case 'f': case 'F': case 'g': case 'G': case 'a': case 'A': {
        const char kind[] = {*at, '\0'};
        double value = length == 'L' ? (double)va_arg(*arguments, long double) : va_arg(*arguments, double);

        snprintf(to, size, AS(kind), width, precision, value);
        break;
    }
    case 'c':
        snprintf(to, size, "%*c", width, va_arg(*arguments, int));
        break;
    case 'p':
        snprintf(to, size, "%*p", width, va_arg(*arguments, void *));
        break;
    case 's': {
        const char *value;
        size_t room = precision < 0 || precision >= TEXT_SIZE ? TEXT_SIZE : (size_t)precision + 1;

        /* With these flags it is no conversion of a text: "100% sure". */
        if (strpbrk(flags, " +#0") != NULL || length == 'l')
            return 0;
        value = va_arg(*arguments, const char *);
        if (value == NULL)
            snprintf(text, sizeof text, "(null)");
        else if (punctual_host_text(value, text, room) < 0)
            return 0;
        snprintf(to, size, strchr(flags, '-') ? "%-*s" : "%*s", width, text);
        break;
    }
    case '%':
        if (at != format + 1)
            return 0;
        snprintf(to, size, "%%");
        break;
    default:
        return 0;
    }
#undef AS
    return (size_t)(at + 1 - format);
}

/* Whether the format holds %n, which writes through an argument, or arguments by their numbers. No log message needs them. */
static int is_strange(const char *format)
{
    for (; (format = strchr(format, '%')) != NULL; format++) {
        format += 1 + strspn(format + 1, "-+ #0123456789.*'hljztLq");
        if (*format == 'n' || *format == '$')
            return 1;
        if (*format == '\0')
            return 0;
    }
    return 0;
}

/* Formats a message as printf would. What is no conversion stays as it is. */
static void fill(char *text, const char *format, va_list *arguments)
{
    size_t length = 0;
    int conversions = 0;

    while (*format != '\0' && length < TEXT_SIZE - 1) {
        size_t taken = 0;

        text[length] = '\0';
        if (*format == '%' && conversions < CONVERSIONS) {
            conversions++;
            taken = convert(format, arguments, text + length, TEXT_SIZE - length);
        }
        if (taken > 0) {
            length += strlen(text + length);
            format += taken;
        } else {
            text[length++] = *format++;
        }
    }
    text[length] = '\0';
}

void punctual_host_logger(const void *environment, const char *instance, int status, const char *category,
                          const char *message, ...)
{
    char format[TEXT_SIZE], text[TEXT_SIZE] = "";
    int error = errno;

    (void)instance;
    if (message != NULL && punctual_host_text(message, format, sizeof format) < 0) {
        snprintf(text, sizeof text, "(a message at an address that cannot be read)");
    } else if (message != NULL && is_strange(format)) {
        memcpy(text, format, sizeof text);
    } else if (message != NULL) {
        va_list arguments;

        va_start(arguments, message);
        fill(text, format, &arguments);
        va_end(arguments);
    }
    punctual_host_receive(environment, status, category, text);
    errno = error;
}
