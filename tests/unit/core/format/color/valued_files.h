// Global files with the attributes other than color, and a decoder of their sections that was
// written only from docs/format.md.
#pragma once

#include "core/color/attribute_set.h"
#include "core/color/blocks/value_region.h"
#include "core/format/color/attribute_section_writer.h"
#include "tests/unit/core/format/color/colored_files.h"

namespace voxdag {

// Returns the attribute's value of a finest cell. `code` is the cell's Morton code.
inline uint32_t value_of_code(Attribute attribute, uint64_t code, uint64_t materials) {
  oracle::Random random(code * 8 + static_cast<uint64_t>(attribute));
  if (attribute == Attribute::kAlpha) return static_cast<uint32_t>(random.between(0, 255));
  if (attribute == Attribute::kMaterial)
    return static_cast<uint32_t>(random.between(0, static_cast<int64_t>(materials) - 1));
  return static_cast<uint32_t>(random.between(0, 254) | random.between(0, 254) << 8);
}

// Returns `count` names. Name i is "m" and the number i, repeated i mod 5 times. The last name is
// empty: it stands for cells without a material.
inline std::vector<std::string> names_of_materials(size_t count) {
  std::vector<std::string> names(count);
  for (size_t i = 0; i + 1 < count; ++i)
    for (size_t n = 0; n < i % 5; ++n) names[i] += "m" + std::to_string(i);
  return names;
}

inline std::vector<EncodedRegion> encode_values_of(const ColoredScene& scene, Attribute attribute,
                                                   uint64_t materials) {
  const uint32_t levels = std::min(scene.color_levels, kRegionLevels);
  std::map<uint64_t, std::vector<ValuedCell>> cells;
  for (const uint64_t code : scene.cells(scene.color_levels))
    cells[code >> 3 * levels].push_back(
        {static_cast<uint32_t>(code & ((uint64_t{1} << 3 * levels) - 1)),
         value_of_code(attribute, code, materials)});
  std::vector<EncodedRegion> regions;
  for (const auto& [morton, of_region] : cells)
    regions.push_back(
        encode_values(attribute, value_bytes(attribute, materials), levels, morton, of_region));
  return regions;
}

inline GlobalFileSummary write_valued(const std::string& path, const ColoredScene& scene,
                                      const AttributeSet& attributes, size_t materials = 3,
                                      uint64_t narrow_words = global_layout::kNarrowLevelWords) {
  const oracle::Dag dag = sparse_dag(scene.voxels, scene.levels);
  GlobalFileWriter writer(system_files(), path, Grid::given({0, 0, 0}, 1, scene.levels), 64,
                          narrow_words);
  write_levels(writer, dag, scene.levels);
  MemoryBudget budget(uint64_t{1} << 28);
  for (const Attribute attribute : attributes.list()) {
    if (attribute == Attribute::kColor) {
      write_colors(writer, scene);
      continue;
    }
    AttributeSectionWriter section(writer, attribute, scene.color_levels,
                                   names_of_materials(materials), budget);
    for (const EncodedRegion& region : encode_values_of(scene, attribute, materials))
      section.add_region(region);
    section.finish();
  }
  return writer.finish({dag.voxels, dag.svo_nodes});
}

// Decodes a section of values as docs/format.md describes it: the cells of a region level by level,
// in Morton order, with `bytes` bytes per cell, in blocks of 32 cells.
class ValueDecoder {
 public:
  // `index`: index of the section in the section table.
  ValueDecoder(const ByteString& file, const ColoredScene& scene, size_t index, uint32_t kind,
               uint64_t bytes)
      : file_(file) {
    const uint64_t entry = 1152 + 64 * index, section = u(entry + 8, 8), size = u(entry + 16, 8);
    const uint32_t c = scene.color_levels;
    EXPECT_EQ(u(entry, 4), kind);
    EXPECT_EQ(u(entry + 4, 4), c);
    EXPECT_EQ(u(entry + 40, 4), 32 * bytes);
    EXPECT_EQ(u(entry + 32, 8), scene.cells(c).size());
    const uint64_t tiers = c / 7 + 1, table = section + size - 32 * tiers;
    uint64_t end = section;
    for (uint64_t t = 0; t < tiers; ++t) {
      const auto finest = static_cast<uint32_t>(c - 7 * t), depth = std::min(finest, 6u);
      EXPECT_EQ(u(table + 32 * t, 8), end - section);
      const uint64_t directory = end + 16 * u(table + 32 * t + 8, 8);
      std::map<uint64_t, std::vector<Codes>> regions;
      for (uint32_t i = 0; i <= depth; ++i)
        for (const uint64_t code : scene.cells(finest - i)) {
          auto& levels = regions[code >> 3 * (depth - i)];
          levels.resize(depth + 1);
          levels[i].push_back(code);
        }
      EXPECT_EQ(u(table + 32 * t + 16, 8), regions.size());
      uint64_t number = 0;
      for (const auto& [region, levels] : regions) {
        EXPECT_EQ(u(directory + 32 * number, 8), region);
        uint64_t at = end + 16 * u(directory + 32 * number++ + 8, 8);
        for (uint32_t i = 0; i <= depth; ++i)
          for (const uint64_t code : levels[i]) {
            values_[{finest - i, code}] = u(at, bytes);
            at += bytes;
          }
      }
      end = directory + 32 * regions.size();
    }
    EXPECT_EQ(u(entry + 24, 8), values_.size());
    if (kind != 4) {
      EXPECT_EQ(end, table);
      return;
    }
    const uint64_t count = u(end, 4), begin = end;
    end += 4;
    for (uint64_t i = 0; i < count; ++i) {
      names_.push_back(file.substr(end + 4, u(end, 4)));
      end += 4 + u(end, 4);
    }
    EXPECT_EQ(begin + (end - begin + 15) / 16 * 16, table);
  }

  // Returns the values by level and Morton code.
  const std::map<std::pair<uint32_t, uint64_t>, uint64_t>& values() const { return values_; }
  const std::vector<std::string>& names() const { return names_; }

 private:
  uint64_t u(uint64_t at, size_t size) const { return number_at(file_, at, size); }

  const ByteString& file_;
  std::map<std::pair<uint32_t, uint64_t>, uint64_t> values_;
  std::vector<std::string> names_;
};

}  // namespace voxdag
