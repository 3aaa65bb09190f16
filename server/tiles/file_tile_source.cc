#include "server/tiles/file_tile_source.h"

#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/fields/json_text.h"
#include "core/format/checksum.h"
#include "core/format/global/open_global.h"
#include "server/tiles/manifest.h"

namespace voxdag::server {
namespace {

constexpr size_t kHeaderBytes = 4096;
constexpr size_t kDigestDigits = 32;

// Returns a digest of the header page. The digest identifies the complete file, because this page
// contains the checksum of the checksum table, which covers all other bytes.
std::string digest_of(const voxdag_reader::File& file) {
  std::string text(reinterpret_cast<const char*>(file.data()), kHeaderBytes);
  text += "tiles 1 " + std::to_string(kTileLevels);
  if (file.has_colors()) text += " colors 1";
  return sha256_hex(text).substr(0, kDigestDigits);
}

}  // namespace

FileTileSource::FileTileSource(const std::string& path, const FileIdentity& identity,
                               std::shared_ptr<ManifestCache> manifests)
    : FileTileSource(path, identity, map_global_file(path), std::move(manifests)) {}

FileTileSource::FileTileSource(const std::string& path, const FileIdentity& identity,
                               std::shared_ptr<const voxdag_reader::Bytes> bytes,
                               std::shared_ptr<ManifestCache> manifests)
    : identity_(identity),
      bytes_(std::move(bytes)),
      path_(path),
      mapping_(bytes_->data(), bytes_->size()),
      file_(read_header(path)),
      blocks_(*file_),
      dag_(*file_),
      digest_(digest_of(*file_)),
      manifests_(std::move(manifests)) {
  expect_readable();
}

std::unique_ptr<voxdag_reader::File> FileTileSource::read_header(const std::string& path) const {
  try {
    return open_global_bytes(path, bytes_);
  } catch (const Error&) {
    // If pages were unreadable, throws Error{kIo} instead, because the invalid format is only a
    // consequence.
    expect_readable();
    throw;
  }
}

const std::string& FileTileSource::manifest(const CancelToken& cancel) const {
  if (has_manifest_) return manifest_;
  const std::lock_guard lock(manifest_mutex_);
  if (has_manifest_) return manifest_;
  const auto known = manifests_ ? manifests_->find(digest_) : std::nullopt;
  // Verifies the checksum of the root's bytes before the manifest is computed from them.
  if (!known && !dag_.empty()) blocks_.expect_intact(dag_.level(0).words.data(), 8);
  manifest_ = known ? *known : exact_json_text(file_manifest(*file_, dag_, digest_, cancel));
  expect_readable();
  if (manifests_ && !known) manifests_->keep(digest_, manifest_);
  has_manifest_ = true;
  return manifest_;
}

void FileTileSource::expect_readable() const {
  if (mapping_.is_damaged())
    throw Error(
        ErrorCode::kIo,
        path_ + " was truncated, or its disk failed, while it was viewed: restore or rebuild it");
}

bool FileTileSource::was_overwritten() const {
  try {
    return system_files().open_read(file_->path())->identity() != identity_;
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound) throw;
    return false;
  }
}

}  // namespace voxdag::server
