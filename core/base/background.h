// Runs a function in the background.
#pragma once

#include <future>
#include <memory>
#include <system_error>
#include <type_traits>
#include <utility>

namespace voxdag {

// Starts `work` on a thread of its own. If the system has no thread left, the first call of get()
// or wait() runs it. What `work` throws, get() throws. The destructor of the future waits for the
// thread.
template <class Work>
[[nodiscard]] std::future<void> run_in_background(Work&& work) {
  const auto shared = std::make_shared<std::decay_t<Work>>(std::forward<Work>(work));
  const auto call = [shared] { (*shared)(); };
  try {
    return std::async(std::launch::async, call);
  } catch (const std::system_error&) {
    return std::async(std::launch::deferred, call);
  }
}

}  // namespace voxdag
