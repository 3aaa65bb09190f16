// Reads voxdag's global file (.vdag). Depends only on the C++17 standard library, POSIX or Windows,
// and the two other voxdag_reader headers. Copy the three headers into your engine. docs/format.md
// describes the file.
//
//     voxdag_reader::File dag("scene.vdag");               // throws voxdag_reader::Error
//     voxdag_reader::File packed(data, size);              // a file that is already in memory
//     bool set = dag.voxel(x, y, z);                       // 0 <= x, y, z < dag.resolution()
//     dag.walk(visitor);                                   // depth first; can skip subtrees
//     if (auto rgb = dag.color(x, y, z, level)) ...        // color of a cell of edge R/2^level
//     voxdag_reader::ColorCursor colors(dag);              // the same, fast for nearby cells
//     dag.alpha(x, y, z, level), dag.normal(...), dag.material(...), dag.material_names()
//     const voxdag_reader::Level& level = dag.level(l);    // raw words, for an upload to the GPU
//
// Level l has cubes of edge R/2^l voxels. Level 0 is the root. Bricks (4x4x4 voxels) are level
// brick_level() = log2(R) - 2. Within a level everything is addressed by word offsets:
//     brick:  [mask, low 32 bits] [mask, high 32 bits]     bit = 32x1 + 16y1 + 8z1 + 4x0 + 2y0 + z0
//     node:   [child mask, 8 bits] [offset of each child in level l + 1, in child order]
// In the formula of the bit, x1 and x0 are bits 1 and 0 of the voxel's coordinate x. An offset is
// one word; if the pointer_bits of level l + 1 are 64, it is two words, low half first. Child index
// = 4x + 2y + z. A scene without voxels has no nodes: empty() is true.
//
// Opening a file checks the header, and that the levels and the checksum table are within the file.
// Nodes and bricks are checked when they are read: a bad offset in a damaged file is an Error,
// never a read outside the mapping. verify_checksums() compares all data with its checksums.
//
// The file is mapped, or read into memory if mmap fails or Access::kRead is requested. A mapped
// file must not be truncated while it is open. A File is immutable; any thread may use it.
//
// For programs without exceptions, define VOXDAG_READER_NO_EXCEPTIONS before including this header:
// errors then call voxdag_reader::error_handler and end the program.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "voxdag_reader_bytes.h"
#include "voxdag_reader_colors.h"

namespace voxdag_reader {

// One level of the DAG. The words belong to the File.
struct Level {
  const uint32_t* words = nullptr;
  uint64_t word_count = 0;
  uint64_t node_count = 0;   // nodes, or bricks on brick_level()
  uint64_t file_offset = 0;  // offset of the first word in the file, in bytes
  // Width of the offsets that point into this level: 32, or 64 for a large level.
  uint32_t pointer_bits = 32;
};

// A node of a level above the bricks. The words belong to the File.
struct Node {
  uint32_t child_mask = 0;
  // Word offsets of the children in the next level, in child order: one word each or, if `wide`,
  // two words each, low half first.
  const uint32_t* child_words = nullptr;
  bool wide = false;

