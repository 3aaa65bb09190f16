// A file of points, as a format reads it: the input of a point scene. A format implements only the
// reading of its files; PointCursor has the code that all formats share.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/warning.h"
#include "core/io/file_system.h"

namespace voxdag::points {

// Reads the points of a file for one thread. Not thread-safe.
class PointReader {
 public:
  // Red, green, blue (linear) and alpha in the units of SurfaceCorner.
  using Color = std::array<uint16_t, 4>;

  virtual ~PointReader() = default;
  // Writes the positions of points [first, first + count) to `xyz`, three doubles each. An invalid
  // point has a coordinate that is not finite. Reading is fastest if each call begins where the
  // last one ended, or at a multiple of 1024.
  virtual void read(uint64_t first, size_t count, double* xyz) = 0;
  // Writes the colors of points [first, first + count). Called only if the file has colors. The
  // color of an invalid point is undefined.
  virtual void read_colors(uint64_t first, size_t count, Color* out) = 0;
  // Returns the reason why a point is invalid, with its place in the file, for messages.
  virtual std::string fault_of(uint64_t point) = 0;
};

// An open file of points. Any number of readers may read concurrently.
class PointFile {
 public:
  virtual ~PointFile() = default;
  virtual const ReadableFile& file() const = 0;
  virtual uint64_t count() const = 0;
  virtual bool has_colors() const = 0;
  // True if SceneOptions::columns can name the columns of the file.
  virtual bool has_columns() const { return false; }
  virtual std::vector<Warning> warnings() const { return {}; }
  // Returns a reader. `readers` is the number of readers that share the budget. The file and the
  // budget must outlive the reader.
  virtual std::unique_ptr<PointReader> open(unsigned readers, MemoryBudget& budget) const = 0;
};

}  // namespace voxdag::points
