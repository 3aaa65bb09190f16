#include "scheduler/state/build_locks.h"

#include <chrono>
#include <cmath>
#include <thread>

#include "core/base/clock.h"

namespace voxdag {
namespace {

// Seconds of waiting before a warning is shown. `voxdag status` locks a work folder for a shorter
// time, so it causes no warning.
constexpr double kQuietS = 0.3;
constexpr auto kPause = std::chrono::milliseconds(20);

}  // namespace

std::unique_ptr<FileLock> wait_for_lock(const std::function<std::unique_ptr<FileLock>()>& try_lock,
                                        const std::string& what, double max_s,
                                        const BuildContext& context) {
  const double begin_s = wall_seconds();
  bool quiet = true;
  for (;;) {
    if (auto lock = try_lock()) return lock;
    const double waited_s = wall_seconds() - begin_s;
    if (waited_s >= max_s) return nullptr;
    if (quiet && waited_s >= kQuietS) {
      context.progress.warn(what + " is in use by another build: waiting up to " +
                            std::to_string(std::lround(max_s)) + " s, because it may be ending");
      quiet = false;
    }
    context.cancel.check();
    std::this_thread::sleep_for(kPause);
  }
}

OutputLock lock_output(const BuildContext& context, const std::string& output, double max_wait_s) {
  const auto try_lock = [&] { return context.files.try_lock(OutputLock::path_of(output)); };
  return OutputLock(context.files, output, wait_for_lock(try_lock, output, max_wait_s, context));
}

}  // namespace voxdag
