// Finds artifacts that are damaged or gone, so that only their subvolumes are built again.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/cancel_token.h"
#include "core/base/error.h"
#include "core/io/file_system.h"
#include "scheduler/job/job_store.h"

namespace voxdag {

struct DamagedSubvolume {
  StoredSubvolume subvolume;
  std::string what;  // what is wrong with its artifact
};

// Reads the artifacts of all built subvolumes, the levels above `level` (of smaller number): the
// others are not needed any more and may be gone.
std::vector<DamagedSubvolume> find_damaged(
    std::span<const StoredSubvolume> subvolumes, uint32_t level,
    const std::function<std::shared_ptr<ReadableFile>(uint32_t)>& open_segment,
    const CancelToken& cancel);

}  // namespace voxdag
