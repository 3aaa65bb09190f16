#include "scene/lfs_pointer.h"

#include <array>
#include <span>
#include <string_view>

#include "core/base/error.h"
#include "core/io/lfs_pointer.h"
#include "scene/messages.h"

namespace voxdag {

bool is_lfs_pointer(const ReadableFile& file) {
  constexpr std::string_view kBegin = kLfsPointerBegin;
  if (file.size() < kBegin.size()) return false;
  std::array<char, kBegin.size()> begin{};
  file.read_at(0, std::as_writable_bytes(std::span(begin)));
  return std::string_view(begin.data(), begin.size()) == kBegin;
}

void refuse_lfs_pointer(const ReadableFile& file, const std::string& where) {
  if (is_lfs_pointer(file))
    throw Error(ErrorCode::kInvalidInput,
                where + ": " + printable(file.path()) +
                    " is a Git LFS pointer, not the file itself: run git lfs pull");
}

}  // namespace voxdag
