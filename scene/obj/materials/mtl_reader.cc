#include "scene/obj/materials/mtl_reader.h"

#include <algorithm>
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
      else if (current_ != kNone)
        read_statement(keyword, trimmed(arguments));
      else if (is_color_statement(keyword))
        warn("missing-material", printable(keyword) + " precedes the first newmtl; it is ignored");
    }
    return std::move(materials_);
  }

 private:
  static constexpr size_t kNone = ~size_t{0};
  static constexpr uint64_t kNodeBytes = 96;  // bytes of a hash table's node

  // True if read_statement() reads statements with this keyword.
  static bool is_color_statement(std::string_view keyword) {
    constexpr std::string_view kColorKeywords[] = {"Kd", "d", "Tr", "map_Kd", "map_d"};
    return std::ranges::any_of(
        kColorKeywords, [&](std::string_view name) { return equals_in_any_case(keyword, name); });
  }

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

  void read_statement(std::string_view keyword, std::string_view arguments) {
    LibraryMaterial& material = materials_[current_];
    const auto is = [&](std::string_view name) { return equals_in_any_case(keyword, name); };
    if (is("Kd"))
      read_diffuse(arguments, material);
    else if (is("d"))
      material.is_dissolved = read_opacity(keyword, arguments, material);
    else if (is("Tr") && !material.is_dissolved && read_opacity(keyword, arguments, material))
      material.opacity = 1 - material.opacity;
    else if (is("map_Kd"))
      material.diffuse_map = read_map(keyword, arguments);
    else if (is("map_d"))
      material.opacity_map = read_map(keyword, arguments);
  }

  // Reads "Kd r g b"; missing numbers equal the first.
  void read_diffuse(std::string_view arguments, LibraryMaterial& material) {
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
