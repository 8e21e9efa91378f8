// What Python and the thread of the core both use belongs to one of them at a time.

#pragma once

#include <mutex>

namespace core {

inline std::recursive_mutex lock;
using Guard = std::lock_guard<std::recursive_mutex>;

}  // namespace core
