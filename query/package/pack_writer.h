// Writes the packs, the directory and the head of a package (package_index.h). Not thread-safe.
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
  // Writes the files to `folder`, which must exist. Begins a new pack before a block that does not
  // fit in the current one. A pack has at most `pack_bytes` bytes; the first pack has at most
  // kFirstPackBytes if that is less.
  PackWriter(FileSystem& files, const std::string& folder, uint64_t pack_bytes);

  void begin_band(bool is_color, uint32_t level);
  // Adds a compressed block to the current band. `items` is the number of tiles or color pages in
  // the block. `code` is the Morton code of its first color page; it is 0 for tiles.
  void add_block(std::string_view bytes, uint64_t items, uint64_t code);
  // Adds a compressed block of tiles of the current band to the head. `head_tiles` is the number of
  // its tiles that the first picture needs. The band's other blocks must be added later.
  void add_head_block(std::string_view bytes, uint64_t items, uint64_t head_tiles);
  // Completes the packs, and writes the directory and the head. Returns the index of the package,
  // in which the manifest and the files of the viewer are missing.
  PackageIndex finish();
  // Returns the number of bytes in the head and in all packs so far.
  uint64_t bytes() const { return bytes_; }

 private:
  void expect_small(std::string_view bytes) const;
  void end_pack();
  void end_page();
  void write_file(const std::string& name, std::string_view contents);

  FileSystem& files_;
  const std::string folder_;
  const uint64_t pack_bytes_;
  PackageIndex index_;
  std::unique_ptr<WritableFile> out_;  // file of the current pack
  Checksum64 checksum_;                // checksum of the current pack
  PackageFile pack_;                   // the current pack
  uint64_t bytes_ = 0;
  DirectoryPage page_;             // current page of the directory
  std::vector<uint16_t> lengths_;  // compressed sizes of the page's blocks
  std::vector<uint64_t> codes_;    // codes of the page's color blocks
  std::string directory_;
  std::string head_;  // the blocks of the head
};

}  // namespace voxdag::query
