#include "query/export/export_file.h"

#include <algorithm>

#include "core/base/error.h"

namespace voxdag::query {
namespace {

constexpr size_t kBufferBytes = 1 << 20;

std::string partial_name(const std::string& path) { return path + ".partial"; }

}  // namespace

ExportFile::ExportFile(FileSystem& files, const std::string& path)
    : files_(files), path_(path), file_(files.create(partial_name(path))) {
  registered_.emplace(partial_name(path));
  buffer_.reserve(kBufferBytes);
}

ExportFile::~ExportFile() {
  if (published_) return;
  file_.reset();
  try {
    files_.remove(partial_name(path_));
  } catch (const Error&) {
    // An error here is ignored: the error that ended the export is reported.
  }
}

void ExportFile::flush() {
  if (!buffer_.empty()) file_->write_at(buffer_offset_, buffer_);
  buffer_offset_ += buffer_.size();
  buffer_.clear();
}

void ExportFile::seek(uint64_t offset) {
  flush();
  buffer_offset_ = offset;
}

void ExportFile::write(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const size_t count = std::min(bytes.size(), kBufferBytes - buffer_.size());
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(count));
    bytes = bytes.subspan(count);
    if (buffer_.size() == kBufferBytes) flush();
  }
  size_ = std::max(size_, buffer_offset_ + buffer_.size());
}

uint64_t ExportFile::publish(std::span<ExportFile* const> written) {
  uint64_t bytes = 0;
  for (ExportFile* const file : written) {
    file->flush();
    file->file_->sync();
    file->file_->close();
    bytes += file->size_;
  }
  for (ExportFile* const file : written) {
    file->files_.rename(partial_name(file->path_), file->path_);
    file->published_ = true;
    file->registered_.reset();
    file->files_.sync_directory(parent_directory(file->path_));
  }
  return bytes;
}

}  // namespace voxdag::query