  // Returns the word offset of the n-th existing child (from 0) in the next level.
  uint64_t child(int n) const {
    return wide ? child_words[2 * n] | static_cast<uint64_t>(child_words[2 * n + 1]) << 32
                : child_words[n];
  }
};

// Returns the XXH64 of `size` bytes, with seed 0.
inline uint64_t xxh64(const unsigned char* bytes, size_t size) {
  constexpr uint64_t p1 = 0x9e3779b185ebca87u, p2 = 0xc2b2ae3d27d4eb4fu, p3 = 0x165667b19e3779f9u,
                     p4 = 0x85ebca77c2b2ae63u, p5 = 0x27d4eb2f165667c5u;
  const auto rotate = [](uint64_t x, int r) { return x << r | x >> (64 - r); };
  const auto read = [](const unsigned char* from, size_t count) {
    uint64_t value = 0;
    std::memcpy(&value, from, count);
    return value;
  };
  const auto round = [&](uint64_t lane, uint64_t word) {
    return rotate(lane + word * p2, 31) * p1;
  };
  const unsigned char *at = bytes, *const end = bytes + size;
  uint64_t h = p5;
  if (size >= 32) {
    uint64_t lanes[4] = {p1 + p2, p2, 0, 0 - p1};
    for (; end - at >= 32; at += 32)
      for (int i = 0; i < 4; ++i) lanes[i] = round(lanes[i], read(at + 8 * i, 8));
    h = rotate(lanes[0], 1) + rotate(lanes[1], 7) + rotate(lanes[2], 12) + rotate(lanes[3], 18);
    for (const uint64_t lane : lanes) h = (h ^ round(0, lane)) * p1 + p4;
  }
  h += size;
  for (; end - at >= 8; at += 8) h = rotate(h ^ round(0, read(at, 8)), 27) * p1 + p4;
  if (end - at >= 4) {
    h = rotate(h ^ read(at, 4) * p1, 23) * p2 + p3;
    at += 4;
  }
  for (; at < end; ++at) h = rotate(h ^ *at * p5, 11) * p1;
  h = (h ^ h >> 33) * p2;
  h = (h ^ h >> 29) * p3;
  return h ^ h >> 32;
}

class File {
 public:
  // Throws Error if the file cannot be read, is not a global file, has an unsupported version, or
  // has a damaged header.
  explicit File(const std::string& path, Access access = Access::kMap)
      : File(path, std::make_shared<const Bytes>(path, access)) {}
  // Opens a file that is already in memory: `size` bytes at `data`, which must remain valid and
  // unchanged while the File exists. They are copied if `data` is not aligned to 8 bytes. Error
  // messages contain `name`.
  File(const void* data, uint64_t size, const std::string& name = "memory")
      : File(name, std::make_shared<const Bytes>(data, size)) {}
  // Opens a file whose Bytes the program has created itself, for example to prepare the mapping
  // before this constructor reads it. Error messages contain `path`.
  File(const std::string& path, std::shared_ptr<const Bytes> bytes)
      : path_(path), bytes_(std::move(bytes)) {
    read_header();
  }

  const std::string& path() const { return path_; }
  // Return the size of the file in bytes, and its bytes.
  uint64_t file_bytes() const { return bytes_->size(); }
  const unsigned char* data() const { return bytes_->data(); }
  // Drops the resident pages of a mapped file, for programs with little memory.
  void release_pages() const { bytes_->release_pages(); }
  // Returns the low corner of the grid in world space.
  const double (&origin() const)[3] { return origin_; }
  // Returns the edge length of the grid in world space. The edge length of a voxel is edge() /
  // resolution().
  double edge() const { return edge_; }
  // The resolution is 2^grid_levels() voxels per edge of the grid.
  uint32_t grid_levels() const { return grid_levels_; }
  int64_t resolution() const { return int64_t{1} << grid_levels_; }
  uint32_t brick_level() const { return grid_levels_ - 2; }
  // Returns the version of the format: 1, or 2 if the file has wide levels or attributes.
  uint32_t version() const { return version_; }
  // Return the number of bits of the node hash (4 to 64), and the order of the nodes in each level:
  // 1 is the order by hash, 2 is the order by first parent.
  uint32_t hash_bits() const { return hash_bits_; }
  uint32_t node_order() const { return get<uint32_t>(data() + 24); }
  // Return the numbers of set voxels, of nodes of the octree that the DAG represents, and of nodes
  // of the DAG. Bricks count as nodes.
  uint64_t voxels() const { return voxels_; }
  uint64_t svo_nodes() const { return svo_nodes_; }
  uint64_t dag_nodes() const { return dag_nodes_; }
  bool empty() const { return dag_nodes_ == 0; }
  // Returns level `l`, which is 0 (the root) to brick_level().
  const Level& level(uint32_t l) const { return levels_[l]; }
  // Returns the byte offset of the checksum table. The bytes between the header page (4096 bytes)
  // and the table are cut into checksum blocks of 64 KiB. The table has the XXH64 of each block.
  uint64_t checksum_table_offset() const { return table_offset_; }

