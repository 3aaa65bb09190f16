#include "scheduler/stages/rows/rows_stage.h"

#include <algorithm>
#include <array>
#include <map>
#include <mutex>

#include "core/backend/for_each_triangle.h"
#include "core/base/parallel_for.h"
#include "core/geometry/morton.h"
#include "scheduler/solid/row_sums.h"
#include "scheduler/stages/rows/empty_cubes.h"
#include "scheduler/stages/rows/row_column.h"

namespace voxdag {
namespace {

// A subvolume, and its row sums (RowSums) in the temporary file, one extent for each axis.
struct SumsOfCube {
  Cube cube;
  bool is_occupied = false;
  RowExtent numbers[3];
};

// A corner of an empty cube. A column computes the view from this corner.
struct EmptyCorner {
  size_t empty;  // index of the cube in empty_
  int corner;
};

// A column of subvolumes along an axis: the subvolumes whose squares (row_column.h) are in the
// square of the cube `square`.
struct Column {
  int axis = 0;
  Cube square;
  std::vector<size_t> members;  // indexes of subvolumes
  std::vector<EmptyCorner> corners;
  struct Outside {
    int first, second;
    const OutsideTile* tile;
  };
  std::vector<Outside> outside;  // tiles whose rows have crossings outside the grid
};

class RowsStage {
 public:
  RowsStage(SolidRows& rows, std::span<const PlannedCube> cubes, const TriangleStore& triangles,
            const OutsideRows* outside, const std::string& spill_path, const StageContext& context)
      : rows_(rows),
        grid_(rows.grid_levels()),
        cubes_(cubes),
        triangles_(triangles),
        outside_(outside),
        context_(context),
        sums_file_(context.build.files, spill_path, 0),
        sums_(cubes.size()),
        added_(cubes.size()) {}

  void run() {
    rows_.start();
    context_.build.progress.begin_stage("rows", cubes_.size(), "subvolumes");
    sum_all();
    find_empty_cubes();
    find_columns();
    if (outside_ != nullptr) count_outside();
    walk_all();
    for (size_t i = 0; i < cubes_.size(); ++i) rows_.add(cubes_[i].cube, added_[i]);
    decide_empty_cubes();
    rows_.save();
    context_.build.progress.end_stage();
  }

 private:
  // Returns the number of threads for `items` items if each thread needs `bytes` of memory. All
  // threads together use at most half of the free memory.
  unsigned threads_for(uint64_t bytes, size_t items) const {
    const uint64_t fit = context_.budget.available() / 2 / std::max<uint64_t>(bytes, 1);
    return static_cast<unsigned>(
        std::clamp<uint64_t>(std::min<uint64_t>(fit, items), 1, std::max(context_.threads, 1u)));
  }
  uint64_t max_row_bytes() const {
    uint64_t bytes = 0;
    for (const PlannedCube& planned : cubes_)
      bytes = std::max(bytes, row_bytes(planned.cube, rows_.grid_levels()));
    return bytes;
  }

  void sum_all() {
    parallel_for(threads_for(max_row_bytes(), cubes_.size()), cubes_.size(),
                 [&](unsigned, size_t i) {
                   sum(i);
                   const std::lock_guard lock(mutex_);
                   context_.build.progress.advance(1);
                 });
  }

  void sum(size_t i) {
    const Cube& cube = cubes_[i].cube;
    RowSums sums(cube, rows_.grid_levels(), context_.budget);
    const auto stream = triangles_.open(cubes_[i].bin);
    for_each_triangle(*stream, context_.build.cancel,
                      [&](const FixedTriangle& triangle) { sums.add(triangle); });
    sums_[i] = {cube, sums.is_occupied(), {}};
    for (int a = 0; a < 3; ++a) sums_[i].numbers[a] = sums_file_.append_rows(sums.numbers(a));
  }

