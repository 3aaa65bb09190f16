#include "core/io/file_system.h"

#include "core/base/error.h"

namespace voxdag {
namespace {

std::string contents_of(const ReadableFile& file, uint64_t limit_bytes) {
  if (file.size() > limit_bytes)
    throw Error(ErrorCode::kLimit, file.path() + " has " + std::to_string(file.size()) +
                                       " bytes, expected at most " + std::to_string(limit_bytes));
  std::string contents(file.size(), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(contents)));
  return contents;
}

}  // namespace

std::string parent_directory(const std::string& path) {
  const size_t end = path.find_last_not_of('/');
  if (end == std::string::npos) return path.empty() ? "." : "/";
  const size_t slash = path.find_last_of('/', end);
  if (slash == std::string::npos) return ".";
  const size_t last = path.find_last_not_of('/', slash);
  return last == std::string::npos ? "/" : path.substr(0, last + 1);
}

std::string read_small_file(FileSystem& files, const std::string& path, uint64_t limit_bytes) {
  return contents_of(*files.open_read(path), limit_bytes);
}

std::string read_own_file(FileSystem& files, const std::string& path, uint64_t limit_bytes) {
  return contents_of(*files.open_own(path), limit_bytes);
}

void remove_partial_file(FileSystem& files, const std::string& path) {
  try {
    files.remove(path + ".partial");
  } catch (const Error&) {
    // The next write replaces the file.
  }
}

void write_partial_file(FileSystem& files, const std::string& path, std::string_view contents) {
  const auto file = files.create(path + ".partial");
  try {
    file->write_at(0, std::as_bytes(std::span(contents)));
    file->sync();
    file->close();
  } catch (const Error&) {
    remove_partial_file(files, path);
    throw;
  }
}

void rename_partial_file(FileSystem& files, const std::string& path) {
  try {
    files.rename(path + ".partial", path);
  } catch (const Error&) {
    remove_partial_file(files, path);
    throw;
  }
}

void write_file_atomically(FileSystem& files, const std::string& path, std::string_view contents) {
  write_partial_file(files, path, contents);
  rename_partial_file(files, path);
  files.sync_directory(parent_directory(path));
}

void remove_entries(FileSystem& files, const std::string& path) {
  if (!files.exists(path)) return;
  for (const DirectoryEntry& entry : files.list(path)) {
    const std::string inner = path + "/" + entry.name;
    if (entry.is_directory)
      remove_tree(files, inner);
    else
      files.remove(inner);
  }
}

void remove_tree(FileSystem& files, const std::string& path) {
  remove_entries(files, path);
  if (files.exists(path)) files.remove_directory(path);
}

}  // namespace voxdag
