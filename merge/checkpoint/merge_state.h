// The durable state of an unfinished merge, and its encoding.
//
// A merge reduces a set of artifacts to a smaller set in passes. In the final pass it writes the
// remaining artifacts into the global file, level by level. The state is the current set and,
// during the final pass, the pass's progress.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/format/artifact/artifact.h"
#include "core/format/global/global_writer.h"
#include "merge/load/scratch_file.h"
#include "merge/load/top_tree_run.h"
#include "merge/types/merge_report.h"

namespace voxdag {

// Progress of the final pass; see PassProgress.
struct FinalPassState {
  uint32_t level = 0;
  std::string output;         // path of the global file
  uint64_t narrow_words = 0;  // GlobalFileWriter::narrow_words()
  GlobalFileProgress file;
  std::vector<uint64_t> map_rows;  // rows of each run's position map
  ScratchFileState map;            // the file with all position maps
  std::vector<PlacedNode> placed;
  std::vector<ArtifactRoot> roots;
};

struct MergeState {
  uint64_t inputs_checksum = 0;  // PendingArtifacts::inputs_checksum()
  uint32_t next_scratch_id = 0;
  MergeReport report;
  // Artifacts written by passes, in segments of the scratch folder. They replace the inputs that
  // have the same roots.
  std::vector<ArtifactRef> intermediates;
  std::optional<FinalPassState> final_pass;
};

std::vector<std::byte> encode_state(MergeState state);
// Decodes a state. Throws Error{kCorrupt} if the bytes are not a state of this version.
MergeState decode_state(std::span<const std::byte> bytes);

}  // namespace voxdag
