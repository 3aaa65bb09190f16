#include <algorithm>

#include "scene/obj/file/numbers.h"
#include "scene/obj/materials/mtl_reader.h"

namespace voxdag::obj {
namespace {

// An option of a map statement. Its value is one or more numbers, or one word. Some values change
// how texels of the image are looked up.
struct MapOption {
  std::string_view name;
  size_t max_numbers;             // 0: the option takes a word
  std::string_view neutral = {};  // word that keeps the lookup unchanged; "": every word does
};

constexpr MapOption kMapOptions[] = {
    {"-s", 3},      {"-o", 3},     {"-t", 3},         {"-mm", 2},
    {"-bm", 1},     {"-boost", 1}, {"-texres", 0},    {"-blendu", 0},
    {"-blendv", 0}, {"-clamp", 0}, {"-cc", 0, "off"}, {"-imfchan", 0, "rgb"},
    {"-type", 0},
};

const MapOption* option_named(std::string_view word) {
  const auto found = std::ranges::find_if(
      kMapOptions, [&](const MapOption& option) { return equals_in_any_case(option.name, word); });
  return found == std::end(kMapOptions) ? nullptr : found;
}

// True if these numbers of the option -t or -mm change the lookup.
bool changes_lookup(std::string_view option, const double* numbers, size_t count) {
  if (option == "-t") return std::any_of(numbers, numbers + count, [](double n) { return n != 0; });
  if (option == "-mm") return count > 0 && (numbers[0] != 0 || (count > 1 && numbers[1] != 1));
  return false;
}

void apply_numbers(std::string_view option, const double* numbers, size_t count, ImageMap& out) {
  std::array<double, 2>* const target = option == "-s"   ? &out.scale
                                        : option == "-o" ? &out.offset
                                                         : nullptr;
  if (target) std::copy_n(numbers, std::min<size_t>(count, 2), target->begin());
}

}  // namespace

ImageMap parse_image_map(std::string_view arguments, std::string& unsupported) {
  ImageMap map;
  for (;;) {
    std::string_view rest = arguments;
    const MapOption* const option = option_named(next_word(rest));
    if (!option) break;
    bool is_supported = true;
    if (option->max_numbers > 0) {
      double numbers[3] = {};
      const size_t count = read_numbers(rest, numbers, option->max_numbers);
      apply_numbers(option->name, numbers, count, map);
      is_supported = !changes_lookup(option->name, numbers, count);
    } else {
      const std::string_view word = next_word(rest);
      if (option->name == "-clamp") map.is_clamped = equals_in_any_case(word, "on");
      is_supported = option->neutral.empty() || equals_in_any_case(word, option->neutral);
    }
    if (!is_supported) unsupported += (unsupported.empty() ? "" : ", ") + std::string(option->name);
    arguments = rest;
  }
  map.file = trimmed(arguments);
  return map;
}

}  // namespace voxdag::obj
