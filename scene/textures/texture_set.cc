#include "scene/textures/texture_set.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <iterator>
#include <mutex>
#include <shared_mutex>
#include <utility>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/parallel_for.h"
#include "core/base/text.h"
#include "core/color/cutouts/hidden.h"
#include "core/color/rule/texture_lookup.h"
#include "core/format/checksum.h"
#include "core/image/image_reader.h"
#include "scene/messages.h"
#include "scene/textures/image_bytes.h"
#include "scene/textures/linear_light.h"
#include "scene/textures/pyramid.h"

namespace voxdag {
namespace {

// Converts rows of pixels to texels: linear light by a table, alpha unchanged.
class TexelRow {
 public:
  // `cut_by`: a material whose mask was made from this image, or null.
  TexelRow(const ImageReader& image, const Material* cut_by, MemoryBudget& budget)
      : cut_by_(cut_by),
        is_wide_(image.bits() == 16),
        bytes_(budget, size_t{image.width()} * (is_wide_ ? 8 : 4), "a row of an image"),
        texels_(budget, image.width(), "a row of an image"),
        table_(is_wide_ ? 65536 : 256) {
    for (size_t i = 0; i < table_.size(); ++i)
      table_[i] = linear_light(static_cast<double>(i) / static_cast<double>(table_.size() - 1));
  }
  std::span<const uint64_t> read(ImageReader& image) {
    image.read_row({bytes_.data(), bytes_.size()});
    for (size_t x = 0; x < texels_.size(); ++x)
      texels_[x] = linear(channel(4 * x)) | linear(channel(4 * x + 1)) << 16 |
                   linear(channel(4 * x + 2)) << 32 |
                   (is_wide_ ? channel(4 * x + 3) : channel(4 * x + 3) * 257) << 48;
    if (cut_by_)
      for (uint64_t& texel : std::span(texels_.data(), texels_.size())) texel = visible(texel);
    return {texels_.data(), texels_.size()};
  }

 private:
  // Returns 0 for a hidden texel. In mode kMask, makes any other texel opaque; otherwise multiplies
  // its color by its alpha.
  uint64_t visible(uint64_t texel) const {
    const uint32_t alpha = color::channel(texel, 3);
    if (color::is_hidden(*cut_by_, alpha)) return 0;
    if (cut_by_->alpha_mode == AlphaMode::kMask) return texel | uint64_t{kFullIntensity} << 48;
    uint64_t out = uint64_t{alpha} << 48;
    for (int c = 0; c < 3; ++c)
      out |= uint64_t{color::scaled(color::channel(texel, c), alpha)} << 16 * c;
    return out;
  }
  uint64_t linear(uint64_t value) const { return table_[value]; }
  uint64_t channel(size_t i) const {
    if (!is_wide_) return static_cast<uint8_t>(bytes_[i]);
    uint16_t value;
    std::memcpy(&value, &bytes_[2 * i], sizeof value);
    return value;
  }

  const Material* const cut_by_;
  const bool is_wide_;
  PageBuffer<std::byte> bytes_;
  PageBuffer<uint64_t> texels_;
  std::vector<uint16_t> table_;
};

std::string user_of(const SceneMaterials& materials, uint32_t image) {
  const auto found = std::ranges::find(materials.materials, image, &Material::image);
  if (found == materials.materials.end()) return "";
  const auto index = static_cast<int>(found - materials.materials.begin());
  return ", the base color of material " + numbered(index, found->name);
}

// The images that are unreadable for the same reason. They are reported in one warning.
struct UnreadableImages {
  std::string problem;
  std::string first;  // the first of the images, and a material that uses it
  uint64_t images = 0, materials = 0;

