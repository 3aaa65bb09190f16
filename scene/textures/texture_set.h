// The materials of a scene with their images, decoded once into pyramids (docs/color.md). A texel
// is linear RGBA with 16 bits per channel. An integer box filter makes the coarser levels; it omits
// no column or row, for any image size. The texels depend only on the scene, never on memory or
// threads.
//
// With cutouts, the texels of an image whose materials have a mask are multiplied by alpha. Then
// the coarser levels also have no light of hidden texels. Alpha is 0 for hidden texels, and 1 for
// visible texels of materials with the alpha mode MASK.
//
// The pyramids are kept in memory if they take at most half of the free budget. Otherwise they are
// in a scratch file. Images are decoded row by row.
//
// An image can be missing, broken, larger than the limits of ImageReader, or in a format without
// decoder (KTX2, DDS). In these cases, the materials of the image keep only their base color
// factors. A warning for each problem names the first image, a material that uses it, and the
// number of materials. A valid image whose decoder exceeds the budget (progressive JPEG, interlaced
// PNG, WebP, AVIF) is an error, because the colors must not depend on the available memory.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/color/cutouts/cutouts.h"
#include "core/io/file_system.h"
#include "scene/textures/texture_reader.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

class TextureSet {
 public:
  // Maximum number of texels of one image: 16384 x 16384. ImageReader checks this limit
  // (kMaxPixels).
  static constexpr uint64_t kMaxTexels = uint64_t{1} << 28;

  // Decodes the images that materials refer to, on up to `threads` threads, and warns about
  // unreadable ones. Advances `progress` by one for each image, in a stage that the caller began.
  // The scratch file is created at `path`, in an existing folder, only if it is needed. The file's
  // name is removed as soon as the file is open. Throws Error{kOutOfMemory} with image and
  // material, {kNoSpace}, {kIo}, {kCanceled}, and {kInvalidInput} for an image file that changed
  // since the scene was opened. `files` and `budget` must outlive the set. If `cutouts` is not
  // null, materials with different masks must not share an image (with_separate_images()).
  static std::unique_ptr<TextureSet> prepare(FileSystem& files, const SceneMaterials& materials,
                                             const std::string& path, unsigned threads,
                                             MemoryBudget& budget, Progress& progress,
                                             const CancelToken& cancel,
                                             const Cutouts* cutouts = nullptr);

  // The materials of the scene. `image` is kNoImage for unreadable images.
  const std::vector<Material>& materials() const { return materials_; }
  // Returns a reader for one thread, with a cache of about `memory_bytes`. If all pyramids are in
  // memory, they are shared and the reader takes no memory. The set must outlive the reader.
  // Thread-safe.
  std::unique_ptr<TextureReader> open(uint64_t memory_bytes);
  // bytes() returns the size of all pages. is_in_memory() is true if they are not in a scratch
  // file.
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
  PageBuffer<uint32_t> checksums_;  // checksums of the pages in the file
};

// Returns the value that TextureSet::bytes() would have. Reads only the headers of the images.
uint64_t pyramid_bytes(FileSystem& files, const SceneMaterials& materials, MemoryBudget& budget,
                       const CancelToken& cancel);

// Returns the SHA-256 of each image's stored bytes, as lower-case hex digits. For an image that
// cannot be read to its end, or whose format this build cannot decode, returns a text that is never
// such a digest. Reads all images, but decodes none. Throws the same errors as
// TextureSet::prepare().
std::vector<std::string> image_digests(FileSystem& files, std::span<const ImageSource> images,
                                       unsigned threads, const CancelToken& cancel);

}  // namespace voxdag
