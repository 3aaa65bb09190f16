#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <utility>

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/io/file_system.h"
#include "core/io/overwrite.h"

namespace voxdag {
namespace {

[[noreturn]] void fail(const char* call, const std::string& path, int reason) {
  throw Error(code_of_errno(reason), std::string(call) + " " + path + ": " + errno_text(reason));
}

[[noreturn]] void not_a_folder(const std::string& path) {
  throw Error(ErrorCode::kInvalidInput, path + " is a file: expected a folder");
}

// A file descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() { release(); }
  int get() const { return fd_; }
  int take() { return std::exchange(fd_, -1); }
  // Closes the descriptor and returns the errno of close(), or 0.
  int release() {
    const int fd = take();
    return fd >= 0 && ::close(fd) != 0 ? errno : 0;
  }

 private:
  int fd_;
};

int open_retrying(const std::string& path, int flags) {
  int fd;
  do fd = ::open(path.c_str(), flags | O_CLOEXEC, 0666);
  while (fd < 0 && errno == EINTR);
  return fd;
}

enum class Contents { kKeep, kEmpty };

// Opens or creates a file for writing, and returns its descriptor. Refuses symbolic and hard links,
// because writing through a link would change a file elsewhere. Accepts character devices.
int open_to_change(const char* call, const std::string& path, Contents contents) {
  const auto refuse = [&](const char* what) {
    throw Error(ErrorCode::kInvalidInput,
                path + " is " + what + ": expected a regular file with one name, or a free name");
  };
  const int fd = open_retrying(path, O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK);
  if (fd < 0 && errno == ELOOP) refuse("a symbolic link");
  if (fd < 0) fail(call, path, errno);
  Descriptor opened(fd);
  struct stat s {};
  if (fstat(fd, &s) != 0) fail("check the type of", path, errno);
  if (S_ISREG(s.st_mode) && s.st_nlink > 1) refuse("a file with several names (hard links)");
  if (!S_ISREG(s.st_mode) && !S_ISCHR(s.st_mode)) refuse("not a regular file");
  if (contents == Contents::kEmpty && s.st_size > 0 && ftruncate(fd, 0) != 0)
    fail("empty", path, errno);
  return opened.take();
}

[[noreturn]] void refuse_own_link(const std::string& path) {
  throw Error(ErrorCode::kInvalidInput,
              path + " is a symbolic link: expected a regular file that voxdag wrote");
}

FileIdentity identity_of(const struct stat& s) {
  const auto nanoseconds = [](const timespec& t) {
    return int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
  };
  return {s.st_ino, static_cast<uint64_t>(s.st_size), nanoseconds(s.st_mtim),
          nanoseconds(s.st_ctim)};
}

class PosixReadableFile : public ReadableFile {
 public:
  // `more_flags` is O_NOFOLLOW or 0.
  explicit PosixReadableFile(const std::string& path, int more_flags = 0)
      : path_(path), fd_(open_retrying(path, O_RDONLY | O_NONBLOCK | O_NOCTTY | more_flags)) {
    if (fd_.get() < 0 && errno == ELOOP && more_flags == O_NOFOLLOW) refuse_own_link(path);
    if (fd_.get() < 0) fail("open", path, errno);
    struct stat s {};
    if (fstat(fd_.get(), &s) != 0) fail("check the type of", path, errno);
    if (!S_ISREG(s.st_mode))
      throw Error(ErrorCode::kInvalidInput,
                  path + " is not a regular file: expected a file, not a folder, pipe or device");
    identity_ = identity_of(s);
  }
  const std::string& path() const override { return path_; }
  uint64_t size() const override { return identity_.bytes; }
  FileIdentity identity() const override { return identity_; }
  int descriptor() const { return fd_.get(); }
  void read_at(uint64_t offset, std::span<std::byte> out) const override {
    while (!out.empty()) {
      const ssize_t n = pread(fd_.get(), out.data(), out.size(), static_cast<off_t>(offset));
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) fail("read", path_ + " at offset " + std::to_string(offset), errno);
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
  Descriptor fd_;
  FileIdentity identity_;
};

class PosixWritableFile : public WritableFile {
 public:
  PosixWritableFile(const std::string& path, Contents contents)
      : path_(path), fd_(open_to_change("create", path, contents)) {}
  const std::string& path() const override { return path_; }
  void write_at(uint64_t offset, std::span<const std::byte> data) override {
    while (!data.empty()) {
      const ssize_t n = pwrite(fd_.get(), data.data(), data.size(), static_cast<off_t>(offset));
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) fail("write", path_ + " at offset " + std::to_string(offset), errno);
      offset += static_cast<uint64_t>(n);
      data = data.subspan(static_cast<size_t>(n));
    }
  }
  // Releases only complete blocks. For a part of a block, the system would write zeros, which frees
  // no space.
  void release(uint64_t offset, uint64_t bytes) override {
    constexpr uint64_t kBlock = 4096;
    const uint64_t begin = (offset + kBlock - 1) / kBlock * kBlock;
    const uint64_t end = (offset + bytes) / kBlock * kBlock;
    if (begin < end)
      fallocate(fd_.get(), FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, static_cast<off_t>(begin),
                static_cast<off_t>(end - begin));
  }
  // Writes the data to the disk in pieces. A process cannot end during a system call that waits for
  // the disk, so each call must be short.
  void sync() override {
    struct stat s {};
    constexpr off_t kPieceBytes = off_t{8} << 20;
    if (fstat(fd_.get(), &s) != 0) fail("find the size of", path_, errno);
    for (off_t at = 0; s.st_size > kPieceBytes && at < s.st_size; at += kPieceBytes)
      sync_file_range(
          fd_.get(), at, kPieceBytes,
          SYNC_FILE_RANGE_WAIT_BEFORE | SYNC_FILE_RANGE_WRITE | SYNC_FILE_RANGE_WAIT_AFTER);
    if (fdatasync(fd_.get()) != 0) fail("sync", path_, errno);
  }
  void close() override {
    if (const int reason = fd_.release()) fail("close", path_, reason);
  }

