/* A car at 1 kHz: what a timer interrupt does on a board, with a simulated car in place of sensors and motors.
 *
 *     punctual build car.toml --embedded car.bin      writes car.h too, with the names and the bytes
 */
#include <math.h>
#include <stdio.h>

#include "car.h"
#include "punctual.h"

/* Memory of the filter. punctual_size says how much: 140 kB of it here, 42 kB on a Cortex-M with the feature two-inputs. */
static double memory[160 * 1024 / sizeof(double)];

/* The car, which stands for sensors and motors. */
static void drive(double x[CAR_STATES], const double u[CAR_INPUTS], double seconds) {
    x[CAR_STATE_X_P] += seconds * x[CAR_STATE_V] * cos(x[CAR_STATE_THETA]);
    x[CAR_STATE_Y_P] += seconds * x[CAR_STATE_V] * sin(x[CAR_STATE_THETA]);
    x[CAR_STATE_THETA] += seconds * u[CAR_INPUT_OMEGA];
    x[CAR_STATE_V] += seconds * u[CAR_INPUT_A];
}

int main(void) {
    punctual_filter *filter;
    enum punctual_result result = punctual_load(memory, sizeof memory, car_file, sizeof car_file, &filter);
    if (result != PUNCTUAL_RESULT_OK) {
        printf("no filter: %d\n", (int)result);
        return 1;
    }
    /* A start within [follower] of x0. */
    double x[CAR_STATES] = {0.06, -0.06, 0.02, 1.03}, nearest = INFINITY;
    unsigned long changed = 0, unkept = 0;
    const unsigned long ticks = 20000;
    for (unsigned long tick = 0; tick < ticks; tick++) {
        /* A product of the tick and its length: a sum of lengths would drift. */
        double t = 0.001 * (double)tick;
        double u_ref[CAR_INPUTS] = {[CAR_INPUT_A] = 1.5 - x[CAR_STATE_V],
                                    [CAR_INPUT_OMEGA] = 2.0 * (0.2 - x[CAR_STATE_THETA])};
        double u[CAR_INPUTS];
        punctual_report report;
        result = punctual_step(filter, t, x, CAR_STATES, u_ref, u, CAR_INPUTS, &report);
        if (result != PUNCTUAL_RESULT_OK) return 1; /* A length is wrong: no loop that has run once meets it. */
        changed += report.status != PUNCTUAL_UNCHANGED;
        /* Without a plan the rows decide, and a step may be impossible: say so, slow down, stop. */
        unkept += report.plan != PUNCTUAL_PLAN_KEPT;
        for (int i = CAR_BARRIER_POST_1; i <= CAR_BARRIER_POST_10; i++) {
            punctual_barrier_report barrier;
            if (punctual_barrier(filter, (size_t)i, &barrier) == PUNCTUAL_RESULT_OK && barrier.h < nearest)
                nearest = barrier.h;
        }
        drive(x, u, 0.001);
    }
    punctual_barrier_report goal;
    if (punctual_barrier(filter, CAR_BARRIER_GOAL, &goal) != PUNCTUAL_RESULT_OK) return 1;
    printf("at (%.2f, %.2f) m; goal reached at %.2f s; nearest post: h = %.3f m; %lu of %lu inputs changed, %lu without a guarantee\n",
           x[CAR_STATE_X_P], x[CAR_STATE_Y_P], goal.arrival_time, nearest, changed, ticks, unkept);
    return !(goal.arrival_time <= 20.0 && nearest >= 0.0 && unkept == 0);
}
