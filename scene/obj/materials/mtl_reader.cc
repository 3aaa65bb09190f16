#include "scene/obj/materials/mtl_reader.h"

#include <unordered_map>

#include "scene/messages.h"
#include "scene/obj/file/numbers.h"
#include "scene/text/line_reader.h"

namespace voxdag::obj {
namespace {

class LibraryReader {
 public:
  LibraryReader(const ReadableFile& file, MemoryBudget& budget, GrowingCharge& charge,
                WarningList& warnings)
      : file_(file),
        charge_(charge),
        warnings_(warnings),
        lines_(file, budget, LineReader::Join::kBackslash) {}

  std::vector<LibraryMaterial> read() {
    while (lines_.next()) {
      std::string_view arguments = lines_.text();
      const std::string_view keyword = next_word(arguments);
      if (equals_in_any_case(keyword, "newmtl"))
        begin_material(trimmed(arguments));
      else
        read_statement(keyword, trimmed(arguments));
    }
    return std::move(materials_);
  }

 private:
  static constexpr size_t kNone = ~size_t{0};
  static constexpr uint64_t kNodeBytes = 96;  // bytes of a hash table's node

  void begin_material(std::string_view name) {
    if (name.empty()) warn("missing-material", "newmtl has no name; no face can use its material");
    const auto [place, is_new] = numbers_.try_emplace(std::string(name), materials_.size());
    current_ = place->second;
    if (is_new) {
      charge_.add(2 * (sizeof(LibraryMaterial) + name.size()) + kNodeBytes);
      materials_.emplace_back();
    } else {
      warn("duplicate-material",
           "material \"" + printable(name) + "\" is defined again; the last definition is used");
    }
    materials_[current_] = {};
    materials_[current_].name = name;
  }

  // Ignores statements that do not affect colors.
  void read_statement(std::string_view keyword, std::string_view arguments) {
    struct Statement {
      std::string_view keyword;
      void (LibraryReader::*read)(std::string_view keyword, std::string_view arguments,
                                  LibraryMaterial& material);
    };
    static constexpr Statement kStatements[] = {{"Kd", &LibraryReader::read_diffuse},
                                                {"d", &LibraryReader::read_dissolve},
                                                {"Tr", &LibraryReader::read_transparency},
                                                {"map_Kd", &LibraryReader::read_diffuse_map},
                                                {"map_d", &LibraryReader::read_opacity_map}};
    for (const Statement& statement : kStatements) {
      if (!equals_in_any_case(keyword, statement.keyword)) continue;
      if (current_ == kNone)
        return warn("missing-material",
                    printable(keyword) + " precedes the first newmtl; it is ignored");
      return (this->*statement.read)(keyword, arguments, materials_[current_]);
    }
  }

  // Reads "Kd r g b"; missing numbers equal the first.
  void read_diffuse(std::string_view, std::string_view arguments, LibraryMaterial& material) {
    std::array<double, 3> numbers;
    const size_t count = read_numbers(arguments, numbers.data(), numbers.size());
    if (count == 0)
      return warn("unsupported-color",
                  "Kd has " + shown(arguments) + ", expected red, green and blue; it is ignored");
    for (size_t c = count; c < numbers.size(); ++c) numbers[c] = numbers[0];
    material.diffuse = numbers;
  }

  static std::string shown(std::string_view arguments) {
    return arguments.empty() ? "nothing" : printable(arguments);
  }

  void read_dissolve(std::string_view keyword, std::string_view arguments,
                     LibraryMaterial& material) {
    material.is_dissolved = read_opacity(keyword, arguments, material);
  }

  // Reads Tr, which is 1 - opacity. Ignores it if the material has a valid statement d.
  void read_transparency(std::string_view keyword, std::string_view arguments,
                         LibraryMaterial& material) {
    if (!material.is_dissolved && read_opacity(keyword, arguments, material))
      material.opacity = 1 - material.opacity;
  }

  void read_diffuse_map(std::string_view keyword, std::string_view arguments,
                        LibraryMaterial& material) {
    material.diffuse_map = read_map(keyword, arguments);
  }

  void read_opacity_map(std::string_view keyword, std::string_view arguments,
                        LibraryMaterial& material) {
    material.opacity_map = read_map(keyword, arguments);
  }

  bool read_opacity(std::string_view keyword, std::string_view arguments,
                    LibraryMaterial& material) {
    std::string_view rest = arguments;
    if (next_word(rest) == "-halo") arguments = rest;
    double number;
    if (read_numbers(arguments, &number, 1) == 0) {
      warn("unsupported-color",
           printable(keyword) + " has " + shown(arguments) + ", expected a number; it is ignored");
      return false;
    }
    material.opacity = number;
    return true;
  }

  ImageMap read_map(std::string_view keyword, std::string_view arguments) {
    charge_.add(arguments.size());
    std::string unsupported;
    ImageMap map = parse_image_map(arguments, unsupported);
    if (!unsupported.empty())
      warn("ignored-map-options",
           "the options " + unsupported + " of " + printable(keyword) + " are ignored");
    if (map.file.empty())
      warn("missing-file", printable(keyword) + " has no name of an image; it is ignored");
    return map;
  }

  void warn(const char* code, const std::string& message) {
    warnings_.add({code, file_.path() + ": line " + std::to_string(lines_.number()), message});
  }

  const ReadableFile& file_;
  GrowingCharge& charge_;
  WarningList& warnings_;
  LineReader lines_;
  std::vector<LibraryMaterial> materials_;
  std::unordered_map<std::string, size_t> numbers_;
  size_t current_ = kNone;
};

}  // namespace

std::vector<LibraryMaterial> read_library(const ReadableFile& file, MemoryBudget& budget,
                                          GrowingCharge& charge, WarningList& warnings) {
  return LibraryReader(file, budget, charge, warnings).read();
}

}  // namespace voxdag::obj
