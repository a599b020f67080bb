// A unicycle with lags in both inputs and a disc to be in: ../models/lagging-unicycle-filter.toml as a plug-in.
//
//     c++ -std=c++11 -O2 -shared -fPIC -I ../../fmu/include -o liblagging_unicycle.so lagging_unicycle.cpp
#include "punctual_model.h"

using punctual::Number;

static const punctual_variable states[] = {
    {"x_p", "m", "position along x", 0, 0, 0}, {"y_p", "m", "position along y", 0, 0, 0},
    {"theta", "rad", "heading", 0, 0, 0},      {"v", "m/s", "speed", 0, 0, 0},
    {"a", "m/s2", "acceleration", 0, 0, 0},    {"omega", "rad/s", "turning rate", 0, 0, 0},
};
static const punctual_variable inputs[] = {
    {"a_cmd", "m/s2", "wanted acceleration", 0, 0, 0},
    {"omega_cmd", "rad/s", "wanted turning rate", 0, 0, 0},
};
static const punctual_variable parameters[] = {
    {"lag_a", "s", "lag of the acceleration", 0.001, 1e3, 0.3},
    {"lag_omega", "s", "lag of the turning rate", 0.001, 1e3, 0.2},
    {"c_x", "m", "centre of the disc along x", -1e6, 1e6, 45},
    {"c_y", "m", "centre of the disc along y", -1e6, 1e6, 45},
    {"R", "m", "radius of the disc", 0.001, 1e6, 2},
};
static const punctual_variable barriers[] = {{"goal", "m", "inside the disc", 0, 0, 0}};

static void plant(const punctual_calculator *c, const double *parameter, const punctual_number *x,
                  punctual_number *f, punctual_number *g) {
    const Number theta = {c, x[2]}, v = {c, x[3]}, a = {c, x[4]}, omega = {c, x[5]};
    f[0] = v * cos(theta);
    f[1] = v * sin(theta);
    f[2] = omega;
    f[3] = a;
    f[4] = -a / parameter[0];
    f[5] = -omega / parameter[1];
    g[4 + 0 * 6] = punctual_constant(c, 1 / parameter[0]);
    g[5 + 1 * 6] = punctual_constant(c, 1 / parameter[1]);
}

static punctual_number barrier(const punctual_calculator *c, uint32_t, const double *parameter, punctual_number,
                               const punctual_number *x) {
    const double radius = parameter[4];
    const Number dx = Number{c, x[0]} - parameter[2], dy = Number{c, x[1]} - parameter[3];
    const Number square = Number{c, punctual_constant(c, 2 * radius * radius)};
    return sqrt(square) - sqrt(dx * dx + dy * dy + radius * radius);
}

static const punctual_model_description model = {
    PUNCTUAL_ABI, sizeof(punctual_model_description), 6, 2, 5, 1, states, inputs, parameters, barriers, nullptr, plant, barrier,
};

const punctual_model_description *punctual_model(void) {
    return &model;
}
