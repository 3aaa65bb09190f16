// Makes global files from the inputs of fuzz targets. An input has the first bytes of the header
// page, and then the bytes of the levels and sections after this page. The first bytes include the
// attribute table only if the header's number of attributes is not 0. The feature bits, the sizes,
// the checksum table and the checksums are filled in. Otherwise the reader would refuse nearly
// every mutated input before it reaches other code.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "core/format/checksum.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/open_global.h"
#include "core/format/global/voxdag_reader.h"
#include "core/format/verify/verify.h"
#include "tests/fuzz/support/fuzz_target.h"

namespace voxdag::fuzz {

template <class T>
T get(std::span<const std::byte> bytes, size_t at) {
  T value{};
  if (bytes.size() >= at + sizeof value) std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

inline void put(std::vector<std::byte>& file, size_t at, uint64_t value) {
  std::memcpy(file.data() + at, &value, sizeof value);
}

// Returns feature bits that agree with the header of a file of version 2. A file without attributes
// gets the bit of wide levels, because a file with neither would have version 1.
inline uint64_t features_of(std::span<const std::byte> header, bool has_attributes) {
  namespace layout = global_layout;
  if (!has_attributes) return layout::kWideLevels;
  for (size_t l = 0; l < layout::kMaxLevels; ++l)
    if (get<uint32_t>(header, layout::kLevelsAt + l * layout::kLevelEntryBytes + 24) == 64)
      return layout::kWideLevels | layout::kAttributes;
  return layout::kAttributes;
}

inline std::vector<std::byte> make_file(std::span<const std::byte> input) {
  namespace layout = global_layout;
  const bool is_first_version = get<uint32_t>(input, layout::kVersionAt) == layout::kVersion;
  const bool has_attributes =
      !is_first_version && get<uint64_t>(input, layout::kAttributeCountAt) != 0;
  const auto head = input.first(
      std::min(input.size(), has_attributes ? layout::kFeaturesAt : layout::kAttributesAt));
  const auto levels = input.subspan(head.size());
  std::vector<std::byte> file(layout::kPageBytes + layout::round_up_to_page(levels.size()));
  std::ranges::copy(head, file.begin());
  std::ranges::copy(levels, file.begin() + layout::kPageBytes);
  const size_t table_at = file.size();
  std::vector<uint64_t> table;
  for (size_t at = layout::kPageBytes; at < table_at; at += layout::kChecksumBlockBytes)
    table.push_back(checksum64(
        std::span(file).subspan(at, std::min<size_t>(layout::kChecksumBlockBytes, table_at - at))));
  const auto table_bytes = std::as_bytes(std::span(table));
  file.insert(file.end(), table_bytes.begin(), table_bytes.end());
  put(file, layout::kFeaturesAt, is_first_version ? 0 : features_of(file, has_attributes));
  put(file, layout::kFileBytesAt, file.size());
  put(file, layout::kTableOffsetAt, table_at);
  put(file, layout::kTableCountAt, table.size());
  put(file, layout::kTableChecksumAt, checksum64(table_bytes));
  put(file, layout::kHeaderChecksumAt,
      checksum64(std::span(file).first(layout::kHeaderChecksumAt)));
  return file;
}

// Returns the maximum number of words in a narrow level with which the file can be valid. It is
// low if the file has wide levels (64-bit pointers), so that small files can have wide levels. For
// real files it is kNarrowLevelWords.
inline uint64_t narrow_words_of(const voxdag_reader::File& file) {
  constexpr uint64_t kNarrowWords = 2;
  bool is_wide = file.version() != global_layout::kVersion && !attributes_of(file).any();
  for (uint32_t l = 0; l <= file.brick_level(); ++l) is_wide |= file.level(l).pointer_bits == 64;
  return is_wide ? kNarrowWords : global_layout::kNarrowLevelWords;
}

// True if verify_global_file() finds no error.
inline bool is_sound(const voxdag_reader::File& file) {
  MemoryBudget budget(uint64_t{16} << 20);
  NoProgress progress;
  try {
    verify_global_file(file, 1, budget, progress, CancelToken(), narrow_words_of(file));
  } catch (const Error&) {
    return false;
  }
  return true;
}

// A temporary file in memory, for a reader that opens a path. The file is in no folder; its path is
// its descriptor in /proc.
class NamelessFile {
 public:
  explicit NamelessFile(std::span<const std::byte> bytes) : fd_(memfd_create("fuzz", MFD_CLOEXEC)) {
    require(
        fd_ >= 0 && ::write(fd_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()),
        "a file can be made in memory");
  }
  NamelessFile(const NamelessFile&) = delete;
  ~NamelessFile() { ::close(fd_); }
  std::string path() const { return "/proc/self/fd/" + std::to_string(fd_); }

 private:
  const int fd_;
};

}  // namespace voxdag::fuzz
