// A DAG for viewers: a finished file, or the built part of a running job. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "core/format/global/checked_blocks.h"
#include "core/format/global/voxdag_reader.h"
#include "query/dag/dag_view.h"
#include "voxdag/cancel_token.h"

namespace voxdag::server {

// Number of node levels in a tile; docs/view.md has the reason.
inline constexpr uint32_t kTileLevels = 3;
// Maximum number of tiles per request.
inline constexpr size_t kMaxTilesOfBatch = 64;
// Maximum number of color pages per request.
inline constexpr size_t kMaxColorPagesOfBatch = 256;

class TileSource {
 public:
  virtual ~TileSource() = default;

  virtual const query::DagView& dag() const = 0;
  // Returns the checksum blocks of the DAG's nodes. A block is verified before its nodes are read.
  // May return null.
  virtual const CheckedBlocks* blocks() const { return nullptr; }
  // The file with the colors; may be null.
  virtual const voxdag_reader::File* colored_file() const { return nullptr; }
  // Returns 32 hex digits that identify the DAG and the version of the tile format. As long as the
  // digest is the same, the contents of every address are also the same.
  virtual const std::string& digest() const = 0;
  // Returns the data that a viewer needs to begin, as JSON (docs/api.md).
  virtual const std::string& manifest(const CancelToken& cancel) const = 0;
  // Throws Error{kIo} if a read of the file has failed since the file was opened, because the file
  // was truncated or its disk failed. Results that were computed after such a failure are wrong.
  virtual void expect_readable() const {}
  // True if the file was changed after it was opened. The bytes read from it may then mix both
  // versions.
  virtual bool was_overwritten() const { return false; }
  // Call this function when damage is found. Returns true for the file's first damage, which is
  // logged.
  virtual bool is_first_damage() const { return true; }
};

}  // namespace voxdag::server
