#include "cli/query/attribute_options.h"

#include <charconv>

namespace voxdag::cli {
namespace {

voxdag_reader::Rgb parse_color(const std::string& text) {
  unsigned rgb = 0;
  const char* const end = text.data() + text.size();
  const auto [at, problem] = std::from_chars(text.data(), end, rgb, 16);
  if (text.size() != 6 || at != end || problem != std::errc())
    throw Error(ErrorCode::kInvalidInput, "--fill-color '" + text +
                                              "': expected six hexadecimal digits RRGGBB, for "
                                              "example ff8000 for orange");
  return {static_cast<unsigned char>(rgb >> 16), static_cast<unsigned char>(rgb >> 8),
          static_cast<unsigned char>(rgb)};
}

}  // namespace

void AttributeOptions::declare(Command& command) {
  command.text_option(
      "--fill-color", "RRGGBB", [this](const std::string& text) { fill_color = parse_color(text); },
      "if only one file has colors: the color of the cells in which this file has no voxel");
  command.edge_option(
      "--color-resolution", [this](uint64_t edge) { color_resolution = edge; },
      "maximum number of color cells per edge of the grid, a power of two such as 1024 or 1k; "
      "default: the finest color cells of the files");
  command.flag("--no-attributes", no_attributes,
               "write only the voxels, without colors and other attributes");
}

}  // namespace voxdag::cli
