#include "scene/obj/file/obj_file.h"

#include <algorithm>

#include "core/base/error.h"
#include "scene/messages.h"
#include "scene/obj/file/corners.h"
#include "scene/obj/file/numbers.h"
#include "scene/obj/file/polygon_reader.h"
#include "scene/obj/file/statement.h"
#include "scene/obj/file/vertex_reader.h"
#include "scene/polygon/face_splitter.h"
#include "scene/text/line_reader.h"

namespace voxdag::obj {
namespace {

// Maximum numbers of recorded positions of lines and of faces. They take at most 7 MiB in total.
constexpr size_t kMaxLinePlaces = size_t{1} << 17;
constexpr size_t kMaxFacePlaces = size_t{1} << 16;
// Number of statements between two checks for cancellation.
constexpr uint64_t kStatementsPerCheck = 1024;
constexpr size_t kMaxLibraries = 1024;

// A kind of statement that is ignored with a warning.
struct IgnoredStatements {
  uint64_t count = 0;
  uint64_t first_line = 0;
  std::string keyword;  // keyword of the first such statement

  void add(const Statement& statement, uint64_t line) {
    if (count++ > 0) return;
    first_line = line;
    keyword = statement.keyword;
  }
};

}  // namespace

// The first pass over the file, which collects the members of ObjFile.
class ObjFile::Scan {
 public:
  Scan(ObjFile& obj, MemoryBudget& budget, const CancelToken& cancel)
      : obj_(obj), cancel_(cancel), lines_(*obj.file_, budget, LineReader::Join::kBackslash) {}

  void run() {
    for (uint64_t statement = 0; lines_.next(); ++statement) {
      if (statement % kStatementsPerCheck == 0) cancel_.check();
      read(statement_of(lines_.text()));
    }
  }

  IgnoredStatements points_or_lines, unknown, small_faces, unnamed_materials, unnamed_libraries;
  bool has_polygons = false;  // true if a face has more than three corners
  uint64_t max_texture = 0;   // the largest index of texture coordinates, which counts from 1

 private:
  void read(const Statement& statement) {
    switch (statement.kind) {
      case Kind::kIgnored:
        return;
      case Kind::kVertex:
        return add_vertex(statement.arguments);
      case Kind::kTexture:
        return add_place(obj_.texcoords_, obj_.texcoord_index_, "texture coordinates");
      case Kind::kFace:
        return add_face(statement);
      case Kind::kUseMaterial:
        return use_material(statement);
      case Kind::kLibrary:
        return add_library(statement);
      case Kind::kPointOrLine:
        return points_or_lines.add(statement, lines_.number());
      case Kind::kUnknown:
        return unknown.add(statement, lines_.number());
      case Kind::kFreeForm:
        refuse_line(std::string(statement.keyword) +
                    " is part of a free-form curve or surface, which voxdag does not read; "
                    "convert the surfaces to polygons first");
      case Kind::kCall:
        refuse_line("call includes another file, which voxdag does not read; insert its lines");
    }
  }

  void add_place(uint64_t& count, BlockIndex<LinePlace>& index, const char* what) {
    if (index.wants(count)) index.add({lines_.offset(), lines_.number()});
    if (++count >= kNoIndex)
      throw Error(ErrorCode::kLimit, obj_.file_->path() + ": line " +
                                         std::to_string(lines_.number()) +
                                         " exceeds the limit of 2^32 - 2 " + what);
  }

  void add_vertex(std::string_view arguments) {
    add_place(obj_.vertices_, obj_.vertex_index_, "vertices");
    if (obj_.full_color_ > 1 || count_words(arguments) < 6) return;
    double numbers[6];
    if (read_numbers(arguments, numbers, 6) < 6) return;
    obj_.has_colors_ = true;
    if (std::max({numbers[3], numbers[4], numbers[5]}) > 1) obj_.full_color_ = 255;
  }

  void add_face(const Statement& statement) {
    if (obj_.face_index_.wants(obj_.faces_))
      obj_.face_index_.add({{lines_.offset(), lines_.number()},
                            obj_.triangles_,
                            obj_.vertices_,
                            obj_.texcoords_,
                            material_});
    ++obj_.faces_;
    const FaceCorners corners = scan_corners(statement.arguments, obj_.texcoords_);
    if (corners.count < 3) return add_small_face(statement);
    obj_.triangles_ += corners.count - 2;
    has_polygons = has_polygons || corners.count > 3;
    max_texture = std::max(max_texture, static_cast<uint64_t>(corners.max_texture));
    UsedMaterials::Use& use = obj_.materials_.all()[material_];
    ++use.faces;
    if (corners.lacks_texture) ++use.faces_without_texture;
  }

  // Counts a face of fewer than three corners, for a warning. Such a face sets no voxels. Refuses
  // the file if a corner is not an index, as in "f 1,2,3".
  void add_small_face(const Statement& statement) {
    std::string_view arguments = statement.arguments;
    for (size_t corner = 0; has_word(arguments); ++corner) {
      const std::string_view rest = arguments;
      Corner read;
      if (!next_corner(arguments, read))
        refuse(obj_.file_->path(), place_of_face(obj_.faces_ - 1, lines_.number()) + ": " +
                                       describe_bad_corner(corner, rest));
    }
    small_faces.add(statement, lines_.number());
  }

