// Git LFS pointers: the small texts that replace files in a clone without git lfs.
#pragma once

namespace voxdag {

// The first bytes of every pointer.
inline constexpr const char* kLfsPointerBegin = "version https://git-lfs.github.com/spec/";

}  // namespace voxdag