  void find_empty_cubes() {
    std::vector<Cube> occupied;
    for (size_t i = 0; i < sums_.size(); ++i) {
      added_[i].unit = sums_[i].is_occupied ? SolidUnit::kShell : SolidUnit::kEmpty;
      if (sums_[i].is_occupied) occupied.push_back(sums_[i].cube);
    }
    empty_ = maximal_empty_cubes(occupied);
    empty_views_.assign(empty_.size(), 0);
  }

  // The square of a cube seen along an axis.
  using Square = std::array<uint32_t, 3>;  // level, position along the first and second axis
  static Square square_of(const Cube& cube, int axis) {
    return {cube.level, cube.position[first_row_axis(axis)], cube.position[second_row_axis(axis)]};
  }
  // Returns the value of the largest square in `known` that contains `square`; null if none does.
  static const size_t* largest(const std::map<Square, size_t>& known, const Square& square) {
    for (uint32_t level = 0; level <= square[0]; ++level) {
      const uint32_t up = square[0] - level;
      const auto found = known.find({level, square[1] >> up, square[2] >> up});
      if (found != known.end()) return &found->second;
    }
    return nullptr;
  }

  void find_columns() {
    for (int a = 0; a < 3; ++a) {
      std::map<Square, size_t> known;  // index of the column that has this square
      std::vector<size_t> by_level(cubes_.size());
      for (size_t i = 0; i < by_level.size(); ++i) by_level[i] = i;
      std::stable_sort(by_level.begin(), by_level.end(), [&](size_t i, size_t j) {
        return cubes_[i].cube.level < cubes_[j].cube.level;
      });
      for (const size_t i : by_level) {
        const Square square = square_of(cubes_[i].cube, a);
        const size_t* column = largest(known, square);
        if (column == nullptr) {
          column = &known.emplace(square, columns_.size()).first->second;
          columns_.push_back({a, cubes_[i].cube, {}, {}, {}});
        }
        columns_[*column].members.push_back(i);
      }
      for (size_t e = 0; e < empty_.size(); ++e)
        for (int c = 0; c < 8; ++c)
          if (const size_t* column = largest(known, tile_at(empty_[e], c, a)))
            columns_[*column].corners.push_back({e, c});
          else if (outside_ != nullptr)
            add_outside_view(e, c, a);
      known_[a] = std::move(known);
    }
  }
  // Adds the view from corner `c` of an empty cube along `axis`. No column has the corner's row, so
  // the row has crossings only outside the grid.
  void add_outside_view(size_t e, int c, int axis) {
    const Square tile = tile_at(empty_[e], c, axis);
    const OutsideTile* outside =
        outside_->find(axis, static_cast<int>(tile[1]), static_cast<int>(tile[2]));
    if (outside == nullptr) return;
    const int row = (RowColumn::kRows * child_coordinate(c, first_row_axis(axis)) +
                     child_coordinate(c, second_row_axis(axis))) *
                    grid_.blocks;
    empty_views_[e] += view_of(rows_.rule(), outside->before[row], row_sum(outside->total[row]));
  }
  // Assigns tiles with crossings outside the grid to their columns. Counts the rows of tiles that
  // are in no column.
  void count_outside() {
    outside_->for_each([&](int axis, int first, int second, const OutsideTile& tile) {
      const Square square{grid_.levels, static_cast<uint32_t>(first),
                          static_cast<uint32_t>(second)};
      if (const size_t* column = largest(known_[axis], square))
        columns_[*column].outside.push_back({first, second, &tile});
      else
        RowColumn::count_tile(
            grid_, first, second, [&](int row) { return tile.total[row]; }, rows_.counts);
    });
  }
  // Returns the square of the tile in corner `c` of a cube.
  Square tile_at(const Cube& cube, int c, int axis) const {
    const auto position = [&](int along) {
      return static_cast<uint32_t>(grid_.low(cube, along) +
                                   child_coordinate(c, along) * (grid_.tiles_along(cube) - 1));
    };
    return {grid_.levels, position(first_row_axis(axis)), position(second_row_axis(axis))};
  }

