// Runs the steps of the service's threads. An exception ends only one step: Steps logs the
// exception, and the thread continues with its next step. Thread-safe.
#pragma once

#include <functional>
#include <mutex>
#include <string>

#include "server/base/log.h"

namespace voxdag::server {

// Called with the name of each step and request handler, before it runs. Tests make it throw.
using StepHook = std::function<void(const std::string& step)>;

class Steps {
 public:
  Steps(Log log, StepHook hook) : log_(std::move(log)), hook_(std::move(hook)) {}

  // Runs `step`. `name` completes the log line "failed to NAME: REASON". Returns false if the step
  // threw. If the same failure repeats, it is logged at most once per minute.
  bool run(const std::string& name, const std::function<void()>& step) noexcept;

 private:
  void report(const std::string& name, const char* reason) noexcept;

  const Log log_;
  const StepHook hook_;
  std::mutex mutex_;  // guards the members below
  std::string last_line_;
  double last_s_ = 0;
};

}  // namespace voxdag::server
