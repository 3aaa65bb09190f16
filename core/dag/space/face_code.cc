#include "core/dag/space/face_code.h"

#include "core/base/error.h"
#include "core/base/memory_budget.h"

namespace voxdag {
namespace {

constexpr uint32_t kNoLabel = UINT32_MAX;
constexpr int kMaxFaceDepth = 32;

// Returns the voxels of `mask` at a face of the brick: a bit for each of the 16 voxels at the face,
// in the order of their bits in `mask`.
uint16_t face_voxels(uint64_t mask, int face) {
  uint16_t out = 0;
  int at = 0;
  for (uint64_t rest = brick_face(face); rest != 0; rest &= rest - 1, ++at)
    if ((mask & rest & (~rest + 1)) != 0) out = static_cast<uint16_t>(out | 1 << at);
  return out;
}

class FaceEncoder {
 public:
  FaceEncoder(const SpaceLabels& labels, int face, uint64_t max_bytes, std::vector<std::byte>& out)
      : labels_(labels), face_(face), max_bytes_(max_bytes), out_(out) {}

  void run() {
    const uint32_t count = labels_.count(0, 0);
    for (uint32_t c = 0; c < count; ++c) numbers_.push_back(c);
    encode(0, {true, 0, 0});
  }

 private:
  void encode(int depth, const LabeledCube& cube) {
    if (out_.size() > max_bytes_) throw OutOfBudget();
    const uint32_t label = label_at_face(depth, cube);
    if (label == kNoLabel) return put(FaceReader::Kind::kSet);
    if (!cube.exists || (labels_.open_faces(depth, cube.row) >> face_ & 1) != 0) {
      put(FaceReader::Kind::kEmpty);
      return put_label(label);
    }
    if (depth == labels_.levels().brick_depth()) return encode_brick(depth, cube);
    put(FaceReader::Kind::kSplit);
    const size_t used = numbers_.size();
    for (int o = 0; o < 8; ++o) {
      if ((outer_faces(o) >> face_ & 1) == 0) continue;
      encode(depth + 1, octant_of(labels_, depth, cube, o, kNoLabel, numbers_));
      numbers_.resize(used);
    }
  }

  // Returns the label of the first component at the face; kNoLabel if all voxels at the face are
  // set.
  uint32_t label_at_face(int depth, const LabeledCube& cube) const {
    if (!cube.exists) return numbers_[cube.first];
    const uint8_t* const touch = labels_.touch(depth, cube.row);
    const uint32_t count = labels_.count(depth, cube.row);
    for (uint32_t c = 0; c < count; ++c)
      if ((touch[c] >> face_ & 1) != 0) return numbers_[cube.first + c];
    return kNoLabel;
  }

  void encode_brick(int depth, const LabeledCube& cube) {
    const uint8_t* const touch = labels_.touch(depth, cube.row);
    const uint32_t count = labels_.count(depth, cube.row);
    uint8_t pieces = 0;
    for (uint32_t c = 0; c < count; ++c) pieces += touch[c] >> face_ & 1;
    put(FaceReader::Kind::kBrick);
    out_.push_back(std::byte{pieces});
    for (uint32_t c = 0; c < count; ++c) {
      if ((touch[c] >> face_ & 1) == 0) continue;
      put_label(numbers_[cube.first + c]);
      const uint16_t voxels = face_voxels(labels_.brick_components(cube.row)[c], face_);
      out_.push_back(static_cast<std::byte>(voxels & 0xff));
      out_.push_back(static_cast<std::byte>(voxels >> 8));
    }
  }

  void put(FaceReader::Kind kind) { out_.push_back(static_cast<std::byte>(kind)); }
  void put_label(uint32_t label) {
    for (; label >= 0x80; label >>= 7) out_.push_back(static_cast<std::byte>(label | 0x80));
    out_.push_back(static_cast<std::byte>(label));
  }

  const SpaceLabels& labels_;
  const int face_;
  const uint64_t max_bytes_;
  std::vector<std::byte>& out_;
  std::vector<uint32_t> numbers_;  // for each component of the cubes on the path: the component of
                                   // the root that contains it
};

}  // namespace

std::vector<std::byte> encode_face(const SpaceLabels& labels, int face, uint64_t max_bytes) {
  std::vector<std::byte> out;
  FaceEncoder(labels, face, max_bytes, out).run();
  return out;
}

std::vector<std::byte> empty_face() {
  return {static_cast<std::byte>(FaceReader::Kind::kEmpty), std::byte{0}};
}

void FaceReader::refuse() const {
  throw Error(ErrorCode::kCorrupt,
              path_ +
                  ": the labels of the empty space at a face of a subvolume are damaged at byte " +
                  std::to_string(at_) + " of " + std::to_string(bytes_.size()) +
                  ": expected a complete quadtree of labels");
}

uint8_t FaceReader::byte() {
  if (at_ >= bytes_.size()) refuse();
  return static_cast<uint8_t>(bytes_[at_++]);
}

uint32_t FaceReader::label() {
  uint32_t label = 0;
  for (int shift = 0; shift < kMaxFaceDepth; shift += 7) {
    const uint8_t next = byte();
    label |= static_cast<uint32_t>(next & 0x7f) << shift;
    if (next < 0x80) return label;
  }
  refuse();
}

FaceReader::Square FaceReader::next() {
  const uint8_t kind = byte();
  if (kind > static_cast<uint8_t>(Kind::kBrick)) refuse();
  Square out{static_cast<Kind>(kind), {}};
  if (out.kind == Kind::kEmpty) out.pieces.push_back({label(), 0xffff});
  if (out.kind == Kind::kBrick)
    for (int count = byte(); count > 0; --count) {
      const uint32_t of_piece = label();
      const uint32_t low = byte();
      out.pieces.push_back({of_piece, static_cast<uint16_t>(low | uint32_t{byte()} << 8)});
    }
  return out;
}

void FaceReader::skip(const Square& square) {
  for (uint64_t left = square.kind == Kind::kSplit ? 4 : 0; left > 0; --left)
    if (next().kind == Kind::kSplit) left += 4;
}

void FaceReader::check_depth(int depth) const {
  if (depth > kMaxFaceDepth) refuse();
}

FaceReader::Square FaceReader::descend(std::span<const uint8_t> path) {
  Square square = next();
  for (const uint8_t quadrant : path) {
    if (square.kind != Kind::kSplit) break;
    for (int i = 0; i < quadrant; ++i) skip(next());
    square = next();
  }
  return square;
}

}  // namespace voxdag
