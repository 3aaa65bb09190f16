// Reads the polygons of an ASCII STL file one after another, and triangulates them. A polygon is a
// sequence of "vertex x y z" without another keyword in between; it usually has three vertices. All
// other words (normals, names, loops) do not affect the triangles. Keywords may be in upper or
// lower case. Line ends separate words like blanks; in addition, they end the names of solids. Not
// thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/polygon/triangulator.h"
#include "scene/text/line_reader.h"

namespace voxdag::stl {

class PolygonReader {
 public:
  // Maximum number of vertices of a polygon.
  static constexpr size_t kMaxCorners = 32768;

  // The file must outlive the reader.
  PolygonReader(const ReadableFile& file, MemoryBudget& budget)
      : file_(file),
        lines_(file, budget, LineReader::Join::kNone),
        triangulator_(budget, "a polygon of " + file.path()) {}

  // Moves to the polygon whose first word "vertex" is at `offset`, in line `line`.
  void seek(uint64_t offset, uint64_t line);
  // Reads the next polygon. Returns false at the end of the file. Throws Error{kInvalidInput} with
  // the line if a vertex does not have three numbers.
  bool next();

  // Returns the number of the polygon's triangles; 0 if it has fewer than three vertices.
  size_t triangles() const { return vertices_.size() < 3 ? 0 : vertices_.size() - 2; }
  // Returns vertex k of a triangle.
  const std::array<double, 3>& vertex(size_t triangle, size_t k) const;
  // True if the polygon is only read as a fan because its edges cross each other (triangulator.h).
  bool is_doubtful() const { return vertices_.size() > 3 && triangulator_.is_doubtful(); }
  // Return the offset in the file of the polygon's first vertex, and the number of its line.
  uint64_t offset() const { return offset_; }
  uint64_t line() const { return line_; }

  // True if the file ended within a facet.
  bool is_cut_off() const { return is_cut_off_; }
  // Number of words that are not part of STL, and the line of the first one.
  uint64_t unknown_words() const { return unknown_words_; }
  uint64_t first_unknown_line() const { return first_unknown_line_; }

 private:
  bool read_vertices();
  void triangulate();
  bool next_line();
  void skip(std::string_view word);
  void skip_unknown();
  void skip_words(bool (*is_end)(std::string_view word, std::string_view after));
  void skip_normal();
  void read_vertex();
  [[noreturn]] void refuse_line(const std::string& what) const;

  const ReadableFile& file_;
  LineReader lines_;
  std::string_view rest_;  // the part of the current line that is not read
  bool in_facet_ = false;
  bool is_name_next_ = false;  // the last line ended with "solid": the next may be the name
  bool is_cut_off_ = false;
  std::vector<std::array<double, 3>> vertices_;
  polygon::Triangulator triangulator_;
  std::vector<double> xyz_;          // a copy of the vertices, for triangulator_
  std::span<const uint32_t> split_;  // the triangles; empty if they are the fan of the polygon
  uint64_t offset_ = 0, line_ = 0;
  uint64_t unknown_words_ = 0, first_unknown_line_ = 0;
};

}  // namespace voxdag::stl
