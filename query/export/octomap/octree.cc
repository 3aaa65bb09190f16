#include "query/export/octomap/octree.h"

#include <cmath>
#include <cstdio>

#include "core/base/error.h"
#include "core/base/text.h"

namespace voxdag::query {
namespace {

// Returns the translation that converts coordinates of the octree to coordinates of the scene.
std::array<double, 3> translation_of(const ExportJob& job) {
  const Position place = octomap_place(job);
  std::array<double, 3> translation{};
  for (size_t axis = 0; axis < 3; ++axis)
    translation[axis] = job.world(axis, static_cast<double>(-place[axis]));
  return translation;
}

std::string translation_note(const ExportJob& job, const std::array<double, 3>& translation) {
  const bool is_near = std::ranges::all_of(translation, [&](double distance) {
    return std::abs(distance) <= job.cell_edge() / 2 * (1 + 1e-9);
  });
  char text[240];
  std::snprintf(text, sizeof(text),
                is_near ? "its coordinates are those of the scene, up to half a voxel: add %.9g, "
                          "%.9g, %.9g for the exact ones"
                        : "the scene is too far from its origin for OctoMap: add %.9g, %.9g, %.9g "
                          "to its coordinates to get scene units",
                translation[0], translation[1], translation[2]);
  return text;
}

// Returns the memory that the OctoMap library allocates to read the file: an object for each node
// and an array of pointers for each inner node, including the overhead of the allocator.
uint64_t reader_bytes(uint64_t nodes, uint64_t inner_nodes) {
  return nodes * 32 + inner_nodes * 80;
}

}  // namespace

void check_octomap_levels(const ExportJob& job) {
  if (job.selection.grid_levels > kOctoMapLevels)
    throw Error(ErrorCode::kLimit, job.output + ": the grid has " +
                                       std::to_string(int64_t{1} << job.selection.grid_levels) +
                                       " voxels per edge, but OctoMap has at most 65536. " +
                                       coarser_options(job, kOctoMapLevels) + " fits");
}

Position octomap_place(const ExportJob& job) {
  Position place{};
  const int64_t edge = int64_t{1} << job.selection.grid_levels;
  for (size_t axis = 0; axis < 3; ++axis) {
    const double cells = std::floor(job.origin(axis) / job.cell_edge() + 0.5);
    place[axis] = static_cast<int64_t>(
        std::clamp(cells, static_cast<double>(-kHalfTree), static_cast<double>(kHalfTree - edge)));
  }
  return place;
}

void report_octomap(const ExportJob& job, uint64_t nodes, uint64_t inner_nodes,
                    ExportReport& report) {
  const std::array<double, 3> translation = translation_of(job);
  const uint64_t memory = reader_bytes(nodes, inner_nodes);
  report.notes.push_back(translation_note(job, translation));
  report.notes.push_back("its readers need about " + size_text(memory) + " of memory for " +
                         count_text(nodes) + " nodes");
  report.facts.push_back({"translation", {translation.begin(), translation.end()}});
  report.add_fact("nodes", nodes);
  report.add_fact("reader_memory_bytes", memory);
}

}  // namespace voxdag::query
