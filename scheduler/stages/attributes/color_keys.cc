#include "scheduler/stages/attributes/color_keys.h"

#include "core/format/bytes.h"
#include "scene/textures/find_cutouts.h"

namespace voxdag {
namespace {

// Version of the color rule, the decoders, the blocks and the region records. Increase it with any
// change to them, so that colors baked by an earlier version are not reused.
constexpr uint32_t kColorVersion = 2;

}  // namespace

std::vector<Checksum128> look_digests(std::span<const Material> materials,
                                      std::span<const std::string> images,
                                      const AttributeSet& attributes, const Cutouts* cutouts) {
  // Cutouts also decide which cells a material's triangles touch. So the look (see look_digests())
  // of every material that is not opaque contains the digest of all cutouts.
  const Checksum128 cut = cutouts ? cutout_digest(*cutouts) : Checksum128{};
  std::vector<Checksum128> digests;
  digests.reserve(materials.size());
  std::vector<std::byte> bytes;
  for (const Material& m : materials) {
    bytes.clear();
    ByteSink sink(bytes);
    for (const uint16_t factor : m.factor) sink.put(factor);
    sink.put(m.alpha_cutoff);
    sink.put(static_cast<uint8_t>(m.alpha_mode));
    for (const Wrap wrap : m.wrap) sink.put(static_cast<uint8_t>(wrap));
    if (m.image != Material::kNoImage) sink.put_bytes(std::as_bytes(std::span(images[m.image])));
    if (attributes.have_names()) sink.put(m.number);
    if (cutouts && m.alpha_mode != AlphaMode::kOpaque)
      for (const uint64_t word : {cut.low, cut.high}) sink.put(word);
    digests.push_back(checksum128(bytes));
  }
  return digests;
}

Checksum128 surface_digest(std::span<const std::byte> record, const Checksum128& look) {
  const Checksum128 own = checksum128(record);
  const uint64_t words[] = {own.low, own.high, look.low, look.high};
  return checksum128(std::as_bytes(std::span(words)));
}

Checksum128 attribute_key(const StoredAttribute& attribute, const ColorGrid& grid, const Cube& cube,
                          const BinContent& content) {
  std::vector<std::byte> bytes;
  ByteSink sink(bytes);
  for (const uint32_t number : {kColorVersion, grid.levels, grid.color_levels, cube.level,
                                cube.position[0], cube.position[1], cube.position[2]})
    sink.put(number);
  for (const uint64_t number : {content.surfaces, content.sum.low, content.sum.high})
    sink.put(number);
  if (!traits_of(attribute.kind).is_color()) {
    sink.put(static_cast<uint32_t>(attribute.kind));
    sink.put(attribute.value_bytes);
  }
  return checksum128(bytes);
}

}  // namespace voxdag
