// The components (space_labels.h) at a face of a sub-DAG's cube, encoded as a quadtree in bytes.
// The components of two neighboring cubes are joined by reading the quadtrees of their common face
// together.
//
//   quadtree = 0                  no empty voxel
//            | 1 quadtree (4x)    the quadrants, in the order of their octants
//            | 2 label            all voxels are empty and in one component
//            | 3 count (label, mask of 16 voxels) (count times)    the face of a brick
//
// A label is a component number of the root, encoded with seven bits per byte, the lowest bits
// first.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/dag/space/space_labels.h"

namespace voxdag {

// Returns the quadtree of face `face` of the root. Throws OutOfBudget if it exceeds `max_bytes`.
std::vector<std::byte> encode_face(const SpaceLabels& labels, int face, uint64_t max_bytes);

// Returns the quadtree of a face of an empty cube. The label of the cube's only component is 0.
std::vector<std::byte> empty_face();

// Reads a quadtree. Throws Error{kCorrupt}, which names the file, if the bytes are not a quadtree.
class FaceReader {
 public:
  enum class Kind : uint8_t { kSet, kSplit, kEmpty, kBrick };
  struct Piece {
    uint32_t label;
    uint16_t voxels;
  };
  // A square of the quadtree, without its quadrants.
  struct Square {
    Kind kind = Kind::kSet;
    std::vector<Piece> pieces;  // kEmpty: one piece; kBrick: one for each component at the face
  };

  // `path` is the file that contains the bytes. `path` and `bytes` must outlive the reader.
  FaceReader(const std::string& path, std::span<const std::byte> bytes)
      : path_(path), bytes_(bytes) {}

  // Reads the next square. If its kind is kSplit, its quadrants follow.
  Square next();
  // Skips the quadrants of a square that next() returned.
  void skip(const Square& square);
  // Reads the square at a path of quadrants. If a larger square contains it, and is not split,
  // returns the larger square.
  Square descend(std::span<const uint8_t> path);
  // Throws Error{kCorrupt} if no face of a grid has a quadtree of this depth.
  void check_depth(int depth) const;
  [[noreturn]] void refuse() const;

 private:
  uint8_t byte();
  uint32_t label();

  const std::string& path_;
  std::span<const std::byte> bytes_;
  size_t at_ = 0;
};

// Calls unite(label_a, label_b) for each two components that touch, one in each square. `in_a` and
// `in_b` are the squares that `a` and `b` have just read. Also reads or skips the quadrants of
// these squares. `depth` is the depth of the recursion.
template <class Unite>
void join_squares(FaceReader& a, const FaceReader::Square& in_a, FaceReader& b,
                  const FaceReader::Square& in_b, const Unite& unite, int depth = 0) {
  using Kind = FaceReader::Kind;
  a.check_depth(depth);
  if (in_a.kind == Kind::kSet || in_b.kind == Kind::kSet) {
    a.skip(in_a);
    b.skip(in_b);
  } else if (in_a.kind != Kind::kSplit && in_b.kind != Kind::kSplit) {
    for (const auto& p : in_a.pieces)
      for (const auto& q : in_b.pieces)
        if ((p.voxels & q.voxels) != 0) unite(p.label, q.label);
  } else {
    for (int i = 0; i < 4; ++i) {
      const auto next_a = in_a.kind == Kind::kSplit ? a.next() : in_a;
      const auto next_b = in_b.kind == Kind::kSplit ? b.next() : in_b;
      join_squares(a, next_a, b, next_b, unite, depth + 1);
    }
  }
}

}  // namespace voxdag
