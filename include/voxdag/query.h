// Queries of a finished .vdag file: points, attributes, rays, boxes, counts, neighbors and tiles.
//
//     voxdag::query::DagFile dag("scene.vdag");
//     std::vector<voxdag::query::Position> points = {{1, 2, 3}, {4, 5, 6}};
//     std::vector<uint8_t> set(points.size());
//     dag.lookup(points, dag.grid_levels(), set);
//
// The file is mapped, not read. A batch function takes any number of items in one call, works on up
// to `threads` threads including the caller's, and allocates nothing per item. The results do not
// depend on the threads. All spans of a call of a batch function have the same length.
//
// All functions are const and thread-safe. They throw Error{kInvalidInput} for invalid arguments,
// and Error{kCorrupt} that names the file if the bytes they read are damaged. They check the
// offsets that they follow, but not the checksums (`voxdag verify` does). docs/library.md describes
// conventions and units.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "voxdag/cells.h"
#include "voxdag/error.h"

namespace voxdag_reader {
class File;
}

namespace voxdag::query {

// Three coordinates in voxels. The grid is the cube [0, R]^3, with R = DagFile::resolution().
using Coordinates = std::array<double, 3>;

// Red, green and blue in sRGB, and alpha. Alpha is 255 for a color, 0 if the cell has no color.
using Rgba = std::array<uint8_t, 4>;

// The normal of a cell: a unit vector, or zeros if the cell is not set.
using Normal = std::array<float, 3>;

inline constexpr uint32_t kNoMaterial = UINT32_MAX;

struct RayLimits {
  double max_distance = std::numeric_limits<double>::infinity();  // in voxels
  // A ray ends at the first set cell with an edge of at most `stop_size` voxels, and hits this cell
  // as one solid cube. With values below 2, rays end at voxels.
  double stop_size = 0;
};

struct RayHit {
  double distance = 0;       // in voxels, from the ray's origin to the face that it entered
  Position cell{};           // in the grid of 2^grid_levels cells per edge
  uint32_t grid_levels = 0;  // levels of the cell's grid
  // The normal of the face by which the ray entered: axis 0, 1, 2 for x, y, z, and sign 1 or -1. A
  // ray that begins in the cell has distance 0 and no face: axis -1 and sign 0.
  int8_t axis = -1;
  int8_t sign = 0;
  bool hit = false;  // if false, the other members have no meaning
};

struct Nearest {
  Position cell{};
  uint64_t squared_distance = 0;  // squared distance between cell centers, in cells
  bool found = false;
};

// Maximum magnitude of the coordinates of points for nearest(), in cells. Within this limit,
// squares of distances fit in 64 bits.
inline constexpr int64_t kMaxCoordinate = int64_t{1} << 30;

class DagFile {
 public:
  // Default memory limit for the node counts that count() stores, in bytes.
  static constexpr uint64_t kDefaultMemory = uint64_t{1} << 30;

  // Opens and maps the file, which must not be shortened while it is open. The node counts that
  // count() stores take at most `memory_bytes`. Throws Error{kNotFound}, Error{kIo},
  // Error{kUnsupportedVersion}, or Error{kCorrupt} for a damaged header.
  explicit DagFile(const std::string& path, uint64_t memory_bytes = kDefaultMemory);
  // Opens a file that is already in memory: `size` bytes at `data`, which must remain valid and
  // unchanged while the DagFile exists. They are copied if `data` is not aligned to 8 bytes. Throws
  // Error{kUnsupportedVersion} or Error{kCorrupt}; messages call the file "memory".
  DagFile(const void* data, uint64_t size, uint64_t memory_bytes = kDefaultMemory);
  ~DagFile();
  DagFile(DagFile&&) noexcept;
  DagFile& operator=(DagFile&&) noexcept;

  // The grid of the file has 2^grid_levels() voxels per edge.
  uint32_t grid_levels() const;
  int64_t resolution() const { return int64_t{1} << grid_levels(); }
  // The low corner of the grid and the length of its edge, in the units of the scene.
  Coordinates origin() const;
  double edge() const;
  uint64_t voxels() const;     // set voxels
  uint64_t svo_nodes() const;  // nodes of the octree without sharing, including bricks
  uint64_t dag_nodes() const;  // nodes of the DAG, including bricks
  uint64_t file_bytes() const;

  // Sets set[i] to 1 if cell points[i] is set; to 0 if it is not set or outside the grid. The grid
  // has 2^grid_levels cells per edge. All functions below use `grid_levels` in the same way.
  void lookup(std::span<const Position> points, uint32_t grid_levels, std::span<uint8_t> set,
              unsigned threads = 1) const;

