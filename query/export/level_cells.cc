#include "query/export/level_cells.h"

#include <bit>
#include <string>
#include <utility>

#include "core/dag/brick.h"

namespace voxdag::query {

LevelCells::Level LevelCells::level(uint32_t depth) const {
  const voxdag_reader::Level& nodes = file_.level(depth);
  const bool wide = file_.level(depth + 1).pointer_bits == 64;
  return {NodeIndex(nodes, wide ? Pointers::kWide : Pointers::kNarrow, 1, budget_, cancel_,
                    file_.path() + ": level " + std::to_string(depth)),
          PageBuffer<uint64_t>(budget_, nodes.node_count, "the places of nodes")};
}

template <class Visit>
void LevelCells::visit_span(uint64_t span, const Visit& visit) const {
  cancel_.check();
  level_.index.visit_span(span, [&](uint64_t i, uint64_t offset) {
    visit(dag_.children_of_node(depth_, offset), level_.places[i]);
  });
}

void LevelCells::descend() {
  Level below = level(depth_ + 1);
  const auto pass_on = [&](const DagView::Children& children, uint64_t places) {
    for (uint32_t left = children.mask; left != 0; left &= left - 1) {
      const uint64_t offset = dag_.offset(children, std::countr_zero(left));
      const uint64_t node = below.index.find(offset);
      if (node == NodeIndex::kNone) dag_.corrupt(depth_ + 1, offset);
      below.places[node] += places;
    }
  };
  for (uint64_t span = 0; span < level_.index.span_count(); ++span) visit_span(span, pass_on);
  level_ = std::move(below);
  ++depth_;
}

uint64_t LevelCells::count(uint32_t grid_levels, uint64_t limit) {
  if (level_.places.size() == 0) {
    level_ = level(0);
    level_.places[0] = 1;
  }
  while (depth_ + kBrickLevels < grid_levels) descend();
  uint64_t cells = 0;
  const auto add = [&](const DagView::Children& children, uint64_t places) {
    const uint64_t mask = brick_of_cells(dag_, depth_, children);
    cells += places * static_cast<uint64_t>(std::popcount(mask));
  };
  for (uint64_t span = 0; span < level_.index.span_count() && cells <= limit; ++span)
    visit_span(span, add);
  return cells;
}

}  // namespace voxdag::query
