// The output of commands: JSON on standard output, and files.
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "cli/command.h"
#include "core/format/global/voxdag_reader.h"
#include "core/io/outputs/guarded_outputs.h"

namespace voxdag::cli {

// Prints the JSON, indented, with escapes for characters that are not printable, and U+FFFD for
// bytes that are not UTF-8.
void print_json(const nlohmann::ordered_json& json);
void print_json(const nlohmann::json& json);
// Prints the JSON on one line. For commands that print several objects over time: a reader can then
// parse each line as an object.
void print_json_line(const nlohmann::ordered_json& json);
void print_json_line(const nlohmann::json& json);
// Prints JSON text, with escapes for characters that are not printable.
void print_json_text(const std::string& json);

// Returns the resolution, the number of cells and the bytes of a section with colors or another
// attribute.
nlohmann::ordered_json section_facts(const voxdag_reader::ColorSection& section);
// Adds the members `colors` and `attributes` with the section_facts() of each attribute of the
// file. For materials, also adds their names.
void add_attribute_facts(const voxdag_reader::File& file, nlohmann::ordered_json& json);

// Returns true if voxdag wrote the file and the file has the type that the command is about to
// write. Such a file may be replaced without --force.
using IsOwnFile = std::function<bool(const ReadableFile& file)>;

// A file to write, and the option --force.
struct OutputFile {
  std::string path;
  bool force = false;
  void declare_force(Command& command);
  // Unless --force is given, makes `files` refuse to replace a file that another program creates at
  // the output's path or temporary path while the command runs (core/io/outputs/guarded_outputs.h).
  // Call it before check().
  void guard(GuardedOutputs& files) const;
  // Throws Error{kInvalidInput} if writing would destroy `input`. Unless --force is given, also
  // throws this error if writing would destroy a file for which `is_own` returns false. Makes the
  // same checks for path + ".partial", the temporary name of write_file_atomically(). Also throws
  // Error if the output's folder does not exist.
  void check(FileSystem& files, const std::string& input, const IsOwnFile& is_own) const;
  // Checks one name, such as path + ".partial", in the same way as check() above, but does not
  // check the folder.
  void check(FileSystem& files, const std::string& name, const std::string& input,
             const IsOwnFile& is_own) const;
};

}  // namespace voxdag::cli
