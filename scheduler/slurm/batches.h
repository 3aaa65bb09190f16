// Cuts subvolumes into batches, the inputs of cluster tasks. Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/geometry/cube.h"
#include "scheduler/slurm/files/batch_file.h"
#include "scheduler/slurm/files/cluster_state.h"

namespace voxdag {

// Returns the position of a cube's low corner along the Morton curve. Batches are cut in this
// order, because cubes close together on the curve share the most nodes.
uint64_t morton_place(const Cube& cube);

// Cuts items with these weights, in the given order, into at most `batches` parts of about equal
// weight, each with at least one item. Returns the end index of each part.
std::vector<size_t> cut_into_batches(std::span<const double> weights, uint64_t batches);

// New batches, and their subvolumes as make_batches() divided them.
struct CutBatches {
  std::vector<Batch> batches;
  std::vector<OpenBatch> open;      // the state of the same batches
  std::vector<size_t> first_items;  // index of the first subvolume of each batch
};
// Divides the subvolumes, in the given order, into at most `most` batches, numbered from
// `first_number`. The other fields of the batches are copies of the fields of `like`, which must
// have no subvolumes.
CutBatches make_batches(const Batch& like, std::span<const BatchSubvolume> subvolumes,
                        uint64_t most, uint32_t first_number);

}  // namespace voxdag