 private:
  const std::string path_;
  Descriptor fd_;
};

class PosixFileLock : public FileLock {
 public:
  explicit PosixFileLock(int fd) : fd_(fd) {}

 private:
  Descriptor fd_;
};

class PosixFileSystem : public FileSystem {
 public:
  std::unique_ptr<ReadableFile> open_read(const std::string& path) override {
    return std::make_unique<PosixReadableFile>(path);
  }
  std::unique_ptr<ReadableFile> open_own(const std::string& path) override {
    return std::make_unique<PosixReadableFile>(path, O_NOFOLLOW);
  }
  std::unique_ptr<WritableFile> create(const std::string& path) override {
    return std::make_unique<PosixWritableFile>(path, Contents::kEmpty);
  }
  std::unique_ptr<WritableFile> open_write(const std::string& path) override {
    return std::make_unique<PosixWritableFile>(path, Contents::kKeep);
  }
  bool create_new(const std::string& path) override {
    const Descriptor fd(open_retrying(path, O_RDWR | O_CREAT | O_EXCL));
    if (fd.get() < 0 && errno != EEXIST) fail("create", path, errno);
    return fd.get() >= 0;
  }
  bool exists(const std::string& path) override {
    struct stat s {};
    if (stat(path.c_str(), &s) == 0) return true;
    if (errno == ENOENT || errno == ENOTDIR) return false;
    fail("look for", path, errno);
  }
  std::optional<FileIdentity> identify(const std::string& path) override {
    struct stat s {};
    if (stat(path.c_str(), &s) != 0 || !S_ISREG(s.st_mode)) return std::nullopt;
    return identity_of(s);
  }
  void rename(const std::string& from, const std::string& to) override {
    if (::rename(from.c_str(), to.c_str()) != 0) fail("rename", from + " to " + to, errno);
  }
  bool rename_new(const std::string& from, const std::string& to) override {
    const int reason = rename_without_replacing(from, to);
    if (reason != 0 && reason != EEXIST) fail("rename", from + " to " + to, reason);
    return reason == 0;
  }
  void remove(const std::string& path) override {
    if (unlink(path.c_str()) != 0) fail("remove", path, errno);
  }
  void make_directories(const std::string& path) override {
    if (path.empty()) return;
    struct stat s {};
    if (stat(path.c_str(), &s) == 0) {
      if (S_ISDIR(s.st_mode)) return;
      not_a_folder(path);
    }
    const std::string parent = parent_directory(path);
    if (parent != path) make_directories(parent);
    make_directory(path);
    sync_directory(parent);
  }
  void make_directory(const std::string& path) override {
    if (mkdir(path.c_str(), 0777) == 0) return;
    if (errno != EEXIST) fail("make directory", path, errno);
    struct stat s {};
    if (stat(path.c_str(), &s) == 0 && !S_ISDIR(s.st_mode)) not_a_folder(path);
  }
  void remove_directory(const std::string& path) override {
    if (rmdir(path.c_str()) != 0) fail("remove directory", path, errno);
  }
  std::vector<DirectoryEntry> list(const std::string& path) override {
    DIR* directory = opendir(path.c_str());
    if (!directory && errno == ENOTDIR && exists(path)) not_a_folder(path);
    if (!directory) fail("list", path, errno);
    std::vector<DirectoryEntry> entries;
    while (const dirent* e = readdir(directory)) {
      const std::string name = e->d_name;
      if (name == "." || name == "..") continue;
      struct stat s {};
      if (lstat((path + "/" + name).c_str(), &s) != 0) continue;  // removed since the listing
      entries.push_back(
          {name, S_ISDIR(s.st_mode), static_cast<uint64_t>(s.st_size),
           512 * static_cast<uint64_t>(s.st_blocks),
           static_cast<double>(s.st_mtim.tv_sec) + 1e-9 * static_cast<double>(s.st_mtim.tv_nsec),
           !S_ISDIR(s.st_mode) && !S_ISREG(s.st_mode)});
    }
    closedir(directory);
    return entries;
  }
  void touch(const std::string& path) override {
    if (utimensat(AT_FDCWD, path.c_str(), nullptr, AT_SYMLINK_NOFOLLOW) != 0)
      fail("touch", path, errno);
  }
  void sync_directory(const std::string& path) override {
    Descriptor fd(open_retrying(path, O_RDONLY | O_DIRECTORY));
    if (fd.get() < 0) fail("open", path, errno);
    if (fsync(fd.get()) != 0) fail("sync", path, errno);
  }
  std::unique_ptr<FileLock> try_lock(const std::string& path) override {
    const int fd = open_to_change("open", path, Contents::kKeep);
    auto lock = std::make_unique<PosixFileLock>(fd);
    if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
      if (errno != EWOULDBLOCK) fail("lock", path, errno);
      return nullptr;
    }
    // Between open() and flock(), another process can release its lock and remove the file. Then
    // this lock is on a file without a name, so the file that is now at `path` must be locked
    // instead.
    struct stat held {
    }, named{};
    const bool same = fstat(fd, &held) == 0 && stat(path.c_str(), &named) == 0 &&
                      held.st_ino == named.st_ino && held.st_dev == named.st_dev;
    return same ? std::move(lock) : try_lock(path);
  }
  bool is_locked(const std::string& path) override {
    const PosixReadableFile file(path, O_NOFOLLOW);
    if (flock(file.descriptor(), LOCK_SH | LOCK_NB) == 0) return false;
    if (errno != EWOULDBLOCK) fail("lock", path, errno);
    return true;
  }
  uint64_t free_space(const std::string& path) override {
    struct statvfs s {};
    if (statvfs(path.c_str(), &s) != 0) fail("measure the free space of", path, errno);
    return static_cast<uint64_t>(s.f_bavail) * s.f_frsize;
  }
  uint64_t device(const std::string& path) override {
    struct stat s {};
    if (stat(path.c_str(), &s) != 0) fail("find the disk of", path, errno);
    return s.st_dev;
  }
};

}  // namespace

FileSystem& system_files() {
  static PosixFileSystem files;
  return files;
}

std::string temporary_parent() {
  const char* const chosen = std::getenv("TMPDIR");
  for (const std::string candidate : {chosen ? chosen : "", "/tmp"})
    if (!candidate.empty() && access(candidate.c_str(), W_OK | X_OK) == 0) return candidate;
  return ".";
}

std::string make_temporary_folder(const std::string& prefix) {
  std::string path = prefix + "XXXXXX";
  if (!mkdtemp(path.data())) fail("create the temporary folder", prefix + "*", errno);
  return path;
}

}  // namespace voxdag
