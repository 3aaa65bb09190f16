#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <cmath>

#include "core/base/process_limits.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/open_global.h"
#include "python/native/bindings.h"
#include "python/native/path_text.h"
#include "query/dag/selection.h"
#include "voxdag/query.h"

namespace voxdag::python {

namespace nb = nanobind;

namespace {

using query::Position;
template <class Number>
using Column = nb::ndarray<Number, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
template <class Number>
using Rows = nb::ndarray<Number, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
template <class Number>
using Cells = nb::ndarray<Number, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

// Returns the rows of an array of shape (N, 3) as C++ objects, without copying them.
std::span<const Position> positions_of(const Rows<const int64_t>& rows) {
  return {reinterpret_cast<const Position*>(rows.data()), rows.shape(0)};
}
std::span<Position> positions_of(const Rows<int64_t>& rows) {
  return {reinterpret_cast<Position*>(rows.data()), rows.shape(0)};
}
std::span<const query::Coordinates> coordinates_of(const Rows<const double>& rows) {
  return {reinterpret_cast<const query::Coordinates*>(rows.data()), rows.shape(0)};
}

// Throws Error{kInvalidInput} unless an array has the expected length along one axis. `name` is the
// array's parameter name in the native module.
void expect_length(const char* name, size_t length, size_t expected) {
  if (length != expected)
    throw Error(ErrorCode::kInvalidInput, "the array " + std::string(name) + " has the length " +
                                              std::to_string(length) + ": expected " +
                                              std::to_string(expected));
}

unsigned threads_of(unsigned threads) { return threads ? threads : default_threads(); }

void lookup(const query::DagFile& dag, const Rows<const int64_t>& points, uint32_t grid_levels,
            const Column<uint8_t>& set, unsigned threads) {
  expect_length("set", set.shape(0), points.shape(0));
  const nb::gil_scoped_release released;
  dag.lookup(positions_of(points), grid_levels, {set.data(), set.shape(0)}, threads_of(threads));
}

// Number of rays per call of DagFile::rays(). It limits the memory for `hits`, which holds the
// results of one call until they are copied to the arrays.
constexpr size_t kRays = size_t{1} << 16;

void rays(const query::DagFile& dag, const Rows<const double>& origins,
          const Rows<const double>& directions, double max_distance, double stop_size,
          const Column<double>& distances, const Rows<int64_t>& voxels, const Rows<int8_t>& normals,
          unsigned threads) {
  const size_t count = origins.shape(0);
  expect_length("directions", directions.shape(0), count);
  expect_length("distances", distances.shape(0), count);
  expect_length("voxels", voxels.shape(0), count);
  expect_length("normals", normals.shape(0), count);
  const auto all_origins = coordinates_of(origins), all_directions = coordinates_of(directions);
  const std::span<Position> all_voxels = positions_of(voxels);
  const nb::gil_scoped_release released;
  std::vector<query::RayHit> hits(std::min(count, kRays));
  for (size_t first = 0; first < count; first += kRays) {
    const size_t some = std::min(count - first, kRays);
    dag.rays(all_origins.subspan(first, some), all_directions.subspan(first, some),
             {max_distance, stop_size}, std::span(hits).first(some), threads_of(threads));
    for (size_t i = 0; i < some; ++i) {
      const query::RayHit& hit = hits[i];
      distances.data()[first + i] = hit.hit ? hit.distance : HUGE_VAL;
      int8_t* const normal = normals.data() + 3 * (first + i);
      for (int axis = 0; axis < 3; ++axis) {
        const uint32_t up = hit.hit ? dag.grid_levels() - hit.grid_levels : 0;
        all_voxels[first + i][static_cast<size_t>(axis)] =
            hit.hit ? hit.cell[static_cast<size_t>(axis)] << up : -1;
        normal[axis] = hit.hit && hit.axis == axis ? hit.sign : int8_t{0};
      }
    }
  }
}

void occluded(const query::DagFile& dag, const Rows<const double>& origins,
              const Rows<const double>& directions, double max_distance, double stop_size,
              const Column<uint8_t>& occluded, unsigned threads) {
  expect_length("directions", directions.shape(0), origins.shape(0));
  expect_length("occluded", occluded.shape(0), origins.shape(0));
  const nb::gil_scoped_release released;
  dag.occluded(coordinates_of(origins), coordinates_of(directions), {max_distance, stop_size},
               {occluded.data(), occluded.shape(0)}, threads_of(threads));
}

void dense(const query::DagFile& dag, const Position& low, const Position& high,
           uint32_t grid_levels, const Cells<uint8_t>& cells) {
  for (size_t axis = 0; axis < 3; ++axis)
    expect_length("cells", cells.shape(axis),
                  static_cast<size_t>(std::max<int64_t>(0, high[axis] - low[axis])));
  const nb::gil_scoped_release released;
  dag.box({grid_levels, {low, high}}, {cells.data(), cells.size()});
}

void points(const query::DagFile& dag, const Position& low, const Position& high,
            uint32_t grid_levels, const Rows<int64_t>& found) {
  const nb::gil_scoped_release released;
  expect_length("found", found.shape(0),
                dag.positions({grid_levels, {low, high}}, positions_of(found)));
}

// For each point of world space, writes the coordinates of the cell that contains it to `cells`.
// The grid of cells has 2^grid_levels cells per edge.
void world_to_cells(const query::DagFile& dag, const Rows<const double>& points,
                    uint32_t grid_levels, const Rows<int64_t>& cells) {
  expect_length("cells", cells.shape(0), points.shape(0));
  const nb::gil_scoped_release released;
  for (size_t i = 0; i < points.shape(0); ++i)
    for (size_t axis = 0; axis < 3; ++axis)
      cells.data()[3 * i + axis] =
          query::world_to_cell(dag.file(), grid_levels, axis, points.data()[3 * i + axis]);
}

std::pair<Position, Position> world_to_region(const query::DagFile& dag,
                                              const std::array<double, 6>& box,
                                              uint32_t grid_levels) {
  const query::Region region = query::world_to_region(dag.file(), grid_levels, box);
  return {region.low, region.high};
}

// Returns the number of rows that points() fills. Unlike count(), this function does not compute
// and keep a count for every node of the file; it visits only the nodes in the region.
uint64_t point_count(const query::DagFile& dag, const Position& low, const Position& high,
                     uint32_t grid_levels) {
  const nb::gil_scoped_release released;
  return dag.positions({grid_levels, {low, high}}, {});
}

uint64_t count(const query::DagFile& dag, const Position& low, const Position& high,
               uint32_t grid_levels) {
  const nb::gil_scoped_release released;
  return dag.count({grid_levels, {low, high}});
}

void nearest(const query::DagFile& dag, const Rows<const int64_t>& points, double max_distance,
             const Rows<int64_t>& voxels, const Column<double>& distances, unsigned threads) {
  expect_length("voxels", voxels.shape(0), points.shape(0));
  expect_length("distances", distances.shape(0), points.shape(0));
  const std::span<Position> found_voxels = positions_of(voxels);
  const nb::gil_scoped_release released;
  std::vector<query::Nearest> found(points.shape(0));
  dag.nearest(positions_of(points), dag.grid_levels(), max_distance, found, threads_of(threads));
  for (size_t i = 0; i < found.size(); ++i) {
    found_voxels[i] = found[i].found ? found[i].cell : Position{-1, -1, -1};
    distances.data()[i] =
        found[i].found ? std::sqrt(static_cast<double>(found[i].squared_distance)) : HUGE_VAL;
  }
}

// Writes the values of the attribute `name` for the cells `points` to `found`, one row per cell.
// Leaves the rows of cells that are not set unchanged. `Number` is the attribute's type in
// attribute_types().
template <class Number>
void values(const query::DagFile& dag, const std::string& name, const Rows<const int64_t>& points,
            uint32_t grid_levels, const nb::ndarray<Number, nb::c_contig, nb::device::cpu>& found) {
  const Attribute attribute = attribute_named(name, "attributes");
  const uint32_t components = traits_of(traits_of(attribute).encoding).components;
  expect_length("found", found.size(), components * points.shape(0));
  const nb::gil_scoped_release released;
  with_reader_errors([&] {
    voxdag_reader::ColorCursor cursor(dag.file(), section_of(dag.file(), attribute));
    const std::span<const Position> cells = positions_of(points);
    for (size_t i = 0; i < cells.size(); ++i) {
      uint64_t number;
      const auto* const region =
          cursor.find(cells[i][0], cells[i][1], cells[i][2], grid_levels, number);
      Number* row = found.data() + components * i;
      if (region)
        put_value(attribute, *region, number,
                  [&](auto component) { *row++ = static_cast<Number>(component); });
    }
  });
}

// Returns the name of each attribute, the number of components of its values, and their numpy type.
std::vector<std::tuple<std::string, uint32_t, std::string>> attribute_types() {
  std::vector<std::tuple<std::string, uint32_t, std::string>> all;
  for (const AttributeTraits& row : kAttributeTable) {
    const EncodingTraits& encoding = traits_of(row.encoding);
    const char* const type = row.has_names()                         ? "int64"
                             : encoding.number == NumberType::kFloat ? "float32"
                                                                     : "uint8";
    all.emplace_back(row.name, encoding.components, type);
  }
  return all;
}

// Returns the names as bytes, because a scene can have names that are not UTF-8.
std::vector<nb::bytes> material_names(const query::DagFile& dag) {
  std::vector<nb::bytes> names;
  for (const std::string& name : dag.file().material_names())
    names.emplace_back(name.data(), name.size());
  return names;
}

// Returns the number of nodes and of bytes of each level, the root's level first.
std::vector<std::pair<uint64_t, uint64_t>> levels(const query::DagFile& dag) {
  std::vector<std::pair<uint64_t, uint64_t>> all;
  for (uint32_t l = 0; l <= dag.file().brick_level(); ++l) {
    const voxdag_reader::Level& level = dag.file().level(l);
    all.emplace_back(level.node_count, level.word_count * sizeof(uint32_t));
  }
  return all;
}

}  // namespace

void bind_dag(nb::module_& module) {
  nb::class_<query::DagFile>(module, "Dag")
      .def("__init__",
           [](query::DagFile* dag, const PathText& path) {
             const nb::gil_scoped_release released;
             new (dag) query::DagFile(path.bytes);
           })
      .def_prop_ro("grid_levels", &query::DagFile::grid_levels)
      .def_prop_ro("node_order",
                   [](const query::DagFile& dag) {
                     return std::string(name_of(NodeOrder{dag.file().node_order()}));
                   })
      .def_prop_ro("voxels", [](const query::DagFile& dag) { return dag.file().voxels(); })
      .def_prop_ro("edge", [](const query::DagFile& dag) { return dag.file().edge(); })
      .def_prop_ro("origin",
                   [](const query::DagFile& dag) { return std::to_array(dag.file().origin()); })
      .def("levels", &levels)
      .def("world_to_cells", &world_to_cells)
      .def("world_to_region", &world_to_region)
      .def("lookup", &lookup)
      .def("rays", &rays)
      .def("occluded", &occluded)
      .def("dense", &dense)
      .def("points", &points)
      .def("point_count", &point_count)
      .def("count", &count)
      .def("nearest", &nearest)
      .def_prop_ro("attributes",
                   [](const query::DagFile& dag) { return attributes_of(dag.file()).names(); })
      .def_prop_ro("material_names", &material_names)
      .def("values", &values<uint8_t>)
      .def("values", &values<float>)
      .def("values", &values<int64_t>);
  module.def("attribute_types", &attribute_types);
}

}  // namespace voxdag::python
