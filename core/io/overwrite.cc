#include "core/io/overwrite.h"

#include <algorithm>

#include "core/base/error.h"

namespace voxdag {

void refuse_input(FileSystem& files, const std::string& path, std::span<const std::string> inputs) {
  if (!files.exists(path)) return;
  const FileIdentity identity = files.open_read(path)->identity();
  for (const std::string& input : inputs)
    if (files.exists(input) && files.open_read(input)->identity() == identity)
      throw Error(ErrorCode::kInvalidInput, path +
                                                " is read and would be overwritten: expected "
                                                "another output");
}

void refuse_foreign_file(FileSystem& files, const std::string& path,
                         const std::function<bool(const ReadableFile& file)>& is_own,
                         const std::string& otherwise) {
  if (!files.exists(path)) return;
  const auto file = files.open_read(path);
  if (file->size() > 0 && !is_own(*file))
    throw Error(ErrorCode::kInvalidInput,
                path +
                    " exists and was not written by this command: expected a free name or that "
                    "of an earlier result" +
                    otherwise);
}

bool begins_with(const ReadableFile& file, std::string_view bytes) {
  std::string start(std::min<uint64_t>(file.size(), bytes.size()), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(start)));
  return bytes.starts_with(start);
}

}  // namespace voxdag
