/* The fmi2CallbackLogger given to FMUs. It formats the message into a bounded buffer and hands
 * finished text to `receive`, which is the first member of the component environment (see
 * logging.rs). Any argument may be NULL and any status may come; both are passed on as they are. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum { TEXT_SIZE = 2048 };

struct environment {
    void (*receive)(const struct environment *self, const char *instance, int status,
                    const char *category, const char *text);
};

/* Whether the format holds %n, which writes through an argument. No log message needs it, and one that
 * came from a text with a stray per cent sign would write anywhere. */
static int writes(const char *format)
{
    for (; (format = strchr(format, '%')) != NULL; format++) {
        format += 1 + strspn(format + 1, "-+ #0123456789.*'hljztLq$");
        if (*format == 'n')
            return 1;
        if (*format == '\0')
            return 0;
    }
    return 0;
}

void punctual_host_logger(const struct environment *environment, const char *instance, int status,
                          const char *category, const char *message, ...)
{
    char text[TEXT_SIZE] = "";
    va_list arguments;

    if (environment == NULL)
        return;
    if (message != NULL && writes(message)) {
        snprintf(text, sizeof text, "%s", message);
    } else if (message != NULL) {
        va_start(arguments, message);
        if (vsnprintf(text, sizeof text, message, arguments) < 0)
            snprintf(text, sizeof text, "%s", "(a message that could not be formatted)");
        va_end(arguments);
    }
    environment->receive(environment, instance, status, category, text);
}
