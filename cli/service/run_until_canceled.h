// Runs a server, for a command such as `serve`, until a signal cancels the command.
#pragma once

#include <chrono>
#include <functional>
#include <thread>

#include "cli/terminal/signals.h"
#include "voxdag/cancel_token.h"

namespace voxdag::cli {

// Calls run(), which must return after stop() is called. When `cancel` is canceled, a second thread
// calls stop(). The signal handler cannot call stop() itself, because only few functions are safe
// in a signal handler. Throws the exceptions of run().
template <class Run>
void run_until_canceled(CancelToken& cancel, const Run& run, const std::function<void()>& stop) {
  allow_slow_stop();
  std::thread watcher([&] {
    while (!cancel.canceled()) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    stop();
  });
  const auto end_watcher = [&] {
    cancel.cancel();
    watcher.join();
  };
  try {
    run();
  } catch (...) {
    end_watcher();
    throw;
  }
  end_watcher();
}

}  // namespace voxdag::cli
