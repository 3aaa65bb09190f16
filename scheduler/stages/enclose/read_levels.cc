#include "scheduler/stages/enclose/read_levels.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/geometry/octree_descent.h"

namespace voxdag {
namespace {

// Marks the rows (nodes) of a level that must be read, and numbers the marked rows.
class NeededRows {
 public:
  NeededRows(PooledMemory& memory, uint64_t rows)
      : words_(rows / 64 + 1),
        bits_(memory, words_, PooledArray<uint64_t>::kZero),
        before_(memory, words_) {}

  void add(uint32_t row) { bits_[row / 64] |= uint64_t{1} << row % 64; }
  bool has(uint64_t row) const { return bits_[row / 64] >> row % 64 & 1; }
  // Returns the number of needed rows. Must be called once before rank().
  uint64_t count() {
    uint64_t total = 0;
    for (uint64_t i = 0; i < words_; ++i) {
      before_[i] = static_cast<uint32_t>(total);
      total += static_cast<uint64_t>(std::popcount(bits_[i]));
    }
    return total;
  }
  uint32_t rank(uint32_t row) const {
    const uint64_t lower = bits_[row / 64] & ((uint64_t{1} << row % 64) - 1);
    return before_[row / 64] + static_cast<uint32_t>(std::popcount(lower));
  }
  bool has_any(uint64_t first, uint64_t rows) const {
    for (uint64_t row = first; row < first + rows; ++row)
      if (has(row)) return true;
    return false;
  }

 private:
  uint64_t words_;
  PooledArray<uint64_t> bits_;
  PooledArray<uint32_t> before_;
};

class LevelsReader {
 public:
  LevelsReader(const ArtifactReader& artifact, PooledMemory& memory, const CancelToken& cancel,
               const LevelClip& clip)
      : artifact_(artifact), memory_(memory), cancel_(cancel), clip_(clip) {}

  // Returns the row of the cube's node; nullopt if the cube is empty.
  std::optional<uint32_t> find_row(const Cube& cube) {
    const auto roots = artifact_.roots();
    const auto root =
        std::ranges::find_if(roots, [&](const ArtifactRoot& r) { return contains(r.cube, cube); });
    if (root == roots.end())
      refuse("none of its roots contains the cube of level " + std::to_string(cube.level) + " at " +
             std::to_string(cube.position[0]) + " " + std::to_string(cube.position[1]) + " " +
             std::to_string(cube.position[2]));
    uint32_t row = root->index;
    for (uint32_t level = root->cube.level; level < cube.level; ++level) {
      const auto child = child_row(level, row, ancestor(cube, level + 1).child_index());
      if (!child) return std::nullopt;
      row = *child;
    }
    return row;
  }

  NodeLevels read(uint32_t top, uint32_t row) {
    NodeLevels out;
    NeededRows needed(memory_, level(top).rows);
    needed.add(row);
    for (uint32_t l = top; l < artifact_.shape().brick_level(); ++l) {
      NeededRows below(memory_, level(l + 1).rows);
      out.nodes.push_back(read_nodes(l, needed, below));
      needed = std::move(below);
    }
    read_bricks(needed, out);
    return out;
  }

 private:
  [[noreturn]] void refuse(const std::string& problem) const {
    throw Error(ErrorCode::kCorrupt, artifact_.place() + ": " + problem +
                                         ", expected a complete artifact; start over with " +
                                         option_text("restart"));
  }

  const ArtifactLevel& level(uint32_t number) const {
    const ArtifactLevel* const level = artifact_.level(number);
    if (level == nullptr) refuse("level " + std::to_string(number) + " is missing");
    return *level;
  }