  Warning warning() const {
    const std::string effect = materials == 1
                                   ? "; the base color factor of this material is used alone"
                                   : "; the base color factors of " + std::to_string(materials) +
                                         " materials are used alone";
    return {"unusable-image", first, problem + effect, images};
  }
};

// Runs `body` under a shared lock, so that several threads can run bodies concurrently. If `body`
// runs out of memory, runs it again under an exclusive lock, while no other thread runs a body.
template <class Body>
void alone_if_necessary(std::shared_mutex& mutex, const std::string& name, const Body& body) {
  try {
    const std::shared_lock lock(mutex);
    return body();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kOutOfMemory) throw;
  }
  const std::unique_lock lock(mutex);
  try {
    body();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kOutOfMemory) throw;
    throw Error(error.code(), name + ": " + error.message());
  }
}

std::string image_digest(FileSystem& files, const ImageSource& source, const CancelToken& cancel) {
  if (!source.problem.empty()) return "unreadable";
  Sha256 hash;
  std::vector<std::byte> buffer(64 << 10);
  try {
    ImageBytes bytes(files, source);
    for (bool is_first = true; const size_t size = bytes.read(buffer); is_first = false) {
      cancel.check();
      const std::span<const std::byte> part = std::span(buffer).first(size);
      if (is_first && !is_readable_format(part)) return "unreadable";
      hash.add(part);
    }
  } catch (const BrokenImage&) {
    hash.add(buffer);  // a decoder may use the bytes before the damaged part
    return "broken " + hash.finish();
  }
  return hash.finish();
}

// Throws Error{kInvalidInput} unless the file of an image is still the file found when the scene
// was opened.
void expect_unchanged(FileSystem& files, const ImageSource& source) {
  try {
    const ImageBytes opened(files, source);
  } catch (const BrokenImage& broken) {
    throw Error(ErrorCode::kInvalidInput, source.name + " changed during the build (it " +
                                              broken.message +
                                              "): expected a file that does not change");
  }
}

}  // namespace

uint32_t page_checksum(std::span<const uint64_t> texels) {
  return static_cast<uint32_t>(checksum64(std::as_bytes(texels)));
}

TextureReader::TextureReader(const TextureLayout& layout, const ReadableFile& file,
                             const uint32_t* checksums, uint64_t memory_bytes, MemoryBudget& budget)
    : layout_(layout), file_(&file), checksums_(checksums) {
  constexpr uint64_t kSlotBytes = kPageBytes + sizeof(uint64_t);
  const uint64_t slots = std::bit_floor(std::max<uint64_t>(memory_bytes / kSlotBytes, 2));
  slot_shift_ = 64 - std::countr_zero(slots);
  slots_charge_ = MemoryCharge(budget, slots * sizeof(uint64_t), "pages of textures");
  page_in_slot_.assign(static_cast<size_t>(slots), kNoPage);
  cache_ =
      PageBuffer<uint64_t>(budget, static_cast<size_t>(slots) * kPageTexels, "pages of textures");
}

void TextureReader::load(uint64_t page, size_t slot) {
  page_in_slot_[slot] = kNoPage;
  const std::span texels(&cache_[slot * kPageTexels], kPageTexels);
  file_->read_at(page * kPageBytes, std::as_writable_bytes(texels));
  if (page_checksum(texels) != checksums_[page])
    throw Error(ErrorCode::kCorrupt,
                file_->path() + " at offset " + std::to_string(page * kPageBytes) +
                    " fails its checksum: expected the texels that were written there; " +
                    repeat_text());
  page_in_slot_[slot] = page;
}

std::unique_ptr<TextureReader> TextureSet::open(uint64_t memory_bytes) {
  if (!file_) return std::make_unique<TextureReader>(layout_, memory_.data());
  return std::make_unique<TextureReader>(layout_, *file_, checksums_.data(), memory_bytes, budget_);
}