  // Returns the mask of the 64 voxels of the brick at word `offset` of level brick_level(). Throws
  // Error if the offset is outside the level.
  uint64_t brick(uint64_t offset) const {
    const Level& bricks = levels_[brick_level()];
    if (bricks.word_count < 2 || offset > bricks.word_count - 2) outside(brick_level(), offset);
    return bricks.words[offset] | static_cast<uint64_t>(bricks.words[offset + 1]) << 32;
  }
  // Returns the node at word `offset` of level `l`. The level must be above the bricks. Throws
  // Error if no node can begin there.
  Node node(uint32_t l, uint64_t offset) const {
    const Level& nodes = levels_[l];
    if (offset >= nodes.word_count) outside(l, offset);
    const uint32_t mask = nodes.words[offset];
    const bool wide = levels_[l + 1].pointer_bits == 64;
    if (mask == 0 || mask > 255 ||
        static_cast<uint64_t>(count_set_bits(mask)) << wide >= nodes.word_count - offset)
      outside(l, offset);
    return {mask, nodes.words + offset + 1, wide};
  }
  // Returns the word offset of child `index` (0 to 7) in the next level. The child must exist.
  static uint64_t child(const Node& node, int index) {
    return node.child(count_set_bits(node.child_mask & ((1u << index) - 1)));
  }
  // Returns the number of a voxel's bit in the mask of its brick. Uses only the two low bits of
  // each coordinate.
  static int brick_bit(int64_t x, int64_t y, int64_t z) {
    return static_cast<int>((x & 2) << 4 | (y & 2) << 3 | (z & 2) << 2 | (x & 1) << 2 |
                            (y & 1) << 1 | (z & 1));
  }

  // True if a voxel is set. Voxels outside the grid are not set.
  bool voxel(int64_t x, int64_t y, int64_t z) const {
    const int64_t r = resolution();
    if (empty() || x < 0 || y < 0 || z < 0 || x >= r || y >= r || z >= r) return false;
    uint64_t offset = 0;
    for (uint32_t l = 0; l < brick_level(); ++l) {
      const int shift = static_cast<int>(grid_levels_ - 1 - l);
      const int index =
          static_cast<int>((x >> shift & 1) << 2 | (y >> shift & 1) << 1 | (z >> shift & 1));
      const Node n = node(l, offset);
      if (!(n.child_mask >> index & 1)) return false;
      offset = child(n, index);
    }
    return brick(offset) >> brick_bit(x, y, z) & 1;
  }

  // True if the cells of the levels 0 to color_levels() have colors. An empty scene has no colors.
  bool has_colors() const { return colors().tier_count() > 0; }
  uint32_t color_levels() const { return colors().color_levels(); }
  // Returns the section of an attribute. The section has no tiers if the file does not have this
  // attribute.
  const ColorSection& section(uint32_t kind) const { return sections_[kind - 1]; }
  const ColorSection& colors() const { return section(kColors); }
  const ColorSection& alphas() const { return section(kAlphas); }
  const ColorSection& normals() const { return section(kNormals); }
  const ColorSection& materials() const { return section(kMaterials); }
  // Returns the color of a cell of level `level`, 0 to grid_levels(). A level has 2^level cells
  // along each axis. For a level finer than color_levels(), returns the color of the cell's
  // ancestor at level color_levels(). Returns nullopt if the cell is not set or the file has no
  // colors. A ColorCursor is faster for many cells that are near each other.
  std::optional<Rgb> color(int64_t x, int64_t y, int64_t z, uint32_t level) const {
    return BasicColorCursor<File>(*this).color(x, y, z, level);
  }
  // alpha(), material() and normal() return the other attributes in the same way as color(). Alpha
  // is 0 to 255, linear.
  std::optional<unsigned char> alpha(int64_t x, int64_t y, int64_t z, uint32_t level) const {
    const auto value = BasicColorCursor<File>(*this, alphas()).value(x, y, z, level);
    return value ? std::optional(static_cast<unsigned char>(*value)) : std::nullopt;
  }
  std::optional<Normal> normal(int64_t x, int64_t y, int64_t z, uint32_t level) const {
    return BasicColorCursor<File>(*this, normals()).normal(x, y, z, level);
  }
  // Returns an index into material_names().
  std::optional<uint32_t> material(int64_t x, int64_t y, int64_t z, uint32_t level) const {
    const auto index = BasicColorCursor<File>(*this, materials()).value(x, y, z, level);
    if (index && *index >= material_names().size())
      broken_section(materials(), "value " + str(*index) + ", expected less than " +
                                      str(material_names().size()));
    return index;
  }
  const std::vector<std::string>& material_names() const { return materials().names(); }
  // Throws an Error about values that do not fit the DAG. Its message ends with `what`.
  [[noreturn]] void broken_section(const ColorSection& section, const std::string& what) const {
    corrupt(section.name() + (": " + what));
  }

