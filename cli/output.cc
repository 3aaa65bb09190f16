#include "cli/output.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/text/printable.h"
#include "core/fields/json_text.h"
#include "core/format/global/open_global.h"
#include "core/io/overwrite.h"

namespace voxdag::cli {
namespace {

constexpr int kIndent = 2, kOneLine = -1;

template <class Json>
void print_with_indent(const Json& json, int indent) {
  print_json_text(json_text(json, indent));
}

}  // namespace

void print_json_text(const std::string& json) { std::printf("%s\n", printable_json(json).c_str()); }
void print_json(const nlohmann::ordered_json& json) { print_with_indent(json, kIndent); }
void print_json(const nlohmann::json& json) { print_with_indent(json, kIndent); }
void print_json_line(const nlohmann::ordered_json& json) { print_with_indent(json, kOneLine); }
void print_json_line(const nlohmann::json& json) { print_with_indent(json, kOneLine); }

nlohmann::ordered_json section_facts(const voxdag_reader::ColorSection& section) {
  // `cells` counts the cells of all levels. `bytes` counts the encoded blocks and the directory
  // entries of the regions.
  uint64_t cells = 0, bytes = 0;
  for (uint32_t t = 0; t < section.tier_count(); ++t) {
    const voxdag_reader::ColorTier& tier = section.tier(t);
    cells += tier.cell_count;
    bytes += 16 * tier.units + 32 * tier.region_count;
  }
  return {{"resolution", int64_t{1} << section.color_levels()}, {"cells", cells}, {"bytes", bytes}};
}

void add_attribute_facts(const voxdag_reader::File& file, nlohmann::ordered_json& json) {
  for (const Attribute attribute : attributes_of(file).list()) {
    const voxdag_reader::ColorSection& section = section_of(file, attribute);
    nlohmann::ordered_json facts = section_facts(section);
    if (!section.names().empty()) facts["names"] = section.names();
    if (traits_of(attribute).is_color())
      json["colors"] = facts;
    else
      json["attributes"][name_of(attribute)] = facts;
  }
}

void OutputFile::declare_force(Command& command) {
  command.flag("--force", force, "replace a file that this command has not written");
}

void OutputFile::guard(GuardedOutputs& files) const {
  if (!force) files.guard_output(path);
}

void OutputFile::check(FileSystem& files, const std::string& input, const IsOwnFile& is_own) const {
  check(files, path, input, is_own);
  check(files, path + ".partial", input, is_own);
  const std::string folder = parent_directory(path);
  if (!files.exists(folder))
    throw Error(ErrorCode::kNotFound,
                path + ": the folder " + folder + " does not exist: expected an existing folder");
}

void OutputFile::check(FileSystem& files, const std::string& name, const std::string& input,
                       const IsOwnFile& is_own) const {
  refuse_link(name);
  refuse_inputs(files, std::span(&name, 1), std::span(&input, 1));
  if (!force) refuse_foreign_file(files, name, is_own, " (--force replaces it)");
}

}  // namespace voxdag::cli
