#include "scheduler/slurm/batches.h"

#include <numeric>

#include "core/geometry/morton.h"

namespace voxdag {

uint64_t morton_place(const Cube& cube) {
  const uint32_t up = kMaxGridLevels - cube.level;
  return morton_encode(cube.position[0] << up, cube.position[1] << up, cube.position[2] << up);
}

std::vector<size_t> cut_into_batches(std::span<const double> weights, uint64_t batches) {
  std::vector<size_t> ends;
  const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
  double sum = 0;
  for (size_t i = 0; i < weights.size(); ++i) {
    sum += weights[i];
    const double wanted =
        total * static_cast<double>(ends.size() + 1) / static_cast<double>(batches);
    const bool is_last = i + 1 == weights.size();
    // The ideal batches have equal weights. An item that crosses the ideal end of a batch belongs
    // to the batch with the larger share of the item's weight.
    if (is_last || (ends.size() + 1 < batches && sum + weights[i + 1] / 2 > wanted))
      ends.push_back(i + 1);
  }
  return ends;
}

CutBatches make_batches(const Batch& like, std::span<const BatchSubvolume> subvolumes,
                        uint64_t most, uint32_t first_number) {
  std::vector<double> weights;
  for (const BatchSubvolume& subvolume : subvolumes) weights.push_back(subvolume.weight);
  CutBatches cut;
  size_t item = 0;
  for (const size_t end : cut_into_batches(weights, most)) {
    Batch batch = like;
    OpenBatch open;
    batch.number = open.number = first_number + static_cast<uint32_t>(cut.batches.size());
    cut.first_items.push_back(item);
    for (; item < end; ++item) {
      batch.subvolumes.push_back(subvolumes[item]);
      open.subvolumes.push_back(
          {subvolumes[item].id, subvolumes[item].cube, subvolumes[item].triangles});
      open.weight += subvolumes[item].weight;
    }
    cut.batches.push_back(std::move(batch));
    cut.open.push_back(std::move(open));
  }
  return cut;
}

}  // namespace voxdag
