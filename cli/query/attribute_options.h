// The options --fill-color, --color-resolution and --no-attributes of the commands that combine
// files.
#pragma once

#include <optional>
#include <string>

#include "cli/command.h"
#include "query/combine/combine.h"

namespace voxdag::cli {

struct AttributeOptions {
  std::optional<voxdag_reader::Rgb> fill_color;
  uint64_t color_resolution = 0;
  bool no_attributes = false;

  void declare(Command& command);
  // Sets these options in a query::CombineSpec or an EditSpec.
  template <class Spec>
  void apply(Spec& spec) const {
    spec.fill_color = fill_color;
    spec.color_resolution = color_resolution;
    spec.attributes = !no_attributes;
  }
};

}  // namespace voxdag::cli
