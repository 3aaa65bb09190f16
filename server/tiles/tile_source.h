// A DAG that viewers look at, and what each of their requests needs of it: a finished file, or what
// a running job has built so far. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "core/format/global/checked_blocks.h"
#include "core/format/global/voxdag_reader.h"
#include "query/dag/dag_view.h"
#include "voxdag/cancel_token.h"

namespace voxdag::server {

// How many levels of nodes a tile has; docs/api.md says why.
inline constexpr uint32_t kTileLevels = 3;
// How many tiles a request may ask for.
inline constexpr size_t kMaxTilesOfBatch = 64;
// And how many color pages.
inline constexpr size_t kMaxColorPagesOfBatch = 256;

class TileSource {
 public:
  virtual ~TileSource() = default;

  virtual const query::DagView& dag() const = 0;
  // The blocks in which its nodes lie, to be compared before they are read; null if there are none.
  virtual const CheckedBlocks* blocks() const { return nullptr; }
  // The file that has the colors, null if there is none.
  virtual const voxdag_reader::File* colored_file() const { return nullptr; }
  // 32 hex digits. What lies at an address of a DAG with this digest never changes, and neither
  // does how its tiles are made.
  virtual const std::string& digest() const = 0;
  // What a viewer needs to begin, as JSON (docs/api.md).
  virtual const std::string& manifest(const CancelToken& cancel) const = 0;
  // Throws Error{kIo} if a part of the file could not be read since it was opened, because it
  // became shorter or its disk failed: what was made from it then is wrong.
  virtual void expect_readable() const {}
  // Whether its file was changed since it was opened, so that what was read may be of either.
  virtual bool was_overwritten() const { return false; }
  // To be called when damage is found: whether it is the first of this file, to be logged.
  virtual bool is_first_damage() const { return true; }
};

}  // namespace voxdag::server
