/* The models of benches/sources.rs as plug-ins: MODEL 0 is the point mass, 1 the unicycle, 2 the bicycle. */
#include "punctual_model.h"

static const punctual_variable states[] = {
    {"x", "m", 0, 0, 0, 0}, {"y", "m", 0, 0, 0, 0}, {"p", "1", 0, 0, 0, 0}, {"q", "m/s", 0, 0, 0, 0}};
static const punctual_variable inputs[] = {{"a", "1", 0, 0, 0, 0}, {"b", "1", 0, 0, 0, 0}};
static const punctual_variable barriers[] = {{"goal", "m", 0, 0, 0, 0}};

static void plant(const punctual_calculator *c, const double *parameter, const punctual_number *x,
                  punctual_number *f, punctual_number *g) {
    (void)parameter;
#if MODEL == 0
    f[0] = x[2];
    f[1] = x[3];
    g[2] = punctual_constant(c, 1.0);
    g[3 + 4] = punctual_constant(c, 1.0);
#else
    f[0] = punctual_multiply(c, x[3], punctual_cos(c, x[2]));
    f[1] = punctual_multiply(c, x[3], punctual_sin(c, x[2]));
    g[2 + 4] = MODEL == 1 ? punctual_constant(c, 1.0) : punctual_scale(c, x[3], 1.0 / 10.0);
    g[3] = punctual_constant(c, 1.0);
#endif
}

static punctual_number barrier(const punctual_calculator *c, uint32_t index, const double *parameter,
                               punctual_number t, const punctual_number *x) {
    punctual_number dx = punctual_offset(c, x[0], -45.0), dy = punctual_offset(c, x[1], -45.0), square;
    (void)index, (void)parameter, (void)t;
    square = punctual_add(c, punctual_multiply(c, dx, dx), punctual_multiply(c, dy, dy));
    return punctual_from(c, 2.8284271247461903, punctual_sqrt(c, punctual_offset(c, square, 4.0)));
}

static const punctual_model_description model = {
    PUNCTUAL_ABI, sizeof(punctual_model_description), 4, 2, 0, 1, states, inputs, 0, barriers, 0, plant, barrier};

const punctual_model_description *punctual_model(void) {
    return &model;
}