  // Walks the octree depth first, children in child order, and calls
  //     bool visitor.node(level, x, y, z, offset)   returns false to skip the subtree
  //     void visitor.brick(x, y, z, mask, offset)
  // where x, y, z are the low corner in voxels and `offset` is the word offset in the level. Shared
  // nodes are visited once per occurrence.
  template <class Visitor>
  void walk(Visitor&& visitor) const {
    if (!empty()) walk_from(visitor, 0, 0, 0, 0, 0);
  }

  // Compares all checksum blocks with their checksums. Returns the byte offset of the first block
  // that differs, or 0 if all are intact.
  uint64_t first_damaged_block() const {
    const unsigned char* const table = data() + table_offset_;
    for (uint64_t block = 0; block < block_count(); ++block) {
      const uint64_t begin = kPageBytes + block * kChecksumBlockBytes;
      const uint64_t size = std::min<uint64_t>(kChecksumBlockBytes, table_offset_ - begin);
      if (xxh64(data() + begin, static_cast<size_t>(size)) != get<uint64_t>(table + 8 * block))
        return begin;
    }
    return 0;
  }
  // Throws Error if any checksum block differs from its checksum.
  void verify_checksums() const {
    if (const uint64_t block = first_damaged_block())
      corrupt("the block at byte " + std::to_string(block) + " fails its checksum");
  }

 private:
  static constexpr uint64_t kPageBytes = 4096, kChecksumBlockBytes = 65536;
  static constexpr uint32_t kMaxBrickLevel = 18;
  static constexpr uint64_t kWideLevels = 1, kAttributes = 2;  // feature bits

  static std::string str(uint64_t number) { return std::to_string(number); }
  uint64_t block_count() const { return (bytes_->size() - table_offset_) / 8; }

  [[noreturn]] void corrupt(const std::string& what) const {
    fail(Problem::kCorrupt, path_ + ": " + what);
  }
  [[noreturn]] void unsupported(const std::string& what) const {
    fail(Problem::kUnsupportedVersion, path_ + ": " + what);
  }
  [[noreturn]] void outside(uint32_t l, uint64_t offset) const {
    corrupt("level " + str(l) + ", word " + str(offset) + ": no node begins here");
  }
  void expect(bool right, const std::string& what) const {
    if (!right) corrupt("header: " + what);
  }

  template <class Visitor>
  void walk_from(Visitor& visitor, uint32_t l, uint64_t offset, int64_t x, int64_t y,
                 int64_t z) const {
    if (l == brick_level()) return static_cast<void>(visitor.brick(x, y, z, brick(offset), offset));
    const Node n = node(l, offset);
    if (!visitor.node(l, x, y, z, offset)) return;
    const int64_t half = resolution() >> (l + 1);
    int next = 0;
    for (int index = 0; index < 8; ++index)
      if (n.child_mask >> index & 1)
        walk_from(visitor, l + 1, n.child(next++), x + (index >> 2 & 1) * half,
                  y + (index >> 1 & 1) * half, z + (index & 1) * half);
  }

