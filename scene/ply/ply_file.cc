#include "scene/ply/ply_file.h"

#include <algorithm>
#include <optional>

#include "core/base/error.h"
#include "core/base/integers.h"
#include "scene/messages.h"
#include "scene/ply/vertex_reader.h"
#include "scene/polygon/face_splitter.h"
#include "scene/text/word_scanner.h"

namespace voxdag::ply {

PlyFile::PlyFile(std::unique_ptr<ReadableFile> file, MemoryBudget& budget,
                 const CancelToken& cancel)
    : file_(std::move(file)),
      header_(read_header(*file_, budget)),
      layout_(find_layout(header_, file_->path())),
      charge_(budget, "the rows of " + file_->path()) {
  warn_about_header();
  try {
    pass_over_elements(budget, cancel);
  } catch (const Error& error) {
    if (first_irregular_.empty()) throw;
    throw Error(error.code(),
                error.message() + "; the first row that is not one line: " + first_irregular_);
  }
  if (small_faces_ > 0)
    warn("degenerate-faces", "", "faces of fewer than three corners make no voxels", small_faces_);
  find_splits(budget, cancel);
}

void PlyFile::warn_about_header() {
  if (header_.ignored_lines > 0)
    warn("ignored-line", "line " + std::to_string(header_.first_ignored_line) + " of the header",
         "begins with " + header_.first_ignored_word + "; it is ignored", header_.ignored_lines);
}

std::unique_ptr<Rows> PlyFile::open_faces(RequestedProperties others, MemoryBudget& budget) const {
  others.indices = layout_.face_indices;
  return open_rows(*file_, header_.format, face_element(), others, budget);
}

StripReader PlyFile::open_strips(MemoryBudget& budget) const {
  return {*file_,
          header_.format,
          header_.elements[layout_.strips],
          layout_.strip_indices,
          vertex_element().count,
          budget};
}

// Reads all elements up to the last one that the layout uses. If some row is not exactly one line,
// also reads the elements after it, because such a file is valid only if no text follows its last
// element.
void PlyFile::pass_over_elements(MemoryBudget& budget, const CancelToken& cancel) {
  uint64_t begin = header_.data_begin;
  for (size_t i = 0; i < header_.elements.size(); ++i) {
    const auto is_ahead = [&](size_t element) { return element != Layout::kNone && element >= i; };
    const bool is_needed =
        is_ahead(layout_.vertex) || is_ahead(layout_.face) || is_ahead(layout_.strips);
    if (!is_needed && first_irregular_.empty()) return;
    begin = i == layout_.strips ? pass_over_strips(begin, budget, cancel)
                                : pass_over(i, begin, budget, cancel);
  }
  if (!first_irregular_.empty()) check_end(begin, budget);
}

// Returns the end of element `index`, which begins at offset `begin`. If its rows vary in size,
// reads them all, records the blocks of vertices and faces, and counts the triangles.
uint64_t PlyFile::pass_over(size_t index, uint64_t begin, MemoryBudget& budget,
                            const CancelToken& cancel) {
  const Element& element = header_.elements[index];
  if (index == layout_.vertex) vertices_begin_ = begin;
  const bool has_list = std::ranges::any_of(element.properties, &Property::is_list);
  const bool is_ascii = header_.format == Format::kAscii;
  if (element.properties.empty() || (!is_ascii && !has_list))
    return end_of_fixed_rows(element, begin);
  RequestedProperties requested;
  if (index == layout_.face) requested.indices = layout_.face_indices;
  const auto rows = open_rows(*file_, header_.format, element, requested, budget);
  for (uint64_t row = 0; row < element.count; ++row) {
    if (row % kBlockRows == 0) {
      cancel.check();
      note_row(index, begin);
    }
    try {
      begin = rows->read(row, begin);
    } catch (...) {
      if (first_irregular_.empty()) first_irregular_ = rows->first_irregular();
      throw;
    }
    if (index == layout_.face) note_face(rows->indices().size());
  }
  if (first_irregular_.empty()) first_irregular_ = rows->first_irregular();
  return begin;
}

uint64_t PlyFile::pass_over_strips(uint64_t begin, MemoryBudget& budget,
                                   const CancelToken& cancel) {
  StripReader strips = open_strips(budget);
  strips.seek({.offset = begin});
  for (;;) {
    const StripReader::Position position = strips.position();
    uint32_t corners[3];
    if (!strips.next(corners)) return strips.position().offset;
    if (strip_triangles_++ % kBlockRows != 0) continue;
    cancel.check();
    charge_.add(sizeof(position));
    strip_blocks_.push_back(position);
  }
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
  if (element == layout_.face) {
    charge_.add(sizeof(FaceBlock));
    face_blocks_.push_back({offset, face_triangles_, false});
  } else if (element == layout_.vertex) {
    charge_.add(sizeof(uint64_t));
    vertex_blocks_.push_back(offset);
  }
}

void PlyFile::note_face(size_t corners) {
  if (corners < 3)
    ++small_faces_;
  else
    face_triangles_ += corners - 2;
  if (corners > 3) face_blocks_.back().has_splits = true;
}

// Refuses a file with text after its last row.
void PlyFile::check_end(uint64_t offset, MemoryBudget& budget) const {
  WordScanner text(*file_, budget);
  text.begin_row(offset);
  const std::string_view word = text.word();
  if (!word.empty())
    refuse("has " + printable(word) + " after its last row, expected the end of the file");
}

// Finds the blocks whose faces are all fans (polygon/triangulator.h), and clears their has_splits.
// Warns about faces whose edges cross each other.
void PlyFile::find_splits(MemoryBudget& budget, const CancelToken& cancel) {
  if (std::ranges::none_of(face_blocks_, [](const FaceBlock& block) { return block.has_splits; }))
    return;
  const auto rows = open_faces({}, budget);
  VertexReader vertices(*this, layout_.axes, budget);
  polygon::FaceSplitter splitter(vertices, file_->path(), 1, budget);
  uint64_t doubtful = 0, first_doubtful = 0;
  for (size_t b = 0; b < face_blocks_.size(); ++b) {
    FaceBlock& block = face_blocks_[b];
    if (!block.has_splits) continue;
    cancel.check();
    block.has_splits = false;
    uint64_t offset = block.offset;
    const uint64_t end = std::min((b + 1) * kBlockRows, face_element().count);
    for (uint64_t row = b * kBlockRows; row < end; ++row) {
      offset = rows->read(row, offset);
      if (rows->indices().size() < 4) continue;
      if (!splitter.split(rows->indices()).empty()) block.has_splits = true;
      if (splitter.is_doubtful() && doubtful++ == 0) first_doubtful = row;
    }
  }
  if (doubtful > 0)
    warnings_.add(polygon::crossing_edges(
        file_->path() + ": face " + std::to_string(first_doubtful), "its edges", doubtful));
}

void PlyFile::warn(const char* code, const std::string& place, const std::string& message,
                   uint64_t count) {
  warnings_.add(
      {code, place.empty() ? file_->path() : file_->path() + ": " + place, message, count});
}

void PlyFile::refuse(const std::string& what) const { voxdag::refuse(file_->path(), what); }

}  // namespace voxdag::ply
