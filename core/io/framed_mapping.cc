#include "core/io/framed_mapping.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "core/base/error.h"
#include "core/base/process_limits.h"

namespace voxdag {
namespace {

[[noreturn]] void fail(const char* call, const std::string& path) {
  throw Error(code_of_errno(errno), std::string(call) + " " + path + ": " + errno_text(errno));
}

// The open file. Closes its descriptor.
class OpenFile {
 public:
  explicit OpenFile(const std::string& path) : path_(path) {
    do fd_ = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_NOFOLLOW | O_CLOEXEC);
    while (fd_ < 0 && errno == EINTR);
    if (fd_ < 0 && errno == ELOOP)
      throw Error(ErrorCode::kInvalidInput,
                  path + " is a symbolic link: expected a regular file that voxdag wrote");
    if (fd_ < 0) fail("open", path);
  }
  ~OpenFile() { ::close(fd_); }
  OpenFile(const OpenFile&) = delete;
  int descriptor() const { return fd_; }

  struct stat status() const {
    struct stat s {};
    if (fstat(fd_, &s) != 0) fail("check the type of", path_);
    if (!S_ISREG(s.st_mode))
      throw Error(ErrorCode::kInvalidInput, path_ + " is not a regular file: expected a file");
    return s;
  }
  void read(uint64_t offset, std::span<std::byte> out) const {
    while (!out.empty()) {
      const ssize_t n = pread(fd_, out.data(), out.size(), static_cast<off_t>(offset));
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) fail("read", path_);
      if (n == 0)
        throw Error(ErrorCode::kCorrupt, path_ + " ends at byte " + std::to_string(offset) +
                                             ": expected at least " +
                                             std::to_string(offset + out.size()) + " bytes");
      offset += static_cast<uint64_t>(n);
      out = out.subspan(static_cast<size_t>(n));
    }
  }

 private:
  const std::string path_;
  int fd_ = -1;
};

}  // namespace

// The pages that contain the head or the tail are anonymous memory: the file's other bytes of these
// pages are copied. The pages between them are mapped.
FramedMapping::FramedMapping(const std::string& path, std::span<const std::byte> head,
                             uint64_t tail_offset, std::span<const std::byte> tail) {
  const OpenFile file(path);
  const struct stat status = file.status();
  if (head.size() > tail_offset || static_cast<uint64_t>(status.st_size) < tail_offset)
    throw Error(ErrorCode::kCorrupt, path + " has " + std::to_string(status.st_size) +
                                         " bytes: expected at least " +
                                         std::to_string(tail_offset));
  inode_ = status.st_ino;
  const auto page = static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
  const uint64_t begin = std::min((head.size() + page - 1) / page * page, tail_offset);
  const uint64_t end = std::max(tail_offset / page * page, begin);
  const uint64_t bytes = std::max<uint64_t>(tail_offset + tail.size(), 1);
  void* const memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE,
                            MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (memory == MAP_FAILED) fail("reserve addresses for", path);
  data_ = static_cast<std::byte*>(memory);
  size_ = bytes;
  try {
    file.read(0, {data_, begin});
    file.read(end, {data_ + end, tail_offset - end});
    std::ranges::copy(head, data_);
    std::ranges::copy(tail, data_ + tail_offset);
    if (mprotect(data_, bytes, PROT_READ) != 0) fail("protect the mapping of", path);
    if (end > begin && mmap(data_ + begin, end - begin, PROT_READ, MAP_SHARED | MAP_FIXED,
                            file.descriptor(), static_cast<off_t>(begin)) == MAP_FAILED)
      fail("map", path);
  } catch (...) {
    munmap(data_, size_);
    throw;
  }
}

FramedMapping::~FramedMapping() { munmap(data_, size_); }

}  // namespace voxdag
