// The lock of the core: how Python makes it, whose turn it is, and the clock of both.

#pragma once

#include <time.h>

#include <mutex>
#include <utility>

namespace core {

// As Python's time.monotonic [s].
inline double monotonic_now() {
    timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return double(time.tv_sec) + 1e-9 * double(time.tv_nsec);
}

// A new object for Python; null where there is no memory, or no thread or descriptor for it.
template <typename Made, typename... Given>
Made* made(Given&&... given) {
    try {
        return new Made(std::forward<Given>(given)...);
    } catch (...) {
        return nullptr;
    }
}

inline std::recursive_mutex lock;
using Guard = std::lock_guard<std::recursive_mutex>;

}  // namespace core
