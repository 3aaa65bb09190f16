#include "server/base/steps.h"

#include <exception>

#include "core/base/clock.h"

namespace voxdag::server {
namespace {

constexpr double kRepeatIntervalS = 60;

}  // namespace

bool Steps::run(const std::string& name, const std::function<void()>& step) noexcept {
  try {
    if (hook_) hook_(name);
    step();
    return true;
  } catch (const std::exception& error) {
    report(name, error.what());
  } catch (...) {
    report(name, "an unknown exception");
  }
  return false;
}

void Steps::report(const std::string& name, const char* reason) noexcept {
  try {
    const std::string line = "failed to " + name + ": " + reason;
    {
      std::lock_guard lock(mutex_);
      if (line == last_line_ && wall_seconds() < last_s_ + kRepeatIntervalS) return;
      last_line_ = line;
      last_s_ = wall_seconds();
    }
    log_({line, LogLevel::kError});
  } catch (...) {
    // Writing the log line has failed, so the failure of the step cannot be reported.
  }
}

}  // namespace voxdag::server
