#include "core/io/overwrite.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <vector>

#include "core/base/error.h"

namespace voxdag {
namespace {

int errno_of(int result) { return result == 0 ? 0 : errno; }

int rename_after_check(const std::string& from, const std::string& to) {
  struct stat found {};
  if (lstat(to.c_str(), &found) == 0) return EEXIST;
  return errno_of(::rename(from.c_str(), to.c_str()));
}

}  // namespace

std::unique_ptr<ReadableFile> open_if_there(FileSystem& files, const std::string& path) {
  if (!files.exists(path)) return nullptr;
  try {
    return files.open_read(path);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound) throw;
    return nullptr;
  }
}

bool refuse_link(const std::string& path) {
  struct stat found {};
  if (lstat(path.c_str(), &found) != 0) return false;
  if (S_ISLNK(found.st_mode))
    throw Error(ErrorCode::kInvalidInput,
                path + " is a symbolic link: expected a regular file, or a free name");
  return true;
}

void refuse_inputs(FileSystem& files, std::span<const std::string> paths,
                   std::span<const std::string> inputs) {
  std::vector<FileIdentity> read;
  for (const std::string& input : inputs)
    if (const auto file = open_if_there(files, input)) read.push_back(file->identity());
  for (const std::string& path : paths) {
    const auto file = open_if_there(files, path);
    if (file && std::ranges::find(read, file->identity()) != read.end())
      throw Error(ErrorCode::kInvalidInput, path +
                                                " is an input and would be overwritten: expected "
                                                "another output");
  }
}

void refuse_foreign_file(FileSystem& files, const std::string& path,
                         const std::function<bool(const ReadableFile& file)>& is_own,
                         const std::string& otherwise) {
  const auto file = open_if_there(files, path);
  if (file && file->size() > 0 && !is_own(*file))
    throw Error(ErrorCode::kInvalidInput,
                path +
                    " exists and was not written by this command: expected a free name or the name "
                    "of an earlier result" +
                    otherwise);
}

bool begins_with(const ReadableFile& file, std::string_view bytes) {
  std::string start(std::min<uint64_t>(file.size(), bytes.size()), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(start)));
  return bytes.starts_with(start);
}

int rename_without_replacing(const std::string& from, const std::string& to) {
  const int reason =
      errno_of(renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE));
  const bool is_unsupported = reason == EINVAL || reason == ENOSYS;
  return is_unsupported ? rename_by_link(from, to) : reason;
}

int rename_by_link(const std::string& from, const std::string& to) {
  const int reason = errno_of(link(from.c_str(), to.c_str()));
  if (reason == 0) return errno_of(unlink(from.c_str()));
  const bool has_no_links = reason == EPERM || reason == EOPNOTSUPP || reason == ENOSYS;
  return has_no_links ? rename_after_check(from, to) : reason;
}

}  // namespace voxdag