uint64_t pyramid_bytes(FileSystem& files, const SceneMaterials& materials, MemoryBudget& budget,
                       const CancelToken& cancel) {
  uint64_t pages = 0;
  std::vector<bool> is_used(materials.images.size());
  for (const Material& material : materials.materials)
    if (material.image < is_used.size()) is_used[material.image] = true;
  for (size_t i = 0; i < materials.images.size(); ++i) {
    const ImageSource& source = materials.images[i];
    cancel.check();
    if (!is_used[i] || !source.problem.empty()) continue;
    try {
      ImageBytes bytes(files, source);
      const auto image = open_image(bytes, budget, ImageUse::kSize, &cancel);
      for (const TextureLevel& level : pyramid_levels(image->width(), image->height(), 0))
        pages += level.pages();
    } catch (const BrokenImage&) {
      // An unreadable image has no pyramid.
    }
  }
  return pages * kPageBytes;
}

std::vector<std::string> image_digests(FileSystem& files, std::span<const ImageSource> images,
                                       unsigned threads, const CancelToken& cancel) {
  std::vector<std::string> digests(images.size());
  parallel_for(threads, images.size(),
               [&](unsigned, size_t i) { digests[i] = image_digest(files, images[i], cancel); });
  return digests;
}

// Fills a TextureSet from the images of a scene, which several threads decode.
class TextureSet::Builder {
 public:
  Builder(FileSystem& files, const SceneMaterials& materials, MemoryBudget& budget,
          const CancelToken& cancel, const Cutouts* cutouts)
      : files_(files),
        materials_(materials),
        budget_(budget),
        cancel_(cancel),
        cutouts_(cutouts),
        set_(new TextureSet(budget)),
        users_(materials.images.size()),
        problems_(materials.images.size()),
        levels_(materials.images.size()) {
    for (size_t i = 0; i < users_.size(); ++i)
      users_[i] = user_of(materials, static_cast<uint32_t>(i));
  }

  // Computes the sizes of the levels of all pyramids, and assigns pages to the levels.
  void measure(unsigned threads) {
    parallel_for(threads, levels_.size(), [&](unsigned, size_t i) {
      cancel_.check();
      with_image(i, [&](const ImageReader& image) {
        levels_[i] = pyramid_levels(image.width(), image.height(), 0);
      });
    });
    for (auto& image : levels_)
      for (TextureLevel& level : image) {
        level.first_page = set_->pages_;
        set_->pages_ += level.pages();
      }
  }

  // Reserves memory for the pages. If they need more than half of the available memory, creates the
  // scratch file instead.
  void reserve(const std::string& path) {
    const auto pages = static_cast<size_t>(set_->pages_);
    if (set_->bytes() <= budget_.available() / 2) {
      set_->memory_ = PageBuffer<uint64_t>(budget_, pages * kPageTexels, "textures");
      return;
    }
    const std::string folder = parent_directory(path);
    if (const uint64_t free_bytes = files_.free_space(folder); set_->bytes() > free_bytes)
      throw Error(ErrorCode::kNoSpace, "the decoded images take " + size_text(set_->bytes()) +
                                           " of disk space, but " + folder + " has only " +
                                           size_text(free_bytes) +
                                           " free: expected more free space");
    writer_ = files_.create(path);
    set_->file_ = files_.open_read(path);
    set_->checksums_ = PageBuffer<uint32_t>(budget_, pages, "checksums of textures");
    files_.remove(path);  // a file without a name is removed when the process ends
  }

  void decode(unsigned threads, Progress& progress) {
    parallel_for(threads, levels_.size(), [&](unsigned, size_t i) {
      if (problems_[i].empty()) with_image(i, [&](ImageReader& image) { decode_image(i, image); });
      if (!users_[i].empty()) progress.advance(1);
    });
  }

  // Removes unreadable images from the materials, with a warning for each problem.
  std::unique_ptr<TextureSet> finish(Progress& progress) {
    for (const Warning& warning : materials_.warnings.list()) progress.warn_of_input(warning);
    set_->materials_ = materials_.materials;
    TextureLayout& layout = set_->layout_;
    for (size_t i = 0; i < levels_.size(); ++i) {
      layout.first_level.push_back(static_cast<uint32_t>(layout.levels.size()));
      std::ranges::copy(levels_[i], std::back_inserter(layout.levels));
      if (!problems_[i].empty()) remove_image(i);
    }
    layout.first_level.push_back(static_cast<uint32_t>(layout.levels.size()));
    for (const UnreadableImages& group : unreadable_) progress.warn_of_input(group.warning());
    return std::move(set_);
  }

