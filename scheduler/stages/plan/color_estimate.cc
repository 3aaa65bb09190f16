#include "scheduler/stages/plan/color_estimate.h"

#include <algorithm>

#include "scene/formats/formats.h"
#include "scene/textures/texture_set.h"
#include "scheduler/spec/memory_plan.h"

namespace voxdag {
namespace {

// Bytes of colors in the file per cell of the finest level, measured on Sponza at a color
// resolution of 4096: 4 bits for the cell, a third of that for the coarser levels, and prefixes
// (core/color/blocks/region.h). Does not include the padding of regions with few cells.
constexpr double kColorBytesPerCell = 0.69;
// Values of other attributes are not compressed. For each cell of the finest level, the file has
// kCellsOfAllLevels values of an attribute: one for the cell, and about a third for the coarser
// levels. The prefixes add kPrefixBytesPerCell bytes per cell of the finest level.
constexpr double kCellsOfAllLevels = 1.36;
constexpr double kPrefixBytesPerCell = 0.03;
constexpr EstimateRange kFileSpread = {0.95, 1, 1.25};
// Header, tables and padding of a section.
constexpr EstimateRange kFixedFileBytes = {0, 4096, 12288};
// Bytes of the colors in the artifacts, divided by their bytes in the file. An artifact also has
// checksums and lengths of regions.
constexpr double kArtifactOverFile = 1.02;
// Bytes of the record of a surface with an image and without vertex colors.
constexpr double kExpectedSurfaceBytes = 65;
// Number of records per surface: one in the bin of each cube that the surface touches.
constexpr EstimateRange kSurfaceCopies = {1, 1.5, 3};
constexpr double kSecondsPerCell = 1.2e-7;  // CPU time per cell for the first attribute
constexpr double kSecondsPerValue = 2e-8;   // CPU time per cell for each further attribute
// CPU time to decode, filter and store a page (kPageBytes) of an image pyramid.
constexpr double kSecondsPerPage = 3e-5;

// Bytes per cell in the file, without the padding of regions with few cells.
double bytes_per_cell(const AttributeSet& attributes, uint64_t materials) {
  double bytes = 0;
  for (const Attribute attribute : attributes.list())
    bytes += traits_of(attribute).is_color()
                 ? kColorBytesPerCell
                 : kCellsOfAllLevels * value_bytes(attribute, materials) + kPrefixBytesPerCell;
  return bytes;
}

EstimateRange above(const EstimateRange& range, double limit) {
  const auto rest = [&](double value) { return std::max(value - limit, 0.0); };
  return {rest(range.low), rest(range.likely), rest(range.high)};
}

}  // namespace

ColorEstimate estimate_colors(const GeometryOptions& options, BuildScene& scene,
                              const EstimateRange& cells, uint64_t triangles,
                              const StageContext& context) {
  const BuildContext& build = context.build;
  SceneMaterials materials = scene.open().materials();
  materials.name_unlisted();
  if (!options.attributes.use_images()) materials.drop_images();
  const auto image_bytes =
      static_cast<double>(pyramid_bytes(build.files, materials, context.budget, build.cancel));
  const double cell_bytes = bytes_per_cell(options.attributes, materials.names.size());
  const auto sections = static_cast<double>(options.attributes.list().size());
  const double limit = static_cast<double>(context.budget.limit());
  const double share = limit / 3;
  const EstimateRange surfaces =
      kExpectedSurfaceBytes * static_cast<double>(triangles) * kSurfaceCopies;
  ColorEstimate estimate;
  estimate.cells = cells;
  estimate.file_bytes = {cell_bytes * kFileSpread.low * cells.low,
                         cell_bytes * kFileSpread.likely * cells.likely,
                         cell_bytes * kFileSpread.high * cells.high};
  estimate.file_bytes = estimate.file_bytes + sections * kFixedFileBytes;
  estimate.artifact_bytes = kArtifactOverFile * estimate.file_bytes;
  estimate.spill_bytes = above(surfaces, share) + exactly(image_bytes > share ? image_bytes : 0.0);
  const double workers = static_cast<double>(
      context.threads * (ColorMemory::kRegionBytes + ColorMemory::value_bytes(options.attributes)));
  estimate.memory_bytes = surfaces + exactly(image_bytes + workers);
  for (double* figure :
       {&estimate.memory_bytes.low, &estimate.memory_bytes.likely, &estimate.memory_bytes.high})
    *figure = std::min(*figure, limit);
  const double per_cell = kSecondsPerCell + (sections - 1) * kSecondsPerValue;
  const double seconds =
      per_cell * cells.likely + kSecondsPerPage * image_bytes / static_cast<double>(kPageBytes);
  estimate.cpu_s = within(seconds, 1.5);
  return estimate;
}

}  // namespace voxdag
