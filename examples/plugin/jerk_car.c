/* A car on a line, steered by its jerk: the model of docs/own-model.md as a plug-in.
 *
 *     cc -std=c99 -O2 -shared -fPIC -I ../../fmu/include -o libjerk_car.so jerk_car.c
 */
#include "punctual_model.h"

enum { P, V, ACC };
enum { D, V_MAX };

static const punctual_variable states[] = {
    {"p", "m", "position", 0, 0, 0},
    {"v", "m/s", "speed", 0, 0, 0},
    {"acc", "m/s2", "acceleration", 0, 0, 0},
};
static const punctual_variable inputs[] = {{"jerk", "m/s3", "jerk", 0, 0, 0}};
static const punctual_variable parameters[] = {
    {"d", "m", "where the merge is", 0, 1e6, 60},
    {"v_max", "m/s", "speed limit", 0, 1e3, 40},
};
static const punctual_variable barriers[] = {
    {"merge", "m", "past the merge", 0, 0, 0},
    {"limit", "m/s", "below the limit", 0, 0, 0},
};

static void plant(const punctual_calculator *c, const double *parameter, const punctual_number *x,
                  punctual_number *f, punctual_number *g) {
    (void)parameter;
    f[P] = x[V];
    f[V] = x[ACC];
    g[ACC] = punctual_constant(c, 1.0);
}

static punctual_number barrier(const punctual_calculator *c, uint32_t index, const double *parameter,
                               punctual_number t, const punctual_number *x) {
    (void)t;
    if (index == 0) {
        return punctual_offset(c, x[P], -parameter[D]);
    }
    return punctual_from(c, parameter[V_MAX], x[V]);
}

static const punctual_model_description model = {
    .abi = PUNCTUAL_ABI,
    .size = sizeof(punctual_model_description),
    .states = 3,
    .inputs = 1,
    .parameters = 2,
    .barriers = 2,
    .state = states,
    .input = inputs,
    .parameter = parameters,
    .barrier = barriers,
    .plant = plant,
    .barrier_value = barrier,
};

const punctual_model_description *punctual_model(void) {
    return &model;
}
