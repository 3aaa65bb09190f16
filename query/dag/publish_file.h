// The last stage of commands that write a global file.
#pragma once

#include <functional>

#include "core/base/progress.h"
#include "core/format/global/global_writer.h"

namespace voxdag::query {

// Completes a global file and publishes it, as the stage "write". Calls before_publish() before the
// file gets its name; if this throws, the file is not published.
inline GlobalFileSummary publish_file(GlobalFileWriter& out, const VoxelCounts& counts,
                                      unsigned threads, const std::function<void()>& before_publish,
                                      Progress& progress, const CancelToken& cancel) {
  progress.begin_stage("write", 1, "files");
  const GlobalFileSummary summary = out.seal(counts, threads, cancel);
  before_publish();
  out.publish();
  progress.advance(1);
  progress.end_stage();
  return summary;
}

}  // namespace voxdag::query
