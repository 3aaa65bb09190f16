// The locks that prevent concurrent builds: one on a file next to the output (OutputLock), one on
// the work folder (work_folder.h). A killed process holds its locks until the system has freed its
// memory, which can take seconds. So a build waits if another process holds a lock.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/io/output_lock.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag {

// Calls `try_lock` until it returns a lock, and returns this lock; null after `max_s` seconds
// without a lock. Warns, with a text that begins with `what`, after 0.3 s. A shorter wait needs no
// warning, because `voxdag status` also holds a lock briefly.
std::unique_ptr<FileLock> wait_for_lock(const std::function<std::unique_ptr<FileLock>()>& try_lock,
                                        const std::string& what, double max_s,
                                        const BuildContext& context);

// Locks the output. Throws Error{kIo} if another process still has it locked after `max_wait_s`.
OutputLock lock_output(const BuildContext& context, const std::string& output, double max_wait_s);

}  // namespace voxdag
