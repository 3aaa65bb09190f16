#include "core/io/overwrite.h"

#include <algorithm>
#include <vector>

#include "core/base/error.h"

namespace voxdag {

std::unique_ptr<ReadableFile> open_if_there(FileSystem& files, const std::string& path) {
  if (!files.exists(path)) return nullptr;
  try {
    return files.open_read(path);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound) throw;
    return nullptr;
  }
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

}  // namespace voxdag
