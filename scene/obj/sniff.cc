#include <algorithm>
#include <span>
#include <string>

#include "core/base/error.h"
#include "scene/obj/file/corners.h"
#include "scene/obj/file/numbers.h"
#include "scene/obj/file/statement.h"
#include "scene/obj/obj_scene.h"
#include "scene/text/line_reader.h"

namespace voxdag::obj {
namespace {

// A file that ends after the first kMaxSniffedBytes bytes of another file.
class FirstBytes : public ReadableFile {
 public:
  explicit FirstBytes(const ReadableFile& file) : file_(file) {}
  const std::string& path() const override { return file_.path(); }
  uint64_t size() const override { return std::min(file_.size(), kMaxSniffedBytes); }
  void read_at(uint64_t offset, std::span<std::byte> out) const override {
    file_.read_at(offset, out);
  }

 private:
  static constexpr uint64_t kMaxSniffedBytes = uint64_t{1} << 20;

  const ReadableFile& file_;
};

// True if the statement has the arguments of its kind. Lines of other text files rarely have them.
bool has_arguments(const Statement& statement) {
  std::string_view arguments = statement.arguments;
  double numbers[3];
  Corner corner;
  if (!has_word(arguments)) return false;
  switch (statement.kind) {
    case Kind::kVertex:
      return read_numbers(arguments, numbers, 3) == 3;
    case Kind::kTexture:
      return read_numbers(arguments, numbers, 1) == 1;
    case Kind::kFace:
    case Kind::kPointOrLine:
      return next_corner(arguments, corner);
    case Kind::kIgnored:
      return statement.keyword == "vn" && read_numbers(arguments, numbers, 3) == 3;
    default:
      return statement.kind == Kind::kUseMaterial || statement.kind == Kind::kLibrary;
  }
}

}  // namespace

bool is_obj(const ReadableFile& file) {
  MemoryBudget budget(UINT64_MAX);
  const FirstBytes first(file);
  LineReader lines(first, budget, LineReader::Join::kBackslash);
  try {
    while (lines.next()) {
      const std::string_view line = lines.text();
      if (line.find('\0') != line.npos) return false;
      const Statement statement = statement_of(line);
      if (has_arguments(statement)) return true;
      if (statement.kind == Kind::kUnknown) return false;
    }
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kLimit) throw;
  }
  return false;
}

}  // namespace voxdag::obj
