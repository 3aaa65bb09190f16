#include "scene/obj/file/vertex_reader.h"

#include <algorithm>

#include "scene/messages.h"
#include "scene/obj/file/numbers.h"
#include "scene/surface_numbers.h"
#include "scene/textures/linear_light.h"

namespace voxdag::obj {
namespace {

// Returns the linear light, 0 to 65535, of an sRGB channel of a vertex color. `full` is the value
// of full intensity in the file; larger values are clamped to it.
uint16_t light_of(double value, double full) {
  return value > 0 ? linear_light(std::min(value, full) / full) : 0;  // 0 for NaN
}

}  // namespace

StatementReader::StatementReader(const ObjFile& obj, Kind kind, MemoryBudget& budget)
    : obj_(obj),
      kind_(kind),
      count_(kind == Kind::kVertex ? obj.vertices() : obj.texcoords()),
      lines_(obj.file(), budget, LineReader::Join::kBackslash),
      next_(count_) {}

// Moves to the statement `first`, or to an earlier one in the same block (block_index.h). Continues
// from the current statement, unless `first` is before it or in a later block.
void StatementReader::seek(uint64_t first) {
  const auto& index = kind_ == Kind::kVertex ? obj_.vertex_index() : obj_.texcoord_index();
  const uint64_t block = index.block_begin(first);
  if (next_ <= first && next_ >= block) return;
  lines_.seek(index.at(first).offset, index.at(first).line);
  next_ = block;
}

// Returns the arguments of the next statement of the kind `kind_`. Throws if none is left: then the
// file has changed since it was opened.
std::string_view StatementReader::next() {
  while (lines_.next()) {
    const Statement statement = statement_of(lines_.text());
    if (statement.kind == kind_) return statement.arguments;
  }
  refuse(obj_.file().path(), "changed while it was read: expected a file that does not change");
}

void StatementReader::refuse_statement(const std::string& what) const {
  refuse(obj_.file().path(), (kind_ == Kind::kVertex ? "vertex " : "texture coordinates ") +
                                 std::to_string(next_ - 1) + " in line " +
                                 std::to_string(lines_.number()) + " " + what);
}

void Positions::read(uint64_t first, size_t count, double* out) {
  reader_.for_each(first, count, [&](std::string_view arguments) {
    const size_t found = read_numbers(arguments, out, 3);
    out += 3;
    if (found == 3) return;
    if (!has_word(arguments))
      reader_.refuse_statement("has " + std::to_string(found) + " numbers, expected three");
    reader_.refuse_statement("has " + printable(next_word(arguments)) + ", expected a number");
  });
}

void Colors::read(uint64_t first, size_t count, Color* out) {
  reader_.for_each(first, count, [&](std::string_view arguments) {
    double numbers[7];
    const size_t found = read_numbers(arguments, numbers, 7);
    out->fill(kFullIntensity);
    if (found >= 6)
      for (size_t c = 0; c < 3; ++c) (*out)[c] = light_of(numbers[3 + c], full_);
    if (found == 7) (*out)[3] = intensity_of(numbers[6] / full_);
    ++out;
  });
}

void TextureCoordinates::read(uint64_t first, size_t count, Coordinates* out) {
  reader_.for_each(first, count, [&](std::string_view arguments) {
    *out = {0, 0};
    read_numbers(arguments, out->data(), 2);
    ++out;
  });
}

}  // namespace voxdag::obj
