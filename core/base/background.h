// Runs a function in the background.
#pragma once

#include <future>
#include <memory>
#include <system_error>
#include <type_traits>
#include <utility>

#include "core/base/clock.h"

namespace voxdag {

// Starts `work` on a new thread. get() of the returned future rethrows an exception of `work`. The
// future's destructor waits for the thread. If the system cannot start another thread, the first
// call of the future's get() or wait() runs `work` on the calling thread. `work` then never runs if
// neither function is called.
template <class Work>
[[nodiscard]] std::future<void> run_in_background(Work&& work) {
  const auto shared = std::make_shared<std::decay_t<Work>>(std::forward<Work>(work));
  const auto call = [shared] { (*shared)(); };
  const auto call_and_end = [shared] {
    struct End {
      ~End() { ThreadTimes::add_background(); }
    } end;
    (*shared)();
  };
  try {
    return std::async(std::launch::async, call_and_end);
  } catch (const std::system_error&) {
    return std::async(std::launch::deferred, call);
  }
}

}  // namespace voxdag
