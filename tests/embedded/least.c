/* The least program with a filter, to see how much flash the library takes. */
#include "punctual.h"

extern const unsigned char file[];
extern const size_t file_size;
const unsigned char file[8] = {0};
const size_t file_size = sizeof file;
static double memory[8];

void _start(void);

void _start(void) {
    punctual_filter *filter;
    double x[4] = {0}, u[2] = {0};
    punctual_report report;
    punctual_barrier_report barrier;
    punctual_load(memory, sizeof memory, file, file_size, &filter);
    for (;;) {
        punctual_step(filter, 0, x, 4, u, u, 2, &report);
        punctual_barrier(filter, 0, &barrier);
    }
}