  void walk_all() {
    uint64_t bytes = 0;
    for (const Column& column : columns_)
      bytes = std::max(bytes, RowColumn::bytes(grid_, column.square));
    parallel_for(threads_for(bytes + max_row_bytes(), columns_.size()), columns_.size(),
                 [&](unsigned, size_t i) { walk(columns_[i]); });
  }

  uint64_t morton_of(const Cube& cube) const {
    return morton_encode(static_cast<uint32_t>(grid_.low(cube, 0)),
                         static_cast<uint32_t>(grid_.low(cube, 1)),
                         static_cast<uint32_t>(grid_.low(cube, 2)));
  }

  void walk(Column& column) {
    RowColumn state(grid_, rows_.rule(), column.axis, column.square, context_.budget);
    const MemoryCharge charge(context_.budget,
                              row_bytes(column.square, rows_.grid_levels()) / 3 * 2,
                              "the sample rows of a solid");
    std::vector<int32_t> numbers, views;
    const auto read = [&](size_t i) {
      numbers.resize(rows_per_axis(cubes_[i].cube, rows_.grid_levels()));
      sums_file_.read_rows(sums_[i].numbers[column.axis], numbers);
    };
    for (const size_t i : column.members) {
      context_.build.cancel.check();
      read(i);
      state.add_total(cubes_[i].cube, numbers);
    }
    for (const Column::Outside& outside : column.outside)
      state.add_outside(outside.first, outside.second, *outside.tile);
    {
      const std::lock_guard lock(mutex_);
      state.count(rows_.counts);
    }
    state.begin();
    std::sort(column.members.begin(), column.members.end(), [&](size_t i, size_t j) {
      return morton_of(cubes_[i].cube) < morton_of(cubes_[j].cube);
    });
    std::sort(column.corners.begin(), column.corners.end(),
              [&](const EmptyCorner& x, const EmptyCorner& y) {
                return morton_of(empty_[x.empty]) < morton_of(empty_[y.empty]);
              });
    size_t next_corner = 0;
    const auto pass_corners = [&](uint64_t end) {
      for (; next_corner < column.corners.size(); ++next_corner) {
        const EmptyCorner& corner = column.corners[next_corner];
        if (morton_of(empty_[corner.empty]) >= end) return;
        const int32_t view = state.corner(empty_[corner.empty], corner.corner);
        const std::lock_guard lock(mutex_);
        empty_views_[corner.empty] += view;
      }
    };
    for (const size_t i : column.members) {
      context_.build.cancel.check();
      pass_corners(morton_of(cubes_[i].cube));
      read(i);
      views.resize(numbers.size());
      state.entry(cubes_[i].cube, views);
      added_[i].views[column.axis] = rows_.file().append_rows(views);
      state.advance(cubes_[i].cube, numbers);
    }
    pass_corners(UINT64_MAX);
  }

  void decide_empty_cubes() {
    for (size_t e = 0; e < empty_.size(); ++e) {
      const UnitViews unit{empty_views_[e], 8};
      if (unit.is_inside()) rows_.full_cubes.push_back({empty_[e], unit.is_disputed()});
    }
  }

  SolidRows& rows_;
  const TileGrid grid_;
  const std::span<const PlannedCube> cubes_;
  const TriangleStore& triangles_;
  const OutsideRows* const outside_;
  const StageContext& context_;
  RowFile sums_file_;
  std::vector<SumsOfCube> sums_;
  std::vector<SubvolumeRows> added_;
  std::vector<Cube> empty_;
  std::vector<int64_t> empty_views_;
  std::vector<Column> columns_;
  std::map<Square, size_t> known_[3];  // for each axis, the columns by their squares
  std::mutex mutex_;
};

}  // namespace

void compute_rows(SolidRows& rows, std::span<const PlannedCube> cubes,
                  const TriangleStore& triangles, const OutsideRows* outside,
                  const std::string& spill_path, const StageContext& context) {
  RowsStage(rows, cubes, triangles, outside, spill_path, context).run();
  context.build.files.remove(spill_path);
}

}  // namespace voxdag
