#include "scheduler/solid/solid_report.h"

#include <cstdio>

#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "core/fields/field.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag {
namespace {

// Limits for the number of open sample rows (RowCounts), as a fraction of all rows with a crossing.
// Above kClosed, a warning reports that the surface is not closed. Above kScene, the warning adds
// that the input is more a scene than an object.
constexpr double kClosed = 0.001, kScene = 0.05;

std::string percent_text(double part) {
  char text[32];
  const double percent = 100 * part;
  std::snprintf(text, sizeof text, percent < 10 ? "%.2g %%" : "%.0f %%", percent);
  return text;
}

}  // namespace

double solid_volume(const Grid& grid, uint64_t voxels) {
  const double edge = grid.edge / static_cast<double>(grid.resolution());
  return static_cast<double>(voxels) * edge * edge * edge;
}

SolidReport solid_report(const SolidRows& rows, uint64_t interior, uint64_t disputed) {
  SolidReport report;
  report.rule = name_of(static_cast<SolidName>(rows.rule()));
  report.interior = interior;
  report.disputed = disputed;
  for (const FullCube& full : rows.full_cubes) {
    const uint64_t filled = uint64_t{1} << 3 * (rows.grid_levels() - full.cube.level);
    report.interior += filled;
    if (full.is_disputed) report.disputed += filled;
  }
  report.rows = rows.counts.rows;
  report.open_rows = rows.counts.open;
  report.odd_rows = rows.counts.odd;
  return report;
}

SolidReport enclosed_report(uint64_t voxels, uint64_t shell) {
  SolidReport report;
  report.rule = name_of(SolidName::kEnclosed);
  report.interior = voxels - shell;
  return report;
}

Warning seed_warning(const Seed& seed, const std::string& scene) {
  return {"solid-reached", scene,
          "a walk leads from the seed " + seed.text +
              " to the border of the grid, so its space is not filled"};
}

std::optional<Warning> solid_warning(const SolidReport& report, const std::string& scene) {
  if (report.rule == name_of(SolidName::kEnclosed)) {
    if (report.interior != 0) return std::nullopt;
    return Warning{
        "solid-reached", scene,
        "nothing is enclosed: walks from the border of the grid reach every empty voxel; " +
            option_text("radius") + " V seals gaps of up to V voxels"};
  }
  if (report.rows == 0) return std::nullopt;
  const bool is_parity = report.rule == name_of(SolidName::kParity);
  const uint64_t open = is_parity ? report.odd_rows : report.open_rows;
  const double part = static_cast<double>(open) / static_cast<double>(report.rows);
  if (report.interior == 0 && report.open_rows == 0 && report.odd_rows == 0)
    return Warning{"solid-canceled", scene,
                   "nothing is inside: the faces cancel each other, as double-sided faces do; " +
                       option_text("solid", "enclosed") + " fills what nothing reaches"};
  if (!is_parity && open > 0 && report.odd_rows == 0)
    return Warning{
        "solid-orientation", scene,
        "the surface is closed, but its faces are oriented inconsistently (" + percent_text(part) +
            " of the sample rows): " + option_text("solid", "parity") + " ignores orientation"};
  if (part > kScene)
    return Warning{"solid-open", scene,
                   "the surface is not closed (" + percent_text(part) +
                       " of the sample rows), so it is more a scene than an object: " +
                       count_text(report.disputed) + " filled voxels rest on a majority; " +
                       option_text("solid", "enclosed") + " fills only what nothing reaches"};
  if (part > kClosed)
    return Warning{"solid-open", scene,
                   "the surface is not closed (" + percent_text(part) + " of the sample rows): " +
                       count_text(report.disputed) + " filled voxels rest on a majority"};
  return std::nullopt;
}

}  // namespace voxdag
