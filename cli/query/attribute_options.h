// The options --fill-color and --no-attributes of the commands that combine files.
#pragma once

#include <optional>
#include <string>

#include "cli/command.h"
#include "query/combine/combine.h"

namespace voxdag::cli {

struct AttributeOptions {
  std::optional<voxdag_reader::Rgb> fill_color;
  bool no_attributes = false;

  void declare(Command& command);
  void apply(query::CombineSpec& spec) const {
    spec.fill_color = fill_color;
    spec.attributes = !no_attributes;
  }
};

}  // namespace voxdag::cli
