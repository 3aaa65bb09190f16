// Progress on standard error: a bar with rate and ETA on a terminal, a plain line every few seconds
// and at the end of each stage otherwise. Thread-safe.
#pragma once

#include <memory>

#include "core/base/progress.h"

namespace voxdag::cli {

// A quiet bar shows warnings only.
std::unique_ptr<Progress> make_progress_bar(bool quiet = false);

}  // namespace voxdag::cli
