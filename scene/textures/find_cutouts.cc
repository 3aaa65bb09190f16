#include "scene/textures/find_cutouts.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "core/color/cutouts/hidden.h"
#include "core/image/image_reader.h"
#include "scene/textures/image_bytes.h"

namespace voxdag {
namespace {

// The properties of a material that determine its mask.
using MaskKey = std::tuple<uint32_t, AlphaMode, uint16_t, uint16_t>;
MaskKey key_of(const Material& m) { return {m.image, m.alpha_mode, m.alpha_cutoff, m.factor[3]}; }

bool needs_mask(const Material& m) {
  return m.alpha_mode != AlphaMode::kOpaque && m.image != Material::kNoImage;
}

// A mask to decode, from an image and the alpha properties of a material that uses the image.
struct Task {
  const ImageSource* image;
  const Material* material;
  std::optional<AlphaMask> mask;
  std::string problem;  // why the image is unreadable
};

AlphaMask decode(FileSystem& files, const Task& task, MemoryBudget& budget,
                 const CancelToken& cancel) {
  ImageBytes bytes(files, *task.image);
  const auto image = open_image(bytes, budget, ImageUse::kPixels, &cancel);
  AlphaMask mask(image->width(), image->height(), budget);
  const bool is_wide = image->bits() == 16;
  PageBuffer<std::byte> row(budget, size_t{image->width()} * (is_wide ? 8 : 4),
                            "a row of an image");
  for (uint32_t y = 0; y < image->height(); ++y) {
    cancel.check();
    image->read_row({row.data(), row.size()});
    for (uint32_t x = 0; x < image->width(); ++x) {
      uint16_t alpha = static_cast<uint16_t>(std::to_integer<uint16_t>(row[4 * x + 3]) * 257);
      if (is_wide) std::memcpy(&alpha, &row[8 * size_t{x} + 6], sizeof alpha);
      if (!color::is_hidden(*task.material, alpha)) mask.set_visible(x, y);
    }
  }
  mask.finish();
  return mask;
}

void decode_all(FileSystem& files, std::vector<Task>& tasks, unsigned threads, MemoryBudget& budget,
                const CancelToken& cancel) {
  parallel_for(threads, tasks.size(), [&](unsigned, size_t i) {
    Task& task = tasks[i];
    task.mask.reset();
    task.problem = task.image->problem;
    if (!task.problem.empty()) return;
    try {
      task.mask.emplace(decode(files, task, budget, cancel));
    } catch (const BrokenImage& broken) {
      task.problem = broken.message;
    }
  });
}

bool shows_all(const AlphaMask& mask) { return mask.all_visible(mask.levels() - 1, 0, 0); }

}  // namespace

Cutouts find_cutouts(FileSystem& files, const SceneMaterials& materials, unsigned threads,
                     MemoryBudget& budget, const CancelToken& cancel, WarningList& problems) {
  Cutouts cutouts;
  cutouts.materials = materials.materials;
  cutouts.mask_of.assign(materials.materials.size(), Cutouts::kNoMask);
  std::vector<Task> tasks;
  std::map<MaskKey, size_t> task_of;
  for (const Material& material : cutouts.materials)
    if (needs_mask(material) && task_of.try_emplace(key_of(material), tasks.size()).second)
      tasks.push_back({&materials.images[material.image], &material, {}, {}});
  try {
    decode_all(files, tasks, threads, budget, cancel);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kOutOfMemory) throw;
    for (Task& task : tasks) task.mask.reset();
    decode_all(files, tasks, 1, budget, cancel);
  }
  std::vector<uint32_t> mask_of_task(tasks.size(), Cutouts::kNoMask);
  for (size_t i = 0; i < tasks.size(); ++i) {
    if (!tasks[i].problem.empty())
      problems.add({"unusable-image", tasks[i].image->name,
                    tasks[i].problem + "; the cutouts of its materials are kept"});
    if (!tasks[i].mask || shows_all(*tasks[i].mask)) continue;
    mask_of_task[i] = static_cast<uint32_t>(cutouts.masks.size());
    cutouts.masks.push_back(std::move(*tasks[i].mask));
  }
  for (size_t m = 0; m < cutouts.materials.size(); ++m)
    if (needs_mask(cutouts.materials[m]))
      cutouts.mask_of[m] = mask_of_task[task_of.at(key_of(cutouts.materials[m]))];
  return cutouts;
}

std::vector<SourceFile> cutout_files(const SceneMaterials& materials) {
  std::vector<SourceFile> files;
  for (const Material& material : materials.materials)
    if (needs_mask(material)) files.push_back(materials.images[material.image].file);
  return files;
}

bool may_have_cutouts(const SceneMaterials& materials) {
  return std::ranges::any_of(materials.materials, [](const Material& material) {
    return material.alpha_mode != AlphaMode::kOpaque;
  });
}

Checksum128 cutout_digest(const Cutouts& cutouts) {
  std::vector<uint64_t> words;
  for (size_t m = 0; m < cutouts.materials.size(); ++m) {
    const Material& material = cutouts.materials[m];
    if (material.alpha_mode == AlphaMode::kOpaque) continue;
    for (const uint64_t number :
         {uint64_t{m}, uint64_t{cutouts.mask_of[m]}, uint64_t{material.factor[3]},
          uint64_t{material.alpha_cutoff}, static_cast<uint64_t>(material.alpha_mode),
          static_cast<uint64_t>(material.wrap[0]), static_cast<uint64_t>(material.wrap[1])})
      words.push_back(number);
  }
  for (const AlphaMask& mask : cutouts.masks) {
    const Checksum128 texels = checksum128(std::as_bytes(mask.texels()));
    for (const uint64_t number :
         {uint64_t{mask.width()}, uint64_t{mask.height()}, texels.low, texels.high})
      words.push_back(number);
  }
  return checksum128(std::as_bytes(std::span(words)));
}

SceneMaterials with_separate_images(SceneMaterials materials, const Cutouts& cutouts) {
  std::vector<uint32_t> image_of(cutouts.masks.size(), Material::kNoImage);
  for (size_t m = 0; m < materials.materials.size(); ++m) {
    Material& material = materials.materials[m];
    const uint32_t mask = cutouts.mask_of[m];
    if (mask == Cutouts::kNoMask || material.image == Material::kNoImage) continue;
    if (image_of[mask] == Material::kNoImage) {
      image_of[mask] = static_cast<uint32_t>(materials.images.size());
      materials.images.push_back(materials.images[material.image]);
    }
    material.image = image_of[mask];
  }
  return materials;
}

uint64_t count_cutout_materials(const SceneMaterials& materials) {
  return static_cast<uint64_t>(std::ranges::count_if(materials.materials, [](const Material& m) {
    if (m.alpha_mode == AlphaMode::kOpaque) return false;
    if (m.alpha_mode == AlphaMode::kMask && m.alpha_cutoff == 0) return false;
    return m.image != Material::kNoImage || color::alpha_by_mode(m, m.factor[3]) == 0;
  }));
}

}  // namespace voxdag
