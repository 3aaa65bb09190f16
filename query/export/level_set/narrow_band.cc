#include "query/export/level_set/narrow_band.h"

namespace voxdag::query {
namespace {

// Finds out whether a box has set cells and whether it has empty cells.
class BoxContents {
 public:
  BoxContents(const DagView& dag, uint32_t grid_levels, const Region& box)
      : dag_(dag),
        levels_(grid_levels),
        in_grid_(cut_to_grid(box, grid_levels)),
        has_empty_(in_grid_ != box || dag.empty()) {}

  BandTile::Contents find() {
    if (!dag_.empty() && !in_grid_.empty()) enter(0, {0, 0, 0}, dag_.root());
    if (!has_set_) return BandTile::Contents::kEmpty;
    return has_empty_ ? BandTile::Contents::kMixed : BandTile::Contents::kFull;
  }

 private:
  void enter(uint32_t depth, const Position& low, uint64_t content) {
    const int64_t edge = int64_t{1} << (levels_ - depth);
    if (has_set_ && has_empty_) return;
    if (depth + kBrickLevels == levels_)
      return read_brick(low, brick_of_cells(dag_, depth, content));
    if (is_full(dag_, depth, content, levels_)) {
      has_set_ = true;
      return;
    }
    // A cube that is completely in the box and is not full has cells of both kinds.
    if (in_grid_.contains(low, edge)) {
      has_set_ = has_empty_ = true;
      return;
    }
    const DagView::Children children = dag_.children(depth, content);
    for (int i = 0; i < 8; ++i) {
      const Position corner = child_corner(low, i, edge / 2);
      if (!in_grid_.intersects(corner, edge / 2)) continue;
      if (children.has(i))
        enter(depth + 1, corner, dag_.content(depth, children, i));
      else
        has_empty_ = true;
    }
  }

  void read_brick(const Position& low, uint64_t mask) {
    const uint64_t wanted =
        in_grid_.contains(low, kBrickEdge) ? ~uint64_t{0} : mask_within(in_grid_, low);
    has_set_ = has_set_ || (mask & wanted) != 0;
    has_empty_ = has_empty_ || (~mask & wanted) != 0;
  }