  void use_material(const Statement& statement) {
    const std::string_view name = trimmed(statement.arguments);
    if (name.empty()) unnamed_materials.add(statement, lines_.number());
    material_ = obj_.materials_.add(name, lines_.number());
  }

  void add_library(const Statement& statement) {
    const std::string_view names = statement.arguments;
    if (names.empty()) return unnamed_libraries.add(statement, lines_.number());
    const auto same = [&](const Library& library) { return library.names == names; };
    if (std::ranges::any_of(obj_.libraries_, same)) return;
    if (obj_.libraries_.size() == kMaxLibraries)
      throw Error(ErrorCode::kLimit, obj_.file_->path() + ": line " +
                                         std::to_string(lines_.number()) +
                                         " exceeds the limit of " + std::to_string(kMaxLibraries) +
                                         " mtllib statements");
    obj_.libraries_.push_back({std::string(names.substr(0, kMaxNames)), lines_.number()});
  }

  [[noreturn]] void refuse_line(const std::string& what) const {
    refuse(obj_.file_->path(), "line " + std::to_string(lines_.number()) + ": " + what);
  }

  static constexpr size_t kMaxNames = 8192;  // bytes; longer than any path

  ObjFile& obj_;
  const CancelToken& cancel_;
  LineReader lines_;
  uint32_t material_ = 0;
};

ObjFile::ObjFile(std::unique_ptr<ReadableFile> file, MemoryBudget& budget,
                 const CancelToken& cancel)
    : file_(std::move(file)),
      vertex_index_(budget, kMaxLinePlaces, "the vertices of " + file_->path()),
      texcoord_index_(budget, kMaxLinePlaces, "the texture coordinates of " + file_->path()),
      face_index_(budget, kMaxFacePlaces, "the faces of " + file_->path()),
      materials_(budget, file_->path()) {
  Scan scan(*this, budget, cancel);
  scan.run();
  add_warnings(scan);
  if (scan.max_texture > texcoords_) count_faces_without_texture(budget, cancel);
  if (scan.has_polygons) find_splits(budget, cancel);
}

void ObjFile::add_warnings(const Scan& scan) {
  const auto add = [&](const char* code, const IgnoredStatements& ignored, const char* message) {
    if (ignored.count > 0)
      warnings_.add({code, file_->path() + ": line " + std::to_string(ignored.first_line), message,
                     ignored.count});
  };
  add("degenerate-faces", scan.small_faces, "a face of fewer than three corners makes no voxels");
  add("missing-material", scan.unnamed_materials, "usemtl has no name; its faces are white");
  add("missing-file", scan.unnamed_libraries, "mtllib has no name; it is ignored");
  add("points-or-lines", scan.points_or_lines, "points and lines make no voxels");
  if (faces_ == 0 && vertices_ > 0 && scan.points_or_lines.count == 0)
    warnings_.add({"points-or-lines", file_->path(),
                   "vertices without faces make no voxels; points are read from text (.xyz), PLY "
                   "and LAS",
                   vertices_});
  const std::string unknown =
      "the unknown statement \"" + printable(scan.unknown.keyword) + "\" is ignored";
  add("unknown-statements", scan.unknown, unknown.c_str());
}

// Reads all faces of the file, one after the other. Calls visit() after each.
template <class Visit>
void ObjFile::for_each_polygon(PolygonReader& polygons, const CancelToken& cancel,
                               const Visit& visit) const {
  polygons.seek(face_index_.at(0), 0);
  for (uint64_t face = 0; face < faces_; ++face) {
    if (face % kStatementsPerCheck == 0) cancel.check();
    polygons.next();
    visit();
  }
}

// Counts again, for each material, the faces that lack texture coordinates. The first pass cannot
// count faces whose indices exceed the number of vt statements, because vt statements may follow a
// face.
void ObjFile::count_faces_without_texture(MemoryBudget& budget, const CancelToken& cancel) {
  for (UsedMaterials::Use& use : materials_.all()) use.faces_without_texture = 0;
  PolygonReader polygons(*this, budget);
  for_each_polygon(polygons, cancel, [&] {
    if (polygons.size() < 3) return;
    bool lacks_texture = false;
    for (size_t k = 0; k < polygons.size(); ++k)
      lacks_texture = lacks_texture || polygons.texcoord(k) >= texcoords_;
    if (lacks_texture) ++materials_.all()[polygons.material()].faces_without_texture;
  });
}

// Sets has_splits of each block of faces (block_index.h) in which some face cannot be triangulated
// as a fan around its first corner. Warns about faces whose edges cross.
void ObjFile::find_splits(MemoryBudget& budget, const CancelToken& cancel) {
  PolygonReader polygons(*this, budget);
  Positions vertices(*this, budget);
  polygon::FaceSplitter splitter(vertices, file_->path(), 1, budget);
  uint64_t doubtful = 0;
  std::string first_doubtful;
  for_each_polygon(polygons, cancel, [&] {
    if (polygons.size() < 4) return;
    if (!splitter.split(polygons.vertices()).empty())
      has_splits_ = face_index_.at(polygons.face()).has_splits = true;
    if (splitter.is_doubtful() && doubtful++ == 0) first_doubtful = polygons.place();
  });
  if (doubtful > 0)
    warnings_.add(
        polygon::crossing_edges(file_->path() + ": " + first_doubtful, "its edges", doubtful));
}

}  // namespace voxdag::obj