 private:
  void remove_image(size_t i) {
    auto group = std::ranges::find(unreadable_, problems_[i], &UnreadableImages::problem);
    if (group == unreadable_.end())
      group = unreadable_.insert(group, {problems_[i], materials_.images[i].name + users_[i]});
    ++group->images;
    for (Material& material : set_->materials_) {
      if (material.image != i) continue;
      material.image = Material::kNoImage;
      ++group->materials;
    }
  }

  // Calls body(image reader), or records the problem of a broken image. Ignores unused images.
  template <class Body>
  void with_image(size_t i, const Body& body) {
    if (users_[i].empty()) return;
    const ImageSource& source = materials_.images[i];
    problems_[i] = source.problem;
    if (!problems_[i].empty()) return;
    alone_if_necessary(mutex_, source.name + users_[i], [&] {
      try {
        ImageBytes bytes(files_, source);
        body(*open_image(bytes, budget_, ImageUse::kPixels, &cancel_));
      } catch (const BrokenImage& broken) {
        problems_[i] = broken.message;
      }
    });
  }

  void decode_image(size_t i, ImageReader& image) {
    TexelRow row(image, cut_by(static_cast<uint32_t>(i)), budget_);
    PyramidBuilder builder(levels_[i], budget_,
                           [&](uint64_t first, std::span<const uint64_t> texels) {
                             cancel_.check();
                             write_pages(first, texels);
                           });
    for (uint32_t y = 0; y < image.height(); ++y) {
      cancel_.check();
      builder.add_row(row.read(image));
    }
    expect_unchanged(files_, materials_.images[i]);
  }

  // Returns a material whose mask was made from this image, or null if there is none.
  const Material* cut_by(uint32_t image) const {
    for (uint32_t m = 0; cutouts_ && m < materials_.materials.size(); ++m)
      if (materials_.materials[m].image == image && cutouts_->mask(m))
        return &cutouts_->materials[m];
    return nullptr;
  }

  void write_pages(uint64_t first, std::span<const uint64_t> texels) {
    if (!writer_) {
      std::ranges::copy(texels, &set_->memory_[static_cast<size_t>(first) * kPageTexels]);
      return;
    }
    for (size_t at = 0; at < texels.size(); at += kPageTexels)
      set_->checksums_[static_cast<size_t>(first) + at / kPageTexels] =
          page_checksum(texels.subspan(at, kPageTexels));
    writer_->write_at(first * kPageBytes, std::as_bytes(texels));
  }

  FileSystem& files_;
  const SceneMaterials& materials_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  const Cutouts* const cutouts_;
  std::unique_ptr<TextureSet> set_;
  std::unique_ptr<WritableFile> writer_;  // writes the scratch file; null if none is needed
  // Every thread that decodes holds this mutex shared. A thread whose image did not fit in memory
  // while others decoded holds it exclusively.
  std::shared_mutex mutex_;
  // For each image: the material that uses it, for messages ("": none), and why it is unreadable.
  std::vector<std::string> users_, problems_;
  std::vector<UnreadableImages> unreadable_;
  std::vector<std::vector<TextureLevel>> levels_;
};

std::unique_ptr<TextureSet> TextureSet::prepare(FileSystem& files, const SceneMaterials& materials,
                                                const std::string& path, unsigned threads,
                                                MemoryBudget& budget, Progress& progress,
                                                const CancelToken& cancel, const Cutouts* cutouts) {
  Builder builder(files, materials, budget, cancel, cutouts);
  builder.measure(threads);
  builder.reserve(path);
  builder.decode(threads, progress);
  return builder.finish(progress);
}

}  // namespace voxdag