  // Attributes of cells. The grids of up to 2^color_levels() cells per edge have their own values;
  // a finer cell has the value of the cell that contains it. The file of an empty scene has no
  // attributes. Lookups are faster if each position is near the previous position in the same call.
  // Throws Error{kInvalidInput} for an attribute that the file does not have.
  uint32_t color_levels() const;
  bool has_colors() const;
  bool has_alphas() const;
  bool has_normals() const;
  bool has_materials() const;
  // Sets colors[i] to the color of cell points[i]; to zeros if the cell is not set.
  void colors(std::span<const Position> points, uint32_t grid_levels, std::span<Rgba> colors,
              unsigned threads = 1) const;
  // Sets alphas[i] to the alpha of cell points[i], linear, 0 to 255; to 0 if the cell is not set.
  void alphas(std::span<const Position> points, uint32_t grid_levels, std::span<uint8_t> alphas,
              unsigned threads = 1) const;
  // Sets normals[i] to the normal of cell points[i]; to zeros if the cell is not set.
  void normals(std::span<const Position> points, uint32_t grid_levels, std::span<Normal> normals,
               unsigned threads = 1) const;
  // Sets materials[i] to an index into material_names(); to kNoMaterial if cell points[i] is not
  // set.
  void materials(std::span<const Position> points, uint32_t grid_levels,
                 std::span<uint32_t> materials, unsigned threads = 1) const;
  // Returns the names of the materials. The last name is "", for triangles without a material. The
  // list is empty if the file has no materials.
  const std::vector<std::string>& material_names() const;

  // Finds the first set cell on each ray. Directions may have any length except 0. Origins and
  // directions must be finite, and limits must not be negative. A cell includes its faces, so no
  // ray passes between two cells that share a face. A ray is faster if it is close to the previous
  // ray, such as the ray of a neighboring pixel.
  void rays(std::span<const Coordinates> origins, std::span<const Coordinates> directions,
            const RayLimits& limits, std::span<RayHit> hits, unsigned threads = 1) const;
  // Sets occluded[i] to 1 if a set cell is on ray i within the limits, so if rays() would find a
  // hit; else to 0. Arguments are the same as for rays(). Faster than rays(), for example for
  // shadows and lines of sight.
  void occluded(std::span<const Coordinates> origins, std::span<const Coordinates> directions,
                const RayLimits& limits, std::span<uint8_t> occluded, unsigned threads = 1) const;

  // Writes the region as a dense array, with 1 for each set cell and 0 for all others. Cell p is at
  // index ((p.x - low.x) * ny + p.y - low.y) * nz + p.z - low.z, where ny and nz are the region's
  // numbers of cells along y and z. The size of `cells` must be the region's number of cells.
  void box(const Selection& selection, std::span<uint8_t> cells) const;

  // Stores the set cells of the region, in Morton order, up to the size of `positions`. Returns the
  // number of set cells in the region.
  uint64_t positions(const Selection& selection, std::span<Position> positions) const;

  // Calls `visit` for each brick with set cells in the region, in Morton order. Masks are clipped
  // to the region.
  void bricks(const Selection& selection, const std::function<void(const Brick&)>& visit) const;

  // Returns the number of set cells in the region. The first call for a grid reads every node of
  // the grid's levels once, and stores a count for each node. If the counts do not fit in the
  // memory limit of the constructor, no counts are stored, and each call visits all nodes in its
  // region.
  uint64_t count(const Selection& selection) const;

  // Finds the nearest set cell for each point. Distances are measured between cell centers, and the
  // cell is at most `max_distance` cells away. Of several equally near cells, the result is the
  // first in Morton order. Points may be outside the grid, with coordinates of at most
  // kMaxCoordinate.
  void nearest(std::span<const Position> points, uint32_t grid_levels, double max_distance,
               std::span<Nearest> cells, unsigned threads = 1) const;

  // Returns the cell that contains a point of the scene's space. The cell can be outside the grid,
  // at most 2^62 cells away. A point within rounding error of a cell boundary counts as on the
  // boundary, so it is in the cell above the boundary.
  Position world_to_cell(const Coordinates& world, uint32_t grid_levels) const;
  // Returns the cells that the half-open box low <= p < high overlaps. `low` and `high` are in the
  // units of the scene. An infinite coordinate stands for the border of the grid.
  Region world_to_region(const Coordinates& low, const Coordinates& high,
                         uint32_t grid_levels) const;

  // Returns a tile, which viewers draw, in the format of docs/format.md, "Tiles". `level` and
  // `offset` are the level of the tile's root node and the node's word offset in this level. The
  // root of the DAG is at level 0, offset 0. `tile_levels` is the maximum number of levels in a
  // tile, from 1 to 5. A tile contains the offsets of the tiles below it. Throws Error{kNotFound}
  // if no node can be at `offset`.
  std::vector<uint32_t> tile(uint32_t tile_levels, uint32_t level, uint64_t offset) const;

  // Returns the open file, for use with voxdag_reader.h. It is valid as long as this object exists.
  const voxdag_reader::File& file() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace voxdag::query
