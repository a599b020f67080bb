// The loop of loop.c in C++20: a filter that is saved at half-time, and a second one that continues from there.
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "car.h"
#include "punctual.hpp"

namespace {

alignas(8) std::array<std::byte, 160 * 1024> first_memory, second_memory;
std::array<std::byte, 8 * 1024> saved;

using state = std::array<double, CAR_STATES>;
using input = std::array<double, CAR_INPUTS>;

void drive(state &x, const input &u, double seconds) {
    x[CAR_STATE_X_P] += seconds * x[CAR_STATE_V] * std::cos(x[CAR_STATE_THETA]);
    x[CAR_STATE_Y_P] += seconds * x[CAR_STATE_V] * std::sin(x[CAR_STATE_THETA]);
    x[CAR_STATE_THETA] += seconds * u[CAR_INPUT_OMEGA];
    x[CAR_STATE_V] += seconds * u[CAR_INPUT_A];
}

} // namespace

int main() {
    punctual::filter filter(first_memory, car_file), second(second_memory, car_file);
    if (!filter || !second) {
        std::printf("no filter: %d\n", static_cast<int>(filter.loaded()));
        return 1;
    }
    state x{0.06, -0.06, 0.02, 1.03}; // within [follower] of x0
    double nearest = std::numeric_limits<double>::infinity();
    for (unsigned tick = 0; tick < 20000; tick++) {
        input u_ref{1.5 - x[CAR_STATE_V], 2.0 * (0.2 - x[CAR_STATE_THETA])}, u{};
        if (tick == 10000) {
            std::size_t written = 0;
            if (filter.save(saved, written) != PUNCTUAL_RESULT_OK) return 1;
            if (second.restore(std::span(saved).first(written)) != PUNCTUAL_RESULT_OK) return 1;
            filter = std::move(second);
        }
        punctual::report report{};
        if (filter.step(0.001 * tick, x, u_ref, u, &report) != PUNCTUAL_RESULT_OK) return 1;
        if (report.plan != PUNCTUAL_PLAN_KEPT) return 1;
        for (std::size_t i = 1; i < filter.barriers(); i++) {
            punctual::barrier_report barrier{};
            if (filter.barrier(i, barrier) == PUNCTUAL_RESULT_OK) nearest = std::fmin(nearest, barrier.h);
        }
        drive(x, u, 0.001);
    }
    punctual::barrier_report goal{};
    if (filter.barrier(CAR_BARRIER_GOAL, goal) != PUNCTUAL_RESULT_OK) return 1;
    std::printf("at (%.2f, %.2f) m; goal reached at %.2f s; nearest post: h = %.3f m\n", x[CAR_STATE_X_P], x[CAR_STATE_Y_P],
                goal.arrival_time, nearest);
    return !(goal.arrival_time <= 20.0 && nearest >= 0.0);
}
