// Punctual in C++20: a filter as an object that is moved and not copied, with spans for lengths. No exceptions, no allocation.
#ifndef PUNCTUAL_HPP
#define PUNCTUAL_HPP

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "punctual.h"

namespace punctual {

using result = enum punctual_result;
using report = punctual_report;
using barrier_report = punctual_barrier_report;

/// The number of bytes that the filter of a file needs, aligned to 8; 0 if it is no filter for this library.
[[nodiscard]] inline std::size_t size(std::span<const unsigned char> file) noexcept {
    std::size_t size = 0;
    return punctual_size(file.data(), file.size(), &size) == PUNCTUAL_RESULT_OK ? size : 0;
}

/// A filter in memory of the caller, which has to live as long as the filter does.
class filter {
public:
    /// The filter of `file` in `memory`. Whether that succeeded, and why not, says `loaded`.
    filter(std::span<std::byte> memory, std::span<const unsigned char> file) noexcept
        : loaded_(punctual_load(memory.data(), memory.size(), file.data(), file.size(), &own_)) {
        punctual_dimensions(own_, &states_, &inputs_, &barriers_);
    }

    filter(const filter &) = delete;
    filter &operator=(const filter &) = delete;

    filter(filter &&other) noexcept { swap(other); }

    filter &operator=(filter &&other) noexcept {
        swap(other);
        return *this;
    }

    ~filter() = default; // Nothing to free: the memory is the caller's.

    [[nodiscard]] result loaded() const noexcept { return loaded_; }
    explicit operator bool() const noexcept { return own_ != nullptr; }

    [[nodiscard]] std::size_t states() const noexcept { return states_; }
    [[nodiscard]] std::size_t inputs() const noexcept { return inputs_; }
    [[nodiscard]] std::size_t barriers() const noexcept { return barriers_; }

    /// Writes to `u` the safe input nearest to `u_ref` at time `t` (s) and state `x`. `u` may be `u_ref`.
    [[nodiscard]] result step(double t, std::span<const double> x, std::span<const double> u_ref, std::span<double> u,
                              report *report = nullptr) noexcept {
        if (u_ref.size() != u.size()) return PUNCTUAL_RESULT_ARGUMENT;
        return punctual_step(own_, t, x.data(), x.size(), u_ref.data(), u.data(), u.size(), report);
    }

    /// The time in s for which the next input will be held; 0 if it is not known.
    [[nodiscard]] result expect_hold(double seconds) noexcept { return punctual_expect_hold(own_, seconds); }

    /// What the last step found of a barrier.
    [[nodiscard]] result barrier(std::size_t index, barrier_report &report) const noexcept {
        return punctual_barrier(own_, index, &report);
    }

    /// Starts every deadline again at the next step.
    [[nodiscard]] result rearm() noexcept { return punctual_rearm(own_); }

    /// The most bytes that `save` writes.
    [[nodiscard]] std::size_t saved_size() const noexcept { return punctual_saved_size(own_); }

    /// Writes what the filter remembers, and the number of bytes to `written`.
    [[nodiscard]] result save(std::span<std::byte> buffer, std::size_t &written) const noexcept {
        return punctual_save(own_, buffer.data(), buffer.size(), &written);
    }

    /// Continues from what `save` wrote.
    [[nodiscard]] result restore(std::span<const std::byte> saved) noexcept {
        return punctual_restore(own_, saved.data(), saved.size());
    }

private:
    void swap(filter &other) noexcept {
        std::swap(own_, other.own_);
        std::swap(loaded_, other.loaded_);
        std::swap(states_, other.states_);
        std::swap(inputs_, other.inputs_);
        std::swap(barriers_, other.barriers_);
    }

    punctual_filter *own_ = nullptr;
    result loaded_ = PUNCTUAL_RESULT_POINTER;
    std::size_t states_ = 0, inputs_ = 0, barriers_ = 0;
};

} // namespace punctual

#endif
