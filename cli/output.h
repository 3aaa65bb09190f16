// What commands write: JSON on standard output, and files.
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "cli/command.h"
#include "core/format/global/voxdag_reader.h"

namespace voxdag::cli {

// Prints one line. Bytes that are not UTF-8, as a path may have, are printed as U+FFFD.
void print_json(const nlohmann::ordered_json& json);
void print_json(const nlohmann::json& json);

// Resolution, cells and bytes of a section that the file has.
nlohmann::ordered_json section_facts(const voxdag_reader::ColorSection& section);
// Those of all that it has, as the members `colors` and `attributes`; the latter has the names of
// materials, too.
void add_attribute_facts(const voxdag_reader::File& file, nlohmann::ordered_json& json);

// Whether voxdag wrote the file with a command of this kind.
using IsOwnFile = std::function<bool(const ReadableFile& file)>;

// A file to write, and the option --force.
struct OutputFile {
  std::string path;
  bool force = false;
  void declare_force(Command& command);
  // Throws Error{kInvalidInput} if writing would destroy something: the `input` whatever the
  // options, another file that is not `is_own` without --force. Checks path + ".partial" as well,
  // under which write_file_atomically() writes, and that the folder is there.
  void check(FileSystem& files, const std::string& input, const IsOwnFile& is_own) const;
  // The same for one name.
  void check(FileSystem& files, const std::string& name, const std::string& input,
             const IsOwnFile& is_own) const;
};

}  // namespace voxdag::cli
