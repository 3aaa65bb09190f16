#include "query/package/package_folder.h"

#include <set>

#include "core/base/error.h"
#include "core/io/overwrite.h"

namespace voxdag::query {
namespace {

constexpr const char* kWorkSuffix = ".work-";

// Returns `path` without slashes at its end. With a slash, the names of temporary files, which are
// `path` and a suffix, would be names in the folder itself. Throws Error{kInvalidInput} if the path
// has no name.
std::string without_slash(std::string path) {
  while (path.size() > 1 && path.ends_with('/')) path.pop_back();
  if (path.empty() || path == "/" || path == "." || path == "..")
    throw Error(ErrorCode::kInvalidInput,
                "the output '" + path + "': expected the name of a folder to write");
  return path;
}

bool is_folder(FileSystem& files, const std::string& path) {
  const std::string name = path.substr(path.rfind('/') + 1);
  for (const DirectoryEntry& entry : files.list(parent_directory(path)))
    if (entry.name == name) return entry.is_directory;
  return false;
}

PackageIndex index_of_folder(FileSystem& files, const std::string& folder) {
  const std::string path = folder + "/" + kIndexName;
  return parse_index(read_small_file(files, path, kMaxIndexBytes), path, PackageVersions::kKnown);
}

// Returns the names of all files of a package whose names contain a hash: all except package.json
// and index.html.
std::set<std::string> hashed_files(const PackageIndex& index) {
  std::set<std::string> names = {index.directory.name};
  if (!index.head.name.empty()) names.insert(index.head.name);
  for (const PackageFile& pack : index.packs) names.insert(pack.name);
  for (const PackageFile& file : index.viewer) names.insert(file.name);
  return names;
}

void refuse_other_folder(FileSystem& files, const std::string& path) {
  const std::string parent = parent_directory(path);
  if (!files.exists(parent))
    throw Error(ErrorCode::kNotFound,
                path + ": the folder " + parent + " does not exist: expected an existing folder");
  if (!files.exists(path)) return;
  const std::string advice = ": expected a new folder, an empty one or an earlier package";
  if (!is_folder(files, path))
    throw Error(ErrorCode::kInvalidInput, path + " is a file or a link" + advice);
  if (files.list(path).empty()) return;
  try {
    index_of_folder(files, path);
  } catch (const Error& error) {
    const bool is_of_a_package = error.code() == ErrorCode::kUnsupportedVersion;
    if (is_of_a_package || (error.code() != ErrorCode::kNotFound && !error.is_corruption())) throw;
    throw Error(ErrorCode::kInvalidInput, path + " has files that are not of a package" + advice);
  }
}

// True if the lock file of a killed process is still present. Throws Error{kInvalidInput} or
// Error{kNotFound} if no package can be written to `path`.
bool has_left_lock(FileSystem& files, const std::string& path) {
  refuse_other_folder(files, path);
  for (const char* name : {"index.html", kIndexName}) refuse_link(path + "/" + name);
  const auto lock = open_if_there(files, OutputLock::path_of(path));
  return lock && lock->size() == 0;
}

void remove_left_folders(FileSystem& files, const std::string& path) {
  constexpr size_t kRandomCharacters = 6;  // at the end of make_temporary_folder()'s names
  const std::string prefix = path.substr(path.rfind('/') + 1) + kWorkSuffix;
  const std::string parent = parent_directory(path);
  for (const DirectoryEntry& entry : files.list(parent))
    if (entry.is_directory && entry.name.starts_with(prefix) &&
        entry.name.size() == prefix.size() + kRandomCharacters)
      remove_tree(files, parent + "/" + entry.name);
}

const std::string& after_cleaning(FileSystem& files, const std::string& path, bool is_left) {
  if (is_left) remove_left_folders(files, path);
  return path;
}

}  // namespace

PackageFolder::PackageFolder(FileSystem& files, const std::string& path)
    : files_(files),
      path_(without_slash(path)),
      is_left_behind_(has_left_lock(files, path_)),
      lock_(files, path_),
      work_(files, after_cleaning(files, path_, is_left_behind_) + kWorkSuffix) {
  files_.make_directories(new_files());
}

void PackageFolder::publish(const PackageIndex& index) {
  files_.sync_directory(new_files());
  refuse_other_folder(files_, path_);  // checked again: another program can have created it since
  if (files_.exists(path_) && !files_.list(path_).empty()) {
    update(index);
  } else {
    if (files_.exists(path_)) files_.remove_directory(path_);
    if (!files_.rename_new(new_files(), path_))
      throw Error(ErrorCode::kInvalidInput,
                  path_ + " was created by another program: expected a new folder");
  }
  files_.sync_directory(parent_directory(path_));
}

// Replaces the existing package. First moves the new files whose names contain a hash: they do not
// overwrite files of the old package, because different contents have different names. Then
// replaces index.html and package.json. From then on, viewers read only the new files. At the end,
// removes the files that only the old package has.
void PackageFolder::update(const PackageIndex& index) {
  const std::set<std::string> old_files = hashed_files(index_of_folder(files_, path_)),
                              new_files = hashed_files(index);
  const auto move = [&](const std::string& name) {
    files_.rename(this->new_files() + "/" + name, path_ + "/" + name);
  };
  files_.make_directories(path_ + "/packs");
  for (const std::string& name : new_files) move(name);
  files_.sync_directory(path_ + "/packs");
  for (const char* name : {"index.html", kIndexName})
    if (files_.exists(this->new_files() + "/" + name)) move(name);
  files_.sync_directory(path_);
  for (const std::string& name : old_files)
    if (!new_files.contains(name) && files_.exists(path_ + "/" + name))
      files_.remove(path_ + "/" + name);
}

}  // namespace voxdag::query
