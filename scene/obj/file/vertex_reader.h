// Reads the numbers of the v or vt statements of an OBJ file. Not thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "scene/obj/file/obj_file.h"
#include "scene/obj/file/statement.h"
#include "scene/text/line_reader.h"
#include "scene/vertices/position_source.h"

namespace voxdag::obj {

// Visits the statements of one kind (v or vt), starting at any statement.
class StatementReader {
 public:
  // `kind` is kVertex or kTexture. The file must outlive the reader.
  StatementReader(const ObjFile& obj, Kind kind, MemoryBudget& budget);

  uint64_t count() const { return count_; }
  // Calls body(arguments) for statements [first, first + count), which must exist.
  template <class Body>
  void for_each(uint64_t first, size_t count, const Body& body) {
    seek(first);
    for (const uint64_t end = first + count; next_ < end;) {
      const std::string_view arguments = next();
      if (++next_ > first) body(arguments);
    }
  }
  // Throws Error{kInvalidInput} with a message about the last statement that for_each() passed to
  // body().
  [[noreturn]] void refuse_statement(const std::string& what) const;

 private:
  void seek(uint64_t first);
  std::string_view next();

  const ObjFile& obj_;
  const Kind kind_;
  const uint64_t count_;
  LineReader lines_;
  uint64_t next_;  // number of the next statement; initially count_, past the end
};

// The positions of the vertices.
class Positions : public PositionSource {
 public:
  Positions(const ObjFile& obj, MemoryBudget& budget) : reader_(obj, Kind::kVertex, budget) {}

  uint64_t count() const override { return reader_.count(); }
  void read(uint64_t first, size_t count, double* out) override;

 private:
  StatementReader reader_;
};

// The colors of the vertices in the units of SurfaceCorner. A vertex without a color is white.
class Colors {
 public:
  using Color = std::array<uint16_t, 4>;

  Colors(const ObjFile& obj, MemoryBudget& budget)
      : reader_(obj, Kind::kVertex, budget), full_(obj.full_color()) {}
  void read(uint64_t first, size_t count, Color* out);

 private:
  StatementReader reader_;
  const double full_;
};

// The texture coordinates u and v, as in the file. A missing v is 0.
class TextureCoordinates {
 public:
  using Coordinates = std::array<double, 2>;

  TextureCoordinates(const ObjFile& obj, MemoryBudget& budget)
      : reader_(obj, Kind::kTexture, budget) {}
  void read(uint64_t first, size_t count, Coordinates* out);

 private:
  StatementReader reader_;
};

}  // namespace voxdag::obj
