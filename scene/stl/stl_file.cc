#include "scene/stl/stl_file.h"

#include <limits>
#include <string>
#include <utility>

#include "scene/messages.h"
#include "scene/stl/polygon_reader.h"

namespace voxdag::stl {
namespace {

// Maximum number of recorded positions of polygons (PolygonPlace), which take 24 bytes each.
constexpr size_t kMaxPlaces = size_t{1} << 17;

// Number of polygons between two checks for cancellation.
constexpr uint64_t kPolygonsPerCheck = 1024;

}  // namespace

StlFile::StlFile(std::unique_ptr<ReadableFile> file, MemoryBudget& budget,
                 const CancelToken& cancel)
    : file_(std::move(file)),
      format_(format_of(*file_)),
      polygon_index_(budget, kMaxPlaces, "the facets of " + file_->path()) {
  if (is_ascii())
    scan_text(budget, cancel);
  else
    count_facets();
}

// Compares the number of facets in the header of a binary file with the size of the file.
void StlFile::count_facets() {
  const uint64_t declared = declared_facets(*file_);
  const uint64_t present = (file_->size() - kHeaderBytes) / kFacetBytes;
  const uint64_t after = file_->size() - kHeaderBytes - kFacetBytes * std::min(declared, present);
  triangles_ = declared;
  // Programs that do not know the number of facets in advance write one of these two numbers.
  const bool is_unknown = declared == 0 || declared == std::numeric_limits<uint32_t>::max();
  if (is_unknown && present > 0) {
    triangles_ = present;
    warnings_.add({"wrong-count", file_->path(),
                   "the header declares " + std::to_string(declared) +
                       " facets; all facets of the file are read"});
  } else if (declared > present) {
    refuse(file_->path(), "its header declares " + std::to_string(declared) +
                              " facets, which need " +
                              std::to_string(kHeaderBytes + kFacetBytes * declared) +
                              " bytes, but the file has " + std::to_string(file_->size()));
  } else if (after > 0) {
    warnings_.add({"trailing-bytes", file_->path(),
                   std::to_string(after) + " bytes after the " + std::to_string(declared) +
                       " facets that the header declares are ignored"});
  }
}

void StlFile::scan_text(MemoryBudget& budget, const CancelToken& cancel) {
  PolygonReader polygons(*file_, budget);
  uint64_t too_small = 0, first_small_line = 0, doubtful = 0, first_doubtful_line = 0;
  for (uint64_t polygon = 0; polygons.next(); ++polygon) {
    if (polygon % kPolygonsPerCheck == 0) cancel.check();
    if (polygon_index_.wants(polygon))
      polygon_index_.add({polygons.offset(), polygons.line(), triangles_});
    triangles_ += polygons.triangles();
    if (polygons.triangles() == 0 && too_small++ == 0) first_small_line = polygons.line();
    if (polygons.is_doubtful() && doubtful++ == 0) first_doubtful_line = polygons.line();
  }
  const auto place = [&](uint64_t line) {
    return file_->path() + ": line " + std::to_string(line);
  };
  if (polygons.is_cut_off())
    refuse(file_->path(), "ends in line " + std::to_string(polygons.line()) +
                              " within a facet, expected endfacet and endsolid");
  if (too_small > 0)
    warnings_.add({"degenerate-faces", place(first_small_line),
                   "a facet of fewer than three vertices makes no voxels", too_small});
  if (doubtful > 0)
    warnings_.add(
        polygon::crossing_edges(place(first_doubtful_line), "the edges of a facet", doubtful));
  if (polygons.unknown_words() > 0)
    warnings_.add({"unknown-statements", place(polygons.first_unknown_line()),
                   "words that are not part of STL are ignored", polygons.unknown_words()});
}

}  // namespace voxdag::stl
