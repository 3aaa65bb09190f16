// The description of a build's report (core/fields/field.h). The report's JSON and the schema of
// the JSON derive from it.
#pragma once

#include <bit>

#include "core/fields/field.h"
#include "scheduler/spec/build_report.h"

namespace voxdag {

template <class Visitor>
void fields(Visitor& visit, StageTime& stage) {
  visit("name", stage.name);
  visit("wall_s", stage.wall_s);
  visit("cpu_s", stage.cpu_s);
  visit("largest_thread_share", stage.largest_thread_share);
}

template <class Visitor>
void fields(Visitor& visit, ColorReport& colors) {
  visit("resolution", colors.resolution);
  visit("cells", colors.cells);
  visit("images", colors.images);
  visit("image_bytes", colors.image_bytes);
  visit.object("cubes", [&](auto& cubes) {
    cubes("total", colors.cubes);
    cubes("reused", colors.cubes_reused);
  });
}

template <class Visitor>
void fields(Visitor& visit, SolidReport& solid) {
  visit("rule", solid.rule);
  visit("seed", solid.seed);
  visit("radius", solid.radius);
  visit("interior", solid.interior);
  visit("volume", solid.volume);
  visit("rows", solid.rows);
  visit("open_rows", solid.open_rows);
  visit("odd_rows", solid.odd_rows);
  visit("disputed", solid.disputed);
}

// Omits ClusterTotals::split, because the report has this number under "subvolumes".
template <class Visitor>
void fields(Visitor& visit, ClusterTotals& totals) {
  visit("batches", totals.batches);
  visit("failed_attempts", totals.attempts);
  visit("cpu_s", totals.cpu_s);
  visit("longest_s", totals.longest_s);
  visit("first_task_s", totals.first_task_s);
  visit("rows_before", totals.rows_before);
  visit("rows_after", totals.rows_after);
  visit("requests", totals.requests);
  visit("batches_of_node", totals.batches_of_node);
}

template <class Visitor>
void visit_grid(Visitor& visit, Grid& grid) {
  auto resolution = static_cast<uint64_t>(grid.resolution());
  visit(Field("resolution").power_of_two(4, int64_t{1} << 20), resolution);
  grid.levels = static_cast<uint32_t>(std::countr_zero(resolution));
  visit.object("bounds", [&](auto& bounds) {
    bounds("origin", grid.origin);
    bounds("edge", grid.edge);
  });
}

template <class Visitor>
void visit_counts(Visitor& visit, BuildReport& report) {
  visit("bytes", report.bytes);
  visit("triangles", report.triangles);
  visit.object("dropped", [&](auto& dropped) {
    dropped("outside", report.dropped_outside);
    dropped("invalid", report.dropped_invalid);
  });
  visit.object("subvolumes", [&](auto& subvolumes) {
    subvolumes("total", report.subvolumes);
    subvolumes("reused", report.subvolumes_reused);
    subvolumes("cached", report.subvolumes_cached);
    subvolumes("split", report.subvolumes_split);
  });
  visit.object("artifacts", [&](auto& artifacts) {
    artifacts("bytes", report.artifact_bytes);
    artifacts("nodes", report.artifact_nodes);
  });
  visit("spill_bytes", report.spill_bytes);
}

template <class Visitor>
void fields(Visitor& visit, BuildReport& report) {
  visit("output", report.output);
  visit(Field("scene").omit_empty(), report.scenes);
  visit("sha256", report.sha256);
  visit_grid(visit, report.grid);
  visit("hash_bits", report.hash_bits);
  visit("rule", report.rule);
  visit("node_order", report.node_order);
  visit("voxels", report.merge.voxels);
  visit("svo_nodes", report.merge.svo_nodes);
  visit("dag_nodes", report.merge.dag_nodes);
  visit_counts(visit, report);
  visit("merge_passes", report.merge.passes);
  visit("merge_partitions", report.merge.hash_partitions);
  visit("merge_streamed_groups", report.merge.streamed_groups);
  visit("memory_bytes", report.memory_bytes);
  visit("threads", report.threads);
  visit("backend", report.backend);
  visit("stages", report.stages);
  visit("wall_s", report.wall_s);
  visit("cpu_s", report.cpu_s);
  visit("peak_rss_bytes", report.peak_rss_bytes);
  visit.derived("voxels_per_s",
                report.wall_s > 0 ? static_cast<double>(report.merge.voxels) / report.wall_s : 0.0);
  visit("solid", report.solid);
  visit("colors", report.colors);
  visit("cluster", report.cluster);
  visit("warnings", report.warnings);
  visit(Field("merge_request").omit_empty(), report.merge_request);
}

}  // namespace voxdag
