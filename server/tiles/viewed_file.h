// A finished DAG that viewers look at: its file, open, and what each of their requests needs of it.
// Thread-safe.
#pragma once

#include <memory>
#include <mutex>
#include <string>

#include "core/format/global/voxdag_reader.h"
#include "core/io/file_system.h"
#include "core/io/watched_mapping.h"
#include "query/dag_view.h"

namespace voxdag::server {

// How many levels of nodes a tile has; docs/api.md says why.
inline constexpr uint32_t kTileLevels = 3;
// How many tiles a request may ask for.
inline constexpr size_t kMaxTilesOfBatch = 64;
// And how many color pages.
inline constexpr size_t kMaxColorPagesOfBatch = 256;

class ViewedFile {
 public:
  // Throws Error if the file is no valid DAG; only its header and checksum table are read. Pages
  // that cannot be read are survived: while it is opened they are an Error{kIo}.
  ViewedFile(const std::string& path, const FileIdentity& identity);
  // The same of a file that is mapped already.
  ViewedFile(const std::string& path, const FileIdentity& identity,
             std::shared_ptr<const voxdag_reader::Bytes> bytes);

  const query::DagView& dag() const { return dag_; }
  const voxdag_reader::File& file() const { return *file_; }
  // Of the file when it was opened.
  const FileIdentity& identity() const { return identity_; }
  // 32 hex digits that stand for the contents of the file and for how its tiles are made.
  const std::string& digest() const { return digest_; }
  // What a viewer needs to begin, as JSON. The first call looks for the cameras, which may take a
  // second, or longer if the file is not in memory; others wait for it.
  const std::string& manifest() const;
  // Throws Error{kIo} if a part of the file could not be read since it was opened, because it
  // became shorter or its disk failed: what was made from it then is wrong.
  void expect_whole() const;

 private:
  std::unique_ptr<voxdag_reader::File> read_header(const std::string& path) const;

  const FileIdentity identity_;
  const std::shared_ptr<const voxdag_reader::Bytes> bytes_;
  const WatchedMapping mapping_;  // from before the first byte is read
  const std::unique_ptr<voxdag_reader::File> file_;
  const query::DagView dag_;
  const std::string digest_;
  mutable std::once_flag manifest_once_;
  mutable std::string manifest_;
};

}  // namespace voxdag::server
