#include "scene/ply/ply_file.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/integers.h"
#include "scene/messages.h"
#include "scene/ply/numbers.h"

namespace voxdag::ply {
namespace {

size_t find_element(const Header& header, const char* name) {
  return static_cast<size_t>(std::ranges::find(header.elements, name, &Element::name) -
                             header.elements.begin());
}

size_t find_property(const Element& element, const char* name) {
  return static_cast<size_t>(std::ranges::find(element.properties, name, &Property::name) -
                             element.properties.begin());
}

}  // namespace

PlyFile::PlyFile(std::unique_ptr<ReadableFile> file, MemoryBudget& budget,
                 const CancelToken& cancel)
    : file_(std::move(file)),
      header_(read_header(*file_, budget)),
      vertex_(find_element(header_, "vertex")),
      face_(find_element(header_, "face")),
      charge_(budget, "the rows of " + file_->path()) {
  const size_t none = header_.elements.size();
  if (find_element(header_, "tristrips") != none)
    refuse("has an element tristrips, which voxdag does not read, expected an element face");
  if (vertex_ == none) refuse("has no element vertex");
  find_vertex_properties();
  if (face_ == none)
    warnings_.push_back(file_->path() + ": has no element face, points make no voxels");
  else
    find_face_list();
  const size_t last = face_ == none ? vertex_ : std::max(vertex_, face_);
  uint64_t begin = header_.data_begin;
  for (size_t i = 0; i <= last; ++i) begin = pass_over(i, begin, budget, cancel);
}

std::unique_ptr<Rows> PlyFile::open_faces(MemoryBudget& budget) const {
  return open_rows(*file_, header_.format, header_.elements[face_], face_list_, budget);
}

void PlyFile::find_vertex_properties() {
  const Element& vertex = header_.elements[vertex_];
  if (vertex.count >= kNoVertex)
    throw Error(ErrorCode::kLimit, file_->path() + ": has " + std::to_string(vertex.count) +
                                       " vertices, the limit is 2^32 - 2");
  for (const Property& property : vertex.properties)
    if (property.is_list) refuse("has a list as a property of its vertices, expected numbers");
  constexpr const char* kNames[] = {"x", "y", "z"};
  for (size_t a = 0; a < 3; ++a) {
    axes_[a] = find_property(vertex, kNames[a]);
    if (axes_[a] == vertex.properties.size())
      refuse(std::string("has vertices without a property ") + kNames[a]);
  }
  for (const char* name : {"red", "green", "blue", "alpha"}) {
    const size_t property = find_property(vertex, name);
    if (property < vertex.properties.size())
      colors_.push_back(property);
    else if (name[0] != 'a')
      return colors_.clear();
  }
}

void PlyFile::find_face_list() {
  const Element& face = header_.elements[face_];
  face_list_ = find_property(face, "vertex_indices");
  if (face_list_ == face.properties.size()) face_list_ = find_property(face, "vertex_index");
  if (face_list_ == face.properties.size())
    refuse("has faces without a property vertex_indices or vertex_index");
  const Property& list = face.properties[face_list_];
  if (!list.is_list || !is_integer(list.type))
    refuse("has faces whose property " + list.name + " is not a list of integers");
}

// Returns the end of element `index`, which begins at offset `begin`. If its rows vary in size,
// reads them all, records the blocks of vertices and faces, and counts the triangles.
uint64_t PlyFile::pass_over(size_t index, uint64_t begin, MemoryBudget& budget,
                            const CancelToken& cancel) {
  const Element& element = header_.elements[index];
  if (index == vertex_) vertices_begin_ = begin;
  const bool has_list = std::ranges::any_of(element.properties, &Property::is_list);
  const bool is_ascii = header_.format == Format::kAscii;
  if (element.properties.empty() || (!is_ascii && !has_list))
    return end_of_fixed_rows(element, begin);
  const auto rows = open_rows(*file_, header_.format, element,
                              index == face_ ? face_list_ : Rows::kNoList, budget);
  uint64_t too_small = 0;
  for (uint64_t row = 0; row < element.count; ++row) {
    if (row % kBlockRows == 0) {
      cancel.check();
      note_row(index, begin);
    }
    begin = rows->read(row, begin);
    if (index != face_) continue;
    const size_t corners = rows->entries().size();
    if (corners < 3)
      ++too_small;
    else
      triangles_ += corners - 2;
  }
  if (too_small > 0)
    warnings_.push_back(file_->path() + ": has " + std::to_string(too_small) +
                        " faces of fewer than three corners, which make no voxels");
  return begin;
}

uint64_t PlyFile::end_of_fixed_rows(const Element& element, uint64_t begin) const {
  uint64_t row_bytes = 0;
  for (const Property& property : element.properties) row_bytes += bytes_of(property.type);
  const uint128 end = begin + static_cast<uint128>(element.count) * row_bytes;
  if (end > file_->size())
    refuse("its " + std::to_string(element.count) + " rows of element " + printable(element.name) +
           ", " + std::to_string(row_bytes) + " bytes each, end past the " +
           std::to_string(file_->size()) + " bytes of the file");
  return static_cast<uint64_t>(end);
}

// Records the offset of the first row of a block, if the element is the vertices or the faces.
void PlyFile::note_row(size_t element, uint64_t offset) {
  if (element == face_) {
    charge_.add(sizeof(FaceBlock));
    face_blocks_.push_back({offset, triangles_});
  } else if (element == vertex_) {
    charge_.add(sizeof(uint64_t));
    vertex_blocks_.push_back(offset);
  }
}

void PlyFile::refuse(const std::string& what) const { voxdag::refuse(file_->path(), what); }

}  // namespace voxdag::ply
