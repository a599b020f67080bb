/* Replays samples that tests/embedded/main.rs recorded, and compares every bit.
 *
 *     replay FILTER SAMPLES [COUNT]
 *
 * Two filters of one file stand side by side. Every thousand steps one is saved and the other continues from that. Prints the memory
 * that was asked for and used, and on a board the deepest stack and the longest step. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "punctual.h"

/* The stack that is looked at, in bytes, and what it is painted with. */
enum { PAINTED = 48 * 1024, NEAR = 512, PAINT = 0xa5 };

#ifdef BOARD
/* The timer of the processor, which counts down 24 bits; on QEMU with -icount shift=0 an instruction takes 1 ns of it. */
#define SYSTICK ((volatile uint32_t *)0xe000e010)
enum { NANOSECONDS_PER_TICK = 40 };

static void clock_start(void) {
    SYSTICK[1] = 0xffffff;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
}

static uint32_t clock_now(void) { return SYSTICK[2]; }

static uint64_t elapsed(uint32_t from, uint32_t to) { return (uint64_t)((from - to) & 0xffffff) * NANOSECONDS_PER_TICK; }
#endif

static __attribute__((noinline)) void paint(void) {
#ifdef BOARD
    volatile unsigned char *top = (volatile unsigned char *)__builtin_frame_address(0) - NEAR;
    for (int i = 0; i < PAINTED; i++) top[-i] = PAINT;
#endif
}

static __attribute__((noinline)) size_t painted_over(void) {
#ifdef BOARD
    volatile unsigned char *top = (volatile unsigned char *)__builtin_frame_address(0) - NEAR;
    for (int i = PAINTED - 1; i >= 0; i--)
        if (top[-i] != PAINT) return (size_t)(i + NEAR);
#endif
    return 0;
}

static void *read_whole(const char *path, size_t *size) {
    FILE *file = fopen(path, "rb");
    if (!file || fseek(file, 0, SEEK_END)) exit(2);
    long end = ftell(file);
    rewind(file);
    void *bytes = malloc((size_t)end);
    if (!bytes || fread(bytes, 1, (size_t)end, file) != (size_t)end) exit(2);
    fclose(file);
    *size = (size_t)end;
    return bytes;
}

static uint64_t fold(uint64_t digest, double number) {
    uint64_t bits = 0x7ff8000000000000;
    if (number == number) memcpy(&bits, &number, sizeof bits);
    return (((digest << 5) | (digest >> 59)) ^ bits) * 0x100000001b3;
}

static uint64_t digest(const punctual_filter *filter, size_t barriers, const punctual_report *report) {
    uint64_t digest = fold(fold(0, (double)report->plan), report->guaranteed_until);
    for (size_t i = 0; i < barriers; i++) {
        punctual_barrier_report b;
        if (punctual_barrier(filter, i, &b) != PUNCTUAL_RESULT_OK) exit(3);
        double numbers[] = {b.h, b.time_left, b.slack, b.arrival_time, (double)b.phase, (double)b.unmet_steps,
                            b.on_course, b.deadline_unreachable, b.deadlocked, b.guaranteed};
        for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++) digest = fold(digest, numbers[k]);
    }
    return digest;
}

static void must(enum punctual_result result, const char *what) {
    if (result == PUNCTUAL_RESULT_OK) return;
    printf("%s: %d\n", what, (int)result);
    exit(1);
}

int main(int count, char **arguments) {
    if (count < 3) return 2;
    size_t file_size, size;
    void *file = read_whole(arguments[1], &file_size);
    must(punctual_size(file, file_size, &size), "size");

    punctual_filter *filters[2];
    unsigned char *memories[2];
    size_t load_stack = 0;
    for (int i = 0; i < 2; i++) {
        memories[i] = malloc(size + 64);
        memset(memories[i], PAINT, size + 64);
        paint();
        must(punctual_load(memories[i], size, file, file_size, &filters[i]), "load");
        if (painted_over() > load_stack) load_stack = painted_over();
        for (int k = 0; k < 64; k++)
            if (memories[i][size + k] != PAINT) return 4;
    }
    /* Rows need the file no longer. */
    if (!strstr(arguments[1], "planned")) memset(file, 0, file_size);
    size_t used = size;
    while (used && memories[0][used - 1] == PAINT) used--;

    size_t states, inputs, barriers;
    must(punctual_dimensions(filters[0], &states, &inputs, &barriers), "dimensions");
    size_t room = punctual_saved_size(filters[0]);
    void *saved = malloc(room);

    FILE *samples = fopen(arguments[2], "rb");
    uint64_t head[3];
    if (!samples || fread(head, sizeof head, 1, samples) != 1 || head[0] != states || head[1] != inputs) return 2;
    uint64_t limit = count > 3 ? strtoull(arguments[3], 0, 10) : head[2];
    if (limit > head[2]) limit = head[2];

    double sample[3 + 64 + 2 * 32], u[32];
    size_t numbers = 3 + states + 2 * inputs, step_stack = 0;
    uint64_t longest = 0, total = 0, wrong = 0;
    int now = 0;
    for (uint64_t step = 0; step < limit; step++) {
        uint64_t wanted[2];
        if (fread(sample, sizeof *sample, numbers, samples) != numbers || fread(wanted, sizeof wanted, 1, samples) != 1) return 2;
        double *x = sample + 3, *u_ref = x + states, *expected = u_ref + inputs;
        if (step % 1000 == 999) {
            size_t written;
            must(punctual_save(filters[now], saved, room, &written), "save");
            now = !now;
            must(punctual_restore(filters[now], saved, written), "restore");
        }
        punctual_filter *filter = filters[now];
        if (sample[0] != 0) must(punctual_rearm(filter), "rearm");
        must(punctual_expect_hold(filter, sample[2]), "expect_hold");
        punctual_report report;
        paint();
#ifdef BOARD
        clock_start();
        uint32_t begin = clock_now();
#endif
        enum punctual_result result = punctual_step(filter, sample[1], x, states, u_ref, u, inputs, &report);
#ifdef BOARD
        uint64_t taken = elapsed(begin, clock_now());
        total += taken;
        if (taken > longest) longest = taken;
#endif
        size_t deep = painted_over();
        if (deep > step_stack) step_stack = deep;
        must(result, "step");
        int same = !memcmp(u, expected, inputs * sizeof *u) && (uint64_t)report.status == wanted[0] &&
                   digest(filter, barriers, &report) == wanted[1];
        if (!same && !wrong++) printf("step %lu differs: status %d, u %.17g not %.17g\n", (unsigned long)step, (int)report.status, u[0], expected[0]);
    }
    /* Not %zu, which small C libraries do not know. */
    printf("%lu barriers, %lu steps, %lu differ; memory %lu bytes, used %lu; saved %lu", (unsigned long)barriers,
           (unsigned long)limit, (unsigned long)wrong, (unsigned long)size, (unsigned long)used, (unsigned long)room);
#ifdef BOARD
    printf("; stack: load %lu, step %lu; instructions: mean %lu, longest %lu", (unsigned long)load_stack, (unsigned long)step_stack,
           (unsigned long)(total / (limit ? limit : 1)), (unsigned long)longest);
#else
    (void)longest, (void)total, (void)load_stack;
#endif
    printf("\n");
    fclose(samples);
    free(saved);
    free(file);
    for (int i = 0; i < 2; i++) free(memories[i]);
    return wrong != 0;
}
