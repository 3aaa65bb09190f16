// The materials of a scene with their images, decoded once into pyramids (docs/color.md): linear
// light, 16 bits, RGBA, and an integer box filter that drops no column of sizes that are no powers
// of two. What they are depends on the scene alone, never on memory or threads.
//
// The pyramids stay in memory if they take at most half of what the budget has free, and are in a
// scratch file otherwise. Images are decoded row by row.
//
// An image that is missing, broken, too large (over kMaxTexels) or of another format than PNG and
// JPEG (WebP, KTX2) costs one warning that names it and a material; its materials have their
// factors alone. One that is fine but takes more memory to decode than the budget has (progressive
// JPEG, interlaced PNG) is an error, since memory must not decide the colors.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/io/file_system.h"
#include "scene/textures/texture_reader.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

class TextureSet {
 public:
  // Of one image: 16384 x 16384.
  static constexpr uint64_t kMaxTexels = uint64_t{1} << 28;

  // Decodes the images that materials refer to, on up to `threads` threads, and warns of those that
  // cannot be read. Advances
  // `progress` by one for each image, in a stage that the caller began. The scratch file is made at
  // `path`, in a folder that exists, only if it is needed, and has this name for an instant only.
  // Throws Error{kOutOfMemory} naming image and material, {kNoSpace}, {kIo}, {kCanceled}, and
  // {kInvalidInput} for an image file that changed since the scene was opened. `files` and `budget`
  // must outlive the set.
  static std::unique_ptr<TextureSet> prepare(FileSystem& files, const SceneMaterials& materials,
                                             const std::string& path, unsigned threads,
                                             MemoryBudget& budget, Progress& progress,
                                             const CancelToken& cancel);

  // Those of the scene, with `image` as kNoImage where it could not be read.
  const std::vector<Material>& materials() const { return materials_; }
  // A reader for one thread, with a cache of about `memory_bytes`, unless all is in memory: then
  // that is shared, and the reader itself takes none. The set must outlive it. Thread-safe.
  std::unique_ptr<TextureReader> open(uint64_t memory_bytes);
  // Bytes of all pyramids, and whether they are in memory.
  uint64_t bytes() const { return pages_ * kPageBytes; }
  bool is_in_memory() const { return !file_; }

 private:
  class Builder;

  explicit TextureSet(MemoryBudget& budget) : budget_(budget) {}

  MemoryBudget& budget_;
  std::vector<Material> materials_;
  TextureLayout layout_;
  uint64_t pages_ = 0;
  PageBuffer<uint64_t> memory_;
  std::unique_ptr<ReadableFile> file_;
  PageBuffer<uint32_t> checksums_;  // of the pages in it
};

// What TextureSet::bytes() would be. Reads the headers of the images.
uint64_t pyramid_bytes(FileSystem& files, const SceneMaterials& materials, MemoryBudget& budget,
                       const CancelToken& cancel);

// SHA-256 of what each image contains as it is stored, as lower-case hex digits; another text for
// one that cannot be read to its end. Reads all images, decodes none. Throws as
// TextureSet::prepare() does.
std::vector<std::string> image_digests(FileSystem& files, std::span<const ImageSource> images,
                                       unsigned threads, const CancelToken& cancel);

}  // namespace voxdag
