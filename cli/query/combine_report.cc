#include "cli/query/combine_report.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"

namespace voxdag::cli {

void print_combined(const std::string& output, const query::CombineReport& r,
                    const RunTimes& times) {
  std::printf("%s: %s, sha256 %s\n", printable_line(output).c_str(), size_text(r.bytes).c_str(),
              r.sha256.c_str());
  std::printf("  %s voxels, %s octree nodes, %s DAG nodes\n", count_text(r.voxels).c_str(),
              count_text(r.svo_nodes).c_str(), count_text(r.dag_nodes).c_str());
  if (r.clipped > 0)
    std::printf("  %s moved voxels were outside of the grid\n", count_text(r.clipped).c_str());
  std::printf("  %s pairs of nodes, %s wall, %s CPU, peak memory %s\n", count_text(r.pairs).c_str(),
              duration_text(times.wall_s).c_str(), duration_text(times.cpu_s).c_str(),
              size_text(peak_resident_bytes()).c_str());
}

nlohmann::ordered_json combined_json(const std::string& output, const query::CombineReport& r,
                                     const RunTimes& times) {
  return {{"output", output},
          {"sha256", r.sha256},
          {"resolution", r.grid.resolution()},
          {"bounds", {{"origin", r.grid.origin}, {"edge", r.grid.edge}}},
          {"voxels", r.voxels},
          {"svo_nodes", r.svo_nodes},
          {"dag_nodes", r.dag_nodes},
          {"bytes", r.bytes},
          {"pairs", r.pairs},
          {"clipped_voxels", r.clipped},
          {"work_bytes", r.work_bytes},
          {"wall_s", times.wall_s},
          {"cpu_s", times.cpu_s},
          {"peak_rss_bytes", peak_resident_bytes()}};
}

}  // namespace voxdag::cli
