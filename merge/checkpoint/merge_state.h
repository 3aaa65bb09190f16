// The durable state of an unfinished merge: what was merged, and what going on needs of it.
//
// A merge reduces a set of artifacts, its inputs at first, to fewer in rounds, and then merges
// those left into the global file, level by level. Its state is that set and, in the last round,
// how far that is.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/format/artifact/artifact.h"
#include "core/format/global/global_writer.h"
#include "merge/load/scratch.h"
#include "merge/load/top_run.h"
#include "merge/merge.h"

namespace voxdag {

// How far the last round is; see RoundProgress.
struct LastRoundState {
  uint32_t level = 0;
  std::string output;  // path of the global file
  GlobalProgress file;
  std::vector<uint64_t> map_rows;
  ScratchRecord map;
  std::vector<PlacedNode> placed;
  std::vector<ArtifactRoot> roots;
};

struct MergeState {
  uint64_t inputs = 0;  // checksum of what is merged
  uint32_t next_scratch_id = 0;
  MergeReport report;
  // Made by rounds, in segments of the scratch folder: they replace the inputs whose roots they
  // hold.
  std::vector<ArtifactRef> merged;
  std::optional<LastRoundState> last_round;
};

std::vector<std::byte> encode_state(MergeState state);
// Throws Error{kCorrupt} if the bytes are not those of a state of this version.
MergeState decode_state(std::span<const std::byte> bytes);

}  // namespace voxdag
