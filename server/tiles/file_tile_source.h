// The open file of a finished DAG, as a source of tiles for viewers. Thread-safe.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>

#include "core/io/file_system.h"
#include "core/io/watched_mapping.h"
#include "server/tiles/manifest_cache.h"
#include "server/tiles/tile_source.h"

namespace voxdag::server {

class FileTileSource : public TileSource {
 public:
  // Opens the file. Throws Error if it is not a valid DAG. Reads only the file's header and
  // checksum table. If one of their pages cannot be read, throws Error{kIo} instead of ending the
  // process with SIGBUS. `manifests`, if not null, caches manifests.
  FileTileSource(const std::string& path, const FileIdentity& identity,
                 std::shared_ptr<ManifestCache> manifests = nullptr);
  // Like the constructor above, for a file that is already mapped.
  FileTileSource(const std::string& path, const FileIdentity& identity,
                 std::shared_ptr<const voxdag_reader::Bytes> bytes,
                 std::shared_ptr<ManifestCache> manifests = nullptr);

  const query::DagView& dag() const override { return dag_; }
  const CheckedBlocks* blocks() const override { return &blocks_; }
  const voxdag_reader::File* colored_file() const override { return file_.get(); }
  // Identity of the file when it was opened.
  const FileIdentity& identity() const { return identity_; }
  // Returns a digest of the file's contents and of the version of the tile format.
  const std::string& digest() const override { return digest_; }
  // Returns the manifest. The first call computes the cameras, which may take a second, or longer
  // if the file is not in memory. Concurrent calls wait for the first call. If that call is
  // canceled, the next call starts the computation again.
  const std::string& manifest(const CancelToken& cancel) const override;
  void expect_readable() const override;
  // True if expect_readable() throws. The file must then be opened again before it can be used.
  bool is_broken() const { return mapping_.is_damaged(); }
  // True if the path now leads to a different file or to changed contents. False if the file was
  // removed: its contents remain until this object closes the file.
  bool was_overwritten() const override;
  bool is_first_damage() const override { return !has_damage_.exchange(true); }

 private:
  std::unique_ptr<voxdag_reader::File> read_header(const std::string& path) const;

  const FileIdentity identity_;
  const std::shared_ptr<const voxdag_reader::Bytes> bytes_;
  const std::string path_;
  const WatchedMapping mapping_;  // created before the first byte is read
  const std::unique_ptr<voxdag_reader::File> file_;
  const CheckedBlocks blocks_;
  const query::DagView dag_;
  const std::string digest_;
  const std::shared_ptr<ManifestCache> manifests_;  // may be null
  mutable std::atomic<bool> has_damage_{false};
  mutable std::mutex manifest_mutex_;  // guards manifest_ while it is being computed
  mutable std::string manifest_;
  mutable std::atomic<bool> has_manifest_{false};  // true once manifest_ is final
};

}  // namespace voxdag::server
