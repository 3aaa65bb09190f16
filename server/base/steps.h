// The steps that the service's threads consist of. What a step throws ends this step only: it is
// logged, and the thread continues with its next step. Thread-safe.
#pragma once

#include <functional>
#include <mutex>
#include <string>

namespace voxdag::server {

// Writes a line of the log.
using Log = std::function<void(const std::string& line)>;
// Called before each step and each request's handler with its name; tests make it throw.
using StepHook = std::function<void(const std::string& step)>;

class Steps {
 public:
  Steps(Log log, StepHook hook) : log_(std::move(log)), hook_(std::move(hook)) {}

  // Runs `step`, which `name` describes in the words of a log line. Returns whether it threw
  // nothing. A failure like the last one is logged once per minute.
  bool run(const std::string& name, const std::function<void()>& step) noexcept;

 private:
  void report(const std::string& name, const char* reason) noexcept;

  const Log log_;
  const StepHook hook_;
  std::mutex mutex_;  // guards the next
  std::string last_line_;
  double last_s_ = 0;
};

}  // namespace voxdag::server
