// Writes the packs and the directory of a package. Not thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/format/checksum.h"
#include "core/io/file_system.h"
#include "query/package/package_index.h"

namespace voxdag::query {

class PackWriter {
 public:
  // Writes to `folder`, which must exist. A pack is complete when its next block would exceed
  // `pack_bytes`; the first pack, when its next block would exceed kFirstPackBytes.
  PackWriter(FileSystem& files, const std::string& folder, uint64_t pack_bytes);

  void begin_band(bool is_color, uint32_t level);
  // Adds a compressed block of the current band. `items` is its number of tiles or color pages,
  // `code` the code of its first color page.
  void add_block(std::string_view bytes, uint64_t items, uint64_t code);
  // Completes the files. Returns the index, without manifest and viewer.
  PackageIndex finish();
  // Number of bytes in complete and incomplete packs.
  uint64_t bytes() const { return bytes_; }

 private:
  void end_pack();
  void end_page();
  void write_file(const std::string& name, std::string_view contents);

  FileSystem& files_;
  const std::string folder_;
  const uint64_t pack_bytes_;
  PackageIndex index_;
  std::unique_ptr<WritableFile> out_;  // the current pack
  Checksum64 checksum_;                // of the current pack
  PackageFile pack_;                   // the current pack
  uint64_t bytes_ = 0;
  DirectoryPage page_;             // the current page
  std::vector<uint16_t> lengths_;  // of the blocks of the current page
  std::vector<uint64_t> codes_;    // of the color blocks of the current page
  std::string directory_;
};

}  // namespace voxdag::query