  const DagView& dag_;
  const uint32_t levels_;
  const Region in_grid_;  // the part of the box inside the grid
  bool has_set_ = false, has_empty_;
};

// Returns max(2 |d| - 1, 0)^2: a cell's part of (2 distance)^2 along one axis.
int square_of_gap(int64_t d) {
  const auto gap = static_cast<int>(std::max<int64_t>(2 * (d < 0 ? -d : d) - 1, 0));
  return gap * gap;
}

// Computes the part of (2 distance)^2 along one axis. `from` has `outer` blocks of (8 + 2 width)
// rows of `row` numbers, and a step along the axis is one row. `to` has the 8 middle rows of each
// block. Each number in `to` is the minimum, for all d from -width to width, of square_of_gap(d)
// plus the number in `from` that is d rows away.
void min_along(const std::vector<uint16_t>& from, size_t outer, size_t row, int width,
               std::vector<uint16_t>& to) {
  const auto rows = static_cast<size_t>(kBandLeafEdge + 2 * width);
  for (size_t block = 0; block < outer; ++block)
    for (size_t i = 0; i < kBandLeafEdge; ++i) {
      uint16_t* const out = to.data() + (block * kBandLeafEdge + i) * row;
      std::fill_n(out, row, UINT16_MAX);
      for (int step = 0; step <= 2 * width; ++step) {
        const auto square = static_cast<uint16_t>(square_of_gap(step - width));
        const uint16_t* const in =
            from.data() + (block * rows + i + static_cast<size_t>(step)) * row;
        for (size_t j = 0; j < row; ++j)
          out[j] = std::min(out[j], static_cast<uint16_t>(in[j] + square));
      }
    }
}

}  // namespace

Region band_domain(const Selection& selection, int width) {
  const int64_t edge = int64_t{1} << selection.grid_levels;
  Region domain = cut_to_grid(selection.region, selection.grid_levels);
  for (size_t a = 0; a < 3; ++a) {
    if (domain.low[a] == 0) domain.low[a] = -width;
    if (domain.high[a] == edge) domain.high[a] = edge + width;
  }
  return domain;
}

BandTile::Contents contents_of(const DagView& dag, uint32_t grid_levels, const Region& box) {
  return BoxContents(dag, grid_levels, box).find();
}

bool has_band(const DagView& dag, const Selection& selection, int width) {
  Region box = selection.region;
  for (size_t a = 0; a < 3; ++a) {
    box.low[a] -= width;
    box.high[a] += width;
  }
  return contents_of(dag, selection.grid_levels, box) != BandTile::Contents::kEmpty;
}

BandTile::BandTile(int64_t edge, int width)
    : edge_(edge),
      width_(width),
      side_(edge + 2 * width),
      is_set_(static_cast<size_t>(side_ * side_ * side_)) {
  const auto window = static_cast<size_t>(kBandLeafEdge + 2 * width);
  from_.resize(window * window * window);
  to_.resize(from_.size());
}

void BandTile::read(const DagView& dag, uint32_t grid_levels, const Position& low) {
  std::fill(is_set_.begin(), is_set_.end(), uint8_t{0});
  Position corner = low;
  for (int64_t& c : corner) c -= width_;
  const Region box{corner, {corner[0] + side_, corner[1] + side_, corner[2] + side_}};
  for_each_brick(dag, {grid_levels, box}, [&](const Brick& brick) {
    for_each_cell_of(brick, [&](const Position& cell) {
      is_set_[index({cell[0] - corner[0], cell[1] - corner[1], cell[2] - corner[2]})] = 1;
    });
  });
}

BandTile::Contents BandTile::contents(const Position& at) const {
  const int64_t window = kBandLeafEdge + 2 * width_;
  int64_t set = 0;
  for (int64_t x = 0; x < window; ++x)
    for (int64_t y = 0; y < window; ++y) {
      const uint8_t* const row = is_set_.data() + index({at[0] + x, at[1] + y, at[2]});
      for (int64_t z = 0; z < window; ++z) set += row[z];
    }
  if (set == 0) return Contents::kEmpty;
  return set == window * window * window ? Contents::kFull : Contents::kMixed;
}

void BandTile::distances(const Position& at, BandSquares& out) {
  BandSquares to_empty;
  distances_to(true, at, out);
  distances_to(false, at, to_empty);
  for (size_t i = 0; i < out.size(); ++i)
    if (out[i] == 0) out[i] = static_cast<int16_t>(-to_empty[i]);
}

// Computes (2 distance)^2 from each cell of a leaf to the nearest set cell if `is_set` is true,
// otherwise to the nearest empty cell. The result is 0 for a cell that is itself of this kind.
void BandTile::distances_to(bool is_set, const Position& at, BandSquares& out) {
  const auto limit = static_cast<uint16_t>(4 * width_ * width_);
  const auto window = static_cast<size_t>(kBandLeafEdge + 2 * width_);
  const auto n = static_cast<size_t>(kBandLeafEdge);
  size_t i = 0;
  // The window's axes are stored in the order z, y, x. Each of the three calls of min_along() below
  // steps along one axis: first z, then y, then x.
  for (size_t z = 0; z < window; ++z)
    for (size_t y = 0; y < window; ++y)
      for (size_t x = 0; x < window; ++x, ++i) {
        const Position cell = {at[0] + static_cast<int64_t>(x), at[1] + static_cast<int64_t>(y),
                               at[2] + static_cast<int64_t>(z)};
        from_[i] = (is_set_[index(cell)] != 0) == is_set ? 0 : limit;
      }
  min_along(from_, 1, window * window, width_, to_);  // z
  min_along(to_, n, window, width_, from_);           // y
  min_along(from_, n * n, 1, width_, to_);            // x
  for (size_t x = 0; x < n; ++x)
    for (size_t y = 0; y < n; ++y)
      for (size_t z = 0; z < n; ++z)
        out[(x * n + y) * n + z] = static_cast<int16_t>(std::min(to_[(z * n + y) * n + x], limit));
}

bool has_inside(const DagView& dag, const CancelToken& cancel) {
  // (2 distance)^2 of a cell whose nearest empty cell is a neighbor across a corner. Cells with a
  // larger number have only set cells around them.
  constexpr int kFarthest = 3, kWidth = 2;
  bool found = false;
  BandSquares squares;
  for_each_band_part(
      dag, {dag.grid_levels(), whole_grid(dag.grid_levels())}, kWidth,
      [&](const Position&, const Position& at, BandTile& tile) {
        cancel.check();
        tile.distances(at, squares);
        found = std::ranges::any_of(squares, [](int16_t square) { return square < -kFarthest; });
        return !found;
      },
      [&](const Position&, int64_t) { return !(found = true); });
  return found;
}

}  // namespace voxdag::query
