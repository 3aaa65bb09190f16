#include "scheduler/state/build_locks.h"

#include <chrono>
#include <cmath>
#include <thread>

#include "core/base/clock.h"
#include "core/base/error.h"

namespace voxdag {
namespace {

// `voxdag status` locks a work folder for an instant.
constexpr double kQuiet_s = 0.3;
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
    if (quiet && waited_s >= kQuiet_s) {
      context.progress.warn(what + " is in use by another build: waiting up to " +
                            std::to_string(std::lround(max_s)) + " s in case that one is ending");
      quiet = false;
    }
    context.cancel.check();
    std::this_thread::sleep_for(kPause);
  }
}

OutputLock::OutputLock(const BuildContext& context, const std::string& output, double max_wait_s)
    : files_(context.files),
      path_(path_of(output)),
      lock_(wait_for_lock([&] { return files_.try_lock(path_); }, output, max_wait_s, context)) {
  if (!lock_)
    throw Error(ErrorCode::kIo, output +
                                    " is being written by another build: expected another file "
                                    "(-o), or to wait for that build");
}

OutputLock::~OutputLock() {
  try {
    // A file of that name that is not empty is somebody else's.
    if (files_.open_read(path_)->size() == 0) files_.remove(path_);
  } catch (const Error&) {
    // An empty file is left, which the next build there locks again.
  }
}

}  // namespace voxdag