  std::optional<uint32_t> child_row(uint32_t number, uint32_t row, int octant) {
    const auto& frames = level(number).frames;
    const auto after = std::ranges::upper_bound(frames, uint64_t{row}, {}, &FrameInfo::first_row);
    if (after == frames.begin())
      refuse("level " + std::to_string(number) + " has no frame of row " + std::to_string(row));
    const size_t frame = static_cast<size_t>(after - frames.begin()) - 1;
    artifact_.read_frame(number, frame, frame_);
    size_t at = 0;
    const size_t place = row - frames[frame].first_row;
    for (size_t i = 0; i < place; ++i) at += static_cast<size_t>(popcount8(frame_.masks[i]));
    const uint32_t mask = frame_.masks[place];
    if ((mask >> octant & 1) == 0) return std::nullopt;
    return frame_.children[at + static_cast<size_t>(popcount8(mask & ((1u << octant) - 1)))];
  }

  // Returns a mask of the octants that are read from the nodes of level `number`.
  uint32_t clipped_octants(uint32_t number) const {
    const bool is_whole =
        static_cast<int>(artifact_.shape().grid_levels - number) <= clip_.whole_log2;
    return is_whole ? 0xff : clip_.octants;
  }

  // Reads the needed rows of a level, and adds their children to `below`.
  NodeLevels::Level read_nodes(uint32_t number, NeededRows& needed, NeededRows& below) {
    const ArtifactLevel& stored = level(number);
    const uint32_t octants = clipped_octants(number);
    NodeLevels::Level out;
    const uint64_t rows = needed.count();
    out.masks = PooledArray<uint8_t>(memory_, rows);
    out.first_child = PooledArray<uint32_t>(memory_, rows);
    uint64_t children = 0;
    for (size_t f = 0; f < stored.frames.size(); ++f) {
      const FrameInfo& info = stored.frames[f];
      if (!needed.has_any(info.first_row, info.rows)) continue;
      cancel_.check();
      artifact_.read_frame(number, f, frame_);
      if (children + frame_.children.size() > out.children.size())
        out.children.grow(memory_, children + frame_.children.size());
      size_t at = 0;
      for (uint32_t i = 0; i < frame_.rows; ++i) {
        const uint32_t mask = frame_.masks[i];
        if (needed.has(info.first_row + i)) {
          out.masks[out.rows] = static_cast<uint8_t>(mask & octants);
          out.first_child[out.rows++] = static_cast<uint32_t>(children);
          size_t child = at;
          for (uint32_t rest = mask; rest != 0; rest &= rest - 1, ++child)
            if ((octants >> std::countr_zero(rest) & 1) != 0)
              below.add(out.children[children++] = frame_.children[child]);
        }
        at += static_cast<size_t>(popcount8(frame_.masks[i]));
      }
    }
    below.count();
    for (uint64_t c = 0; c < children; ++c) out.children[c] = below.rank(out.children[c]);
    return out;
  }

  void read_bricks(NeededRows& needed, NodeLevels& out) {
    const uint32_t number = artifact_.shape().brick_level();
    const ArtifactLevel& stored = level(number);
    out.bricks = PooledArray<uint64_t>(memory_, needed.count());
    for (size_t f = 0; f < stored.frames.size(); ++f) {
      const FrameInfo& info = stored.frames[f];
      if (!needed.has_any(info.first_row, info.rows)) continue;
      cancel_.check();
      artifact_.read_frame(number, f, frame_);
      for (uint32_t i = 0; i < frame_.rows; ++i)
        if (needed.has(info.first_row + i)) out.bricks[out.brick_rows++] = frame_.brick_masks[i];
    }
  }

  const ArtifactReader& artifact_;
  PooledMemory& memory_;
  const CancelToken& cancel_;
  const LevelClip clip_;
  Frame frame_;
};

}  // namespace

std::optional<NodeLevels> read_levels(const ArtifactReader& artifact, const Cube& cube,
                                      PooledMemory& memory, const CancelToken& cancel,
                                      const LevelClip& clip) {
  LevelsReader reader(artifact, memory, cancel, clip);
  const auto row = reader.find_row(cube);
  if (!row) return std::nullopt;
  return reader.read(cube.level, *row);
}

}  // namespace voxdag
