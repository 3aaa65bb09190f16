// The part of voxdag_reader.h that maps or reads files and reports errors. Copy all three
// voxdag_reader headers into your engine, and include voxdag_reader.h.
#pragma once

#ifdef _WIN32
#include <cstdio>
#else
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#endif

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

namespace voxdag_reader {

// The kinds of errors.
enum class Problem { kNotFound, kIo, kCorrupt, kUnsupportedVersion };

// The only exception that the reader throws, besides std::bad_alloc. Its message names the file.
// With VOXDAG_READER_NO_EXCEPTIONS, the reader throws nothing. Instead it calls error_handler, if
// one is set, and then std::abort(). The handler may log the error, or leave by longjmp.
class Error : public std::runtime_error {
 public:
  Error(Problem problem, const std::string& message)
      : std::runtime_error(message), problem_(problem) {}
  Problem problem() const { return problem_; }

 private:
  Problem problem_;
};
#ifdef VOXDAG_READER_NO_EXCEPTIONS
inline void (*error_handler)(Problem problem, const char* message) = nullptr;
#endif

[[noreturn]] inline void fail(Problem problem, const std::string& message) {
#ifdef VOXDAG_READER_NO_EXCEPTIONS
  if (error_handler) error_handler(problem, message.c_str());
  std::abort();
#else
  throw Error(problem, message);
#endif
}

// kMap maps the file; kRead reads all of it into memory.
enum class Access { kMap, kRead };

// The bytes of a file: mapped, read into memory, or in memory that belongs to the caller. On
// Windows, files are always read into memory.
class Bytes {
 public:
  Bytes(const std::string& path, Access access) {
#ifdef _WIN32
    (void)access;
    read_file(path);
#else
    const int fd = open_file(path);
    struct stat s;
    if (fstat(fd, &s) != 0 || !S_ISREG(s.st_mode)) {
      ::close(fd);
      fail(Problem::kIo, path + " is not a regular file: expected a .vdag file");
    }
    size_ = static_cast<uint64_t>(s.st_size);
    if (access == Access::kMap && size_ > 0) {
      void* const map = mmap(nullptr, size_, PROT_READ, MAP_SHARED, fd, 0);
      if (map != MAP_FAILED) map_ = map;
    }
    if (!map_) read_all(fd, path);
    ::close(fd);
#endif
  }
  // Uses `size` bytes at `data`, which must remain valid. Copies them if `data` is not aligned to 8
  // bytes; then they need not remain valid.
  Bytes(const void* data, uint64_t size) : size_(size) {
    if (reinterpret_cast<uintptr_t>(data) % 8 == 0) {
      borrowed_ = data;
    } else {
      allocate();
      std::memcpy(copy_.data(), data, static_cast<size_t>(size));
    }
  }
  Bytes(const Bytes&) = delete;
  Bytes& operator=(const Bytes&) = delete;
  ~Bytes() {
#ifndef _WIN32
    if (map_) munmap(map_, size_);
#endif
  }
  // Returns the bytes of the file. They are aligned to 8 bytes.
  const unsigned char* data() const {
    const void* const held = map_ ? map_ : copy_.data();
    return static_cast<const unsigned char*>(borrowed_ ? borrowed_ : held);
  }
  uint64_t size() const { return size_; }
  // Drops the resident pages of a mapping. They are loaded again when they are used.
  void release_pages() const {
#ifndef _WIN32
    if (map_) madvise(map_, size_, MADV_DONTNEED);
#endif
  }

 private:
  void allocate() { copy_.resize(static_cast<size_t>((size_ + 7) / 8)); }
#ifdef _WIN32
  void read_file(const std::string& path) {
    std::FILE* const file = std::fopen(path.c_str(), "rb");
    if (!file)
      fail(errno == ENOENT ? Problem::kNotFound : Problem::kIo,
           "open " + path + ": " + std::strerror(errno));
    const bool has_end = _fseeki64(file, 0, SEEK_END) == 0;
    const int64_t end = has_end ? _ftelli64(file) : -1;
    bool read = end >= 0 && _fseeki64(file, 0, SEEK_SET) == 0;
    if (read) {
      size_ = static_cast<uint64_t>(end);
      allocate();
      read = std::fread(copy_.data(), 1, static_cast<size_t>(size_), file) == size_;
    }
    std::fclose(file);
    if (!read)
      fail(Problem::kIo,
           "cannot read " + path + " completely: expected a file that no program changes");
  }
#else
  // Opens the file. Without O_NONBLOCK, opening a pipe would wait for its writer. The flag has no
  // effect on regular files.
  static int open_file(const std::string& path) {
    const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd >= 0) return fd;
    const Problem problem = errno == ENOENT || errno == ENOTDIR ? Problem::kNotFound : Problem::kIo;
    fail(problem, "open " + path + ": " + strerror(errno));
  }
  void read_all(int fd, const std::string& path) {
    allocate();
    char* const to = reinterpret_cast<char*>(copy_.data());
    for (uint64_t done = 0; done < size_;) {
      const ssize_t n = ::read(fd, to + done, static_cast<size_t>(size_ - done));
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) {
        const std::string why = n < 0 ? strerror(errno) : "the file is shorter now";
        ::close(fd);
        fail(Problem::kIo, "read " + path + ", byte " + std::to_string(done) + ": " + why);
      }
      done += static_cast<uint64_t>(n);
    }
  }
#endif

  void* map_ = nullptr;
  const void* borrowed_ = nullptr;
  std::vector<uint64_t> copy_;
  uint64_t size_ = 0;
};

}  // namespace voxdag_reader