  void read_header() {
    const unsigned char* const page = data();
    static const unsigned char kMagic[8] = {0x89, 'V', 'D', 'A', 'G', '\n', 0x1a, '\n'};
    if (bytes_->size() < sizeof(kMagic) || std::memcmp(page, kMagic, sizeof(kMagic)) != 0)
      corrupt("not a voxdag file: expected the signature of a .vdag file in its first 8 bytes");
    if (bytes_->size() < kPageBytes) corrupt("the header is incomplete: expected 4096 bytes");
    version_ = get<uint32_t>(page + 8);
    if (version_ != 1 && version_ != 2)
      unsupported("format version " + str(version_) + ", expected 1 or 2");
    expect(xxh64(page, kPageBytes - 8) == get<uint64_t>(page + kPageBytes - 8),
           "fails its checksum");
    const uint64_t features = version_ == 1 ? 0 : get<uint64_t>(page + 2176);
    if (features & ~(kWideLevels | kAttributes))
      unsupported("feature bits " + str(features) +
                  ", expected at most 3: this reader knows only the bits 0 and 1");
    max_pointer_bits_ = features & kWideLevels ? 64 : 32;
    grid_levels_ = get<uint32_t>(page + 16);
    hash_bits_ = get<uint32_t>(page + 20);
    expect(
        get<uint32_t>(page + 12) == kPageBytes && get<uint32_t>(page + 28) == kChecksumBlockBytes,
        "the sizes of pages and checksum blocks are not known to this reader, expected 4096 and "
        "65536 bytes");
    expect(grid_levels_ >= 2 && grid_levels_ <= 20,
           "the resolution is 2^" + str(grid_levels_) + ", expected 2^2 to 2^20");
    expect(hash_bits_ >= 4 && hash_bits_ <= 64,
           "a hash has " + str(hash_bits_) + " bits, expected 4 to 64");
    std::memcpy(origin_, page + 32, sizeof(origin_));
    edge_ = get<double>(page + 56);
    expect(std::isfinite(origin_[0]) && std::isfinite(origin_[1]) && std::isfinite(origin_[2]) &&
               std::isfinite(edge_) && edge_ > 0,
           "the bounds of the grid, with the edge " + std::to_string(edge_) +
               ", are not valid, expected finite numbers and an edge above 0");
    voxels_ = get<uint64_t>(page + 64);
    svo_nodes_ = get<uint64_t>(page + 72);
    dag_nodes_ = get<uint64_t>(page + 80);
    if (get<uint64_t>(page + 88) != bytes_->size())
      corrupt("the file has " + str(bytes_->size()) + " bytes, expected " +
              str(get<uint64_t>(page + 88)));
    read_levels(page);
    if (features & kAttributes) read_attributes(page);
    read_table(page);
  }

  // Reads the level entries of the header. Levels follow one another, the bricks first. Each begins
  // at the start of a page.
  void read_levels(const unsigned char* page) {
    uint64_t end = kPageBytes, nodes = 0;
    for (uint32_t l = brick_level() + 1; l-- > 0;) {
      const std::string where = "level " + str(l) + ": ";
      const unsigned char* const entry = page + 128 + 32 * l;
      Level& level = levels_[l];
      level.file_offset = get<uint64_t>(entry);
      level.node_count = get<uint64_t>(entry + 8);
      level.word_count = get<uint64_t>(entry + 16);
      level.words = reinterpret_cast<const uint32_t*>(data() + kPageBytes);
      if (dag_nodes_ == 0) {
        expect(level.file_offset == 0 && level.node_count == 0 && level.word_count == 0,
               where + str(level.node_count) + " nodes, expected none, because the scene is empty");
        continue;
      }
      expect(level.file_offset == end,
             where + "begins at byte " + str(level.file_offset) + ", expected " + str(end));
      if (version_ != 1) level.pointer_bits = get<uint32_t>(entry + 24);
      const uint32_t bits = level.pointer_bits, limit_bits = bits == 32 ? 32 : 40;
      expect(bits == 32 || bits == max_pointer_bits_,
             where + "pointers of " + str(bits) + " bits, expected 32" +
                 (max_pointer_bits_ == 64 ? " or 64" : ""));
      expect(level.word_count <= uint64_t{1} << limit_bits,
             where + str(level.word_count) + " words, expected at most 2^" + str(limit_bits) +
                 " with pointers of " + str(bits) + " bits");
      expect(4 * level.word_count <= bytes_->size() - end, where + "ends beyond the file");
      expect(level.node_count > 0 && level.node_count <= level.word_count / 2,
             where + str(level.node_count) + " nodes in " + str(level.word_count) +
                 " words, expected at least one node and at least two words per node");
      level.words = reinterpret_cast<const uint32_t*>(data() + level.file_offset);
      nodes += level.node_count;
      end = (end + 4 * level.word_count + kPageBytes - 1) / kPageBytes * kPageBytes;
      expect(end <= bytes_->size(), where + "ends beyond the file");
    }
    expect(nodes == dag_nodes_,
           "the levels have " + str(nodes) + " nodes, expected " + str(dag_nodes_));
    table_offset_ = end;
  }

