#include "query/dag/locked_outputs.h"

#include <array>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/io/overwrite.h"

namespace voxdag::query {
namespace {

std::string partial_path(const std::string& output) { return output + ".partial"; }

void refuse_impossible(FileSystem& files, const Outputs& outputs) {
  for (const std::string& path : outputs.paths) {
    if (path.empty() || path.ends_with('/'))
      throw Error(ErrorCode::kInvalidInput,
                  "the output '" + path + "': expected the name of a file to write");
    const std::array<std::string, 2> names = {path, partial_path(path)};
    for (const std::string& name : names) refuse_link(name);
    refuse_inputs(files, names, outputs.inputs);
    const std::string folder = parent_directory(path);
    if (!files.exists(folder))
      throw Error(ErrorCode::kNotFound,
                  path + ": the folder " + folder + " does not exist: expected an existing folder");
  }
}

void refuse_replacing(FileSystem& files, const Outputs& outputs) {
  if (outputs.replace) return;
  for (const std::string& path : outputs.paths)
    for (const std::string& name : {path, partial_path(path)}) {
      const auto file = open_if_there(files, name);
      if (file && file->size() > 0)
        throw Error(ErrorCode::kInvalidInput, name + " exists: expected another output, or " +
                                                  option_text("force") + " to replace it");
    }
}

// True if a writer of `output` was killed and its temporary files can be removed. This is the case
// if there is an empty lock file, but no work folder of a build. A lock file that is not empty was
// not created by voxdag. The files of a killed build are kept, because the build can resume from
// them.
bool is_left_behind(FileSystem& files, const std::string& output) {
  const auto lock = open_if_there(files, OutputLock::path_of(output));
  return lock && lock->size() == 0 && !files.exists(output + ".work");
}

void remove_leftovers(FileSystem& files, const Outputs& outputs) {
  for (const std::string& path : outputs.paths)
    if (open_if_there(files, partial_path(path))) files.remove(partial_path(path));
  // Number of random characters at the end of the names that make_temporary_folder() creates.
  constexpr size_t kRandomCharacters = 6;
  const std::string& output = outputs.paths[0];
  const std::string folder = parent_directory(output);
  const std::string prefix = output.substr(output.rfind('/') + 1) + ".work-";
  for (const DirectoryEntry& entry : files.list(folder))
    if (entry.is_directory && entry.name.starts_with(prefix) &&
        entry.name.size() == prefix.size() + kRandomCharacters)
      remove_tree(files, folder + "/" + entry.name);
}

// Checks the outputs before this process creates the lock file. Otherwise, if the process were
// killed between the lock and the check, its lock file could remain next to a file PATH.partial of
// another program, and the next run would remove that file. Returns true if a killed process left
// its files.
bool check_outputs(FileSystem& files, const Outputs& outputs) {
  refuse_impossible(files, outputs);
  const bool left_behind = is_left_behind(files, outputs.paths[0]);
  if (!left_behind) refuse_replacing(files, outputs);
  return left_behind;
}

}  // namespace

LockedOutputs::LockedOutputs(FileSystem& files, const Outputs& outputs)
    : is_left_behind_(check_outputs(files, outputs)),
      lock_(files, outputs.paths[0]),
      guarded_(files) {
  if (is_left_behind_) remove_leftovers(files, outputs);
  if (!outputs.replace)
    for (const std::string& path : outputs.paths) guarded_.guard_output(path);
  refuse_replacing(files, outputs);
}

}  // namespace voxdag::query
