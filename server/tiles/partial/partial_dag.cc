#include "server/tiles/partial/partial_dag.h"

#include <array>
#include <string>

#include "core/base/error.h"
#include "core/dag/brick.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kMaxWords = uint64_t{1} << 32;  // per level, because child pointers have 32 bits

bool is_within(const Cube& cube, const Cube& whole) {
  if (cube.level < whole.level) return false;
  for (int axis = 0; axis < 3; ++axis)
    if (cube.position[axis] >> (cube.level - whole.level) != whole.position[axis]) return false;
  return true;
}

query::DagView view_of(const std::vector<std::vector<uint32_t>>& levels, uint32_t grid_levels) {
  std::vector<query::DagView::Level> views;
  if (!levels[0].empty())
    for (const std::vector<uint32_t>& words : levels) views.push_back({words, false});
  return query::DagView(std::move(views), grid_levels, "the unfinished result");
}

}  // namespace

PartialDag::PartialDag(uint32_t grid_levels)
    : brick_level_(grid_levels - kBrickLevels),
      levels_(brick_level_ + 1),
      known_(brick_level_ + 1),
      coarse_(brick_level_ + 1),
      solid_(brick_level_ + 1) {}

std::optional<uint64_t> PartialDag::add(const std::vector<Part>& parts) {
  Parts all;
  for (const Part& part : parts)
    if (part.brick != 0) all.push_back(&part);
  if (all.empty()) return std::nullopt;
  return add_parts({}, all);
}

uint64_t PartialDag::add_parts(const Cube& cube, const Parts& parts) {
  for (const Part* part : parts)
    if (!is_within(part->cube, cube) || part->cube.level > brick_level_ ||
        (parts.size() > 1 && part->cube.level == cube.level))
      throw Error(ErrorCode::kCorrupt, "the subvolume of level " +
                                           std::to_string(part->cube.level) + " at " +
                                           std::to_string(part->cube.position[0]) + " " +
                                           std::to_string(part->cube.position[1]) + " " +
                                           std::to_string(part->cube.position[2]) +
                                           " overlaps another one, or is outside the grid: "
                                           "expected separate subvolumes in the grid");
  if (parts.size() == 1 && parts[0]->cube.level == cube.level)
    return add_coarse(cube.level, parts[0]->brick);
  std::vector<uint64_t> children;
  uint32_t mask = 0;
  for (int i = 0; i < 8; ++i) {
    const Cube child = cube.child(i);
    Parts inside;
    for (const Part* part : parts)
      if (is_within(part->cube, child)) inside.push_back(part);
    if (inside.empty()) continue;
    mask |= 1u << i;
    children.push_back(add_parts(child, inside));
  }
  return add_node(cube.level, mask, children);
}

uint64_t PartialDag::add_coarse(uint32_t level, uint64_t brick) {
  if (level == brick_level_) return add_brick(brick);
  const auto known = coarse_[level].find(brick);
  if (known != coarse_[level].end()) return known->second;
  std::vector<uint64_t> children;
  uint32_t mask = 0;
  for (int i = 0; i < 8; ++i) {
    const uint32_t octants = static_cast<uint32_t>(brick >> (8 * i)) & 255;
    if (octants == 0) continue;
    mask |= 1u << i;
    children.push_back(add_octants(level + 1, octants));
  }
  return coarse_[level][brick] = add_node(level, mask, children);
}

uint64_t PartialDag::add_solid(uint32_t level) {
  if (!solid_[level]) solid_[level] = add_octants(level, 255);
  return *solid_[level];
}

uint64_t PartialDag::add_octants(uint32_t level, uint32_t mask) {
  if (level == brick_level_) {
    uint64_t brick = 0;
    for (int i = 0; i < 8; ++i)
      if (mask >> i & 1) brick |= uint64_t{255} << (8 * i);
    return add_brick(brick);
  }
  return add_node(level, mask, std::vector<uint64_t>(kPopcount8[mask], add_solid(level + 1)));
}

uint64_t PartialDag::add_node(uint32_t level, uint32_t mask,
                              const std::vector<uint64_t>& children) {
  std::vector<uint32_t> words = {mask};
  for (const uint64_t child : children) words.push_back(static_cast<uint32_t>(child));
  return add_words(level, std::move(words));
}

uint64_t PartialDag::add_brick(uint64_t brick) {
  return add_words(brick_level_,
                   {static_cast<uint32_t>(brick), static_cast<uint32_t>(brick >> 32)});
}

uint64_t PartialDag::add_words(uint32_t level, std::vector<uint32_t> words) {
  const auto found = known_[level].find(words);
  if (found != known_[level].end()) return found->second;
  std::vector<uint32_t>& all = levels_[level];
  const uint64_t offset = all.size();
  if (offset + words.size() > kMaxWords)
    throw Error(ErrorCode::kLimit,
                "level " + std::to_string(level) + " of the preview would have " +
                    std::to_string(offset + words.size()) + " words: expected at most " +
                    std::to_string(kMaxWords) + " per level");
  // The words are appended before their offset is recorded in known_. So every recorded offset has
  // its words, even if a later step throws.
  all.insert(all.end(), words.begin(), words.end());
  word_count_ += words.size();
  known_[level].emplace(std::move(words), offset);
  return offset;
}

PartialDagCopy::PartialDagCopy(const PartialDag& dag, uint32_t grid_levels)
    : levels_(dag.levels()), view_(view_of(levels_, grid_levels)) {}

}  // namespace voxdag::server