  // Reads the attribute table of the header. Sections follow the levels, in the order of their
  // kinds. Sections of unknown kinds are skipped.
  void read_attributes(const unsigned char* page) {
    const uint64_t count = get<uint64_t>(page + 120);
    expect(count >= 1 && count <= 16, str(count) + " attribute sections, expected 1 to 16");
    expect(dag_nodes_ > 0,
           "the file has attribute sections, expected none, because the scene is empty");
    uint32_t last_kind = 0;
    for (uint64_t i = 0; i < count; ++i) {
      const unsigned char* const entry = page + 1152 + 64 * i;
      const uint32_t kind = get<uint32_t>(entry), levels = get<uint32_t>(entry + 4);
      const uint64_t at = get<uint64_t>(entry + 8), bytes = get<uint64_t>(entry + 16);
      const std::string where = "attribute section " + str(i) + ": ";
      expect(kind > last_kind, where + "kind " + str(kind) + ", expected over " + str(last_kind));
      expect(at == table_offset_,
             where + "begins at byte " + str(at) + ", expected " + str(table_offset_));
      expect(bytes > 0 && bytes <= bytes_->size() - table_offset_, where + "ends beyond the file");
      expect(levels >= 2 && levels <= grid_levels_,
             where + "level " + str(levels) + ", expected 2 to " + str(grid_levels_));
      if (kind < kEndOfKinds)
        if (const char* const wrong = sections_[kind - 1].open(
                data() + table_offset_, bytes, levels, kind, get<uint32_t>(entry + 40)))
          expect(false, where + wrong);
      table_offset_ = (table_offset_ + bytes + kPageBytes - 1) / kPageBytes * kPageBytes;
      expect(table_offset_ <= bytes_->size(), where + "ends beyond the file");
      last_kind = kind;
    }
  }

  void read_table(const unsigned char* page) const {
    const uint64_t blocks =
        (table_offset_ - kPageBytes + kChecksumBlockBytes - 1) / kChecksumBlockBytes;
    const uint64_t begin = get<uint64_t>(page + 96), count = get<uint64_t>(page + 104);
    expect(begin == table_offset_,
           "the checksum table begins at byte " + str(begin) + ", expected " + str(table_offset_));
    expect(count == blocks,
           "the file has " + str(count) + " checksum blocks, expected " + str(blocks));
    const uint64_t bytes = bytes_->size() - table_offset_;
    expect(bytes == 8 * blocks,
           "the checksum table has " + str(bytes) + " bytes, expected " + str(8 * blocks));
    expect(xxh64(data() + table_offset_, static_cast<size_t>(bytes)) == get<uint64_t>(page + 112),
           "the checksum table fails its own checksum");
  }

  const std::string path_;
  const std::shared_ptr<const Bytes> bytes_;
  double origin_[3] = {};
  double edge_ = 0;
  uint32_t version_ = 0, max_pointer_bits_ = 32, grid_levels_ = 0, hash_bits_ = 0;
  uint64_t voxels_ = 0, svo_nodes_ = 0, dag_nodes_ = 0, table_offset_ = 0;
  Level levels_[kMaxBrickLevel + 1];
  ColorSection sections_[kEndOfKinds - 1];  // the section of a kind is at index kind - 1
};

// Looks up colors; see voxdag_reader_colors.h.
using ColorCursor = BasicColorCursor<File>;

}  // namespace voxdag_reader
