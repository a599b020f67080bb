/* The fmi2CallbackLogger given to FMUs. It formats the message into a bounded buffer and hands
 * finished text to `receive`, which is the first member of the component environment (see
 * logging.rs). Any argument may be NULL and any status may come; both are passed on as they are. */
#include <stdarg.h>
#include <stdio.h>

enum { TEXT_SIZE = 2048 };

struct environment {
    void (*receive)(const struct environment *self, const char *instance, int status,
                    const char *category, const char *text);
};

void punctual_host_logger(const struct environment *environment, const char *instance, int status,
                          const char *category, const char *message, ...)
{
    char text[TEXT_SIZE] = "";
    va_list arguments;

    if (environment == NULL)
        return;
    if (message != NULL) {
        va_start(arguments, message);
        if (vsnprintf(text, sizeof text, message, arguments) < 0)
            snprintf(text, sizeof text, "%s", "(a message that could not be formatted)");
        va_end(arguments);
    }
    environment->receive(environment, instance, status, category, text);
}
