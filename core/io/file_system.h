// All file access of voxdag uses this interface. So tests can replace the disk by a full disk, or
// by a disk that loses unsynced data or flips bits. Paths are plain byte strings.
//
// If the system refuses a call, code_of_errno() (core/base/process_limits.h) determines the
// error code. The message names the call, the path, the offset if there is one, and the system's
// reason. Implementations handle short reads and writes, and EINTR.
//
// A FileSystem is thread-safe. A file is not thread-safe, with these exceptions: several threads
// may call ReadableFile::read_at() or WritableFile::write_at() at the same time, and other threads
// may call WritableFile::sync() and release() concurrently with these calls.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace voxdag {

// Identifies a file and its contents. Equal identities mean the same file with equal bytes, with
// one exception: a change in the same tick of the file system's clock as the change before it can
// leave the identity unchanged.
struct FileIdentity {
  uint64_t inode = 0;
  uint64_t bytes = 0;
  int64_t modified_ns = 0;  // Unix time of the last change of the contents
  // Unix time of the last change of contents, names or times (ctime). No program can set this time
  // back.
  int64_t changed_ns = 0;
  bool operator==(const FileIdentity&) const = default;
};

class ReadableFile {
 public:
  virtual ~ReadableFile() = default;
  virtual const std::string& path() const = 0;
  virtual uint64_t size() const = 0;
  // Returns the identity that the file had when it was opened; all zeros if unknown.
  virtual FileIdentity identity() const { return {}; }
  // Fills `out` with the bytes at `offset`. Throws Error{kCorrupt} if the file ends earlier.
  virtual void read_at(uint64_t offset, std::span<std::byte> out) const = 0;
};

class WritableFile {
 public:
  virtual ~WritableFile() = default;
  virtual const std::string& path() const = 0;
  // Writes all of `data` at `offset`. Extends the file as needed.
  virtual void write_at(uint64_t offset, std::span<const std::byte> data) = 0;
  // Frees the disk space of a range whose contents are no longer needed. The range then reads as
  // zeros, or as before if the file system does not support this.
  virtual void release(uint64_t /*offset*/, uint64_t /*bytes*/) {}
  // Returns after all written data is on the disk. If the process is killed during this call, it
  // ends soon, without waiting until all data is on the disk.
  virtual void sync() = 0;
  // Closes the file without syncing it. Throws an Error if the system's close() fails. The
  // destructor also closes the file, but ignores errors.
  virtual void close() = 0;
};

struct DirectoryEntry {
  std::string name;
  bool is_directory = false;
  uint64_t bytes = 0;
  uint64_t disk_bytes = 0;  // disk usage; less than `bytes` if space was released
  double modified_s = 0;    // Unix time
  bool is_special = false;  // neither a file nor a directory: a link, a pipe, a device
};

// An exclusive lock. It is released when this object is destroyed or when the process ends for any
// reason.
class FileLock {
 public:
  virtual ~FileLock() = default;
};

class FileSystem {
 public:
  virtual ~FileSystem() = default;
  virtual std::unique_ptr<ReadableFile> open_read(const std::string& path) = 0;
  // Like open_read(), but throws Error{kInvalidInput} if `path` is a symbolic link. For files that
  // voxdag wrote to a folder in which other users can also create files.
  virtual std::unique_ptr<ReadableFile> open_own(const std::string& path) = 0;
  // Creates an empty file at `path`, or empties an existing file. Throws Error{kInvalidInput} for a
  // symbolic link and for a file with other hard links; so do open_write() and try_lock().
  virtual std::unique_ptr<WritableFile> create(const std::string& path) = 0;
  // Opens the file at `path` and keeps its contents. Creates an empty file if none exists.
  virtual std::unique_ptr<WritableFile> open_write(const std::string& path) = 0;
  // Creates an empty file at `path`. Returns false if anything exists at `path`.
  virtual bool create_new(const std::string& path) = 0;
  virtual bool exists(const std::string& path) = 0;
  // Returns the identity of the regular file at `path`; nullopt if there is none. Follows links.
  virtual std::optional<FileIdentity> identify(const std::string& path) = 0;
  virtual void rename(const std::string& from, const std::string& to) = 0;
  // Renames `from` to `to` in one step. If anything exists at `to`, returns false and renames
  // nothing.
  virtual bool rename_new(const std::string& from, const std::string& to) = 0;
  virtual void remove(const std::string& path) = 0;
  // Creates the directory and its missing parents, and syncs their names. Throws
  // Error{kInvalidInput} if the directory or a parent exists but is a file.
  virtual void make_directories(const std::string& path) = 0;
  // Creates the directory if it does not exist. Its parent must exist. Does not sync its name.
  // Throws Error{kInvalidInput} if a file has this name.
  virtual void make_directory(const std::string& path) = 0;
  // Removes an empty directory.
  virtual void remove_directory(const std::string& path) = 0;
  virtual std::vector<DirectoryEntry> list(const std::string& path) = 0;
  // Sets the file's time of modification to now.
  virtual void touch(const std::string& path) = 0;
  // Syncs a directory, so that renames and new names in it survive a power cut.
  virtual void sync_directory(const std::string& path) = 0;
  // Locks the file at `path`, creating it if necessary. Returns nullptr if another holder has the
  // lock.
  virtual std::unique_ptr<FileLock> try_lock(const std::string& path) = 0;
  // True if a process holds the lock of the file at `path`, which must be readable. The check takes
  // the lock for a moment, so a try_lock() that runs concurrently can fail.
  virtual bool is_locked(const std::string& path) = 0;
  // Returns the number of bytes that an unprivileged user can still write to the file system of
  // `path`.
  virtual uint64_t free_space(const std::string& path) = 0;
  // Returns the device number of the file system of `path`. Paths with equal numbers share one
  // free_space().
  virtual uint64_t device(const std::string& path) = 0;
};

// Returns the file system of this machine.
FileSystem& system_files();

// Returns the folder for temporary files: $TMPDIR if it is writable, else /tmp if it is writable,
// else the current folder.
std::string temporary_parent();
// Creates a folder that only this user may enter, and returns its path. The path is `prefix`, which
// may contain slashes, followed by six unpredictable characters.
std::string make_temporary_folder(const std::string& prefix);

// Removes the contents of a folder, if it exists.
void remove_entries(FileSystem& files, const std::string& path);
// Removes a folder with its contents, if it exists.
void remove_tree(FileSystem& files, const std::string& path);

// Returns the parent directory of a path; "." if the path has no directory part.
std::string parent_directory(const std::string& path);
// Reads a small file completely. Throws Error{kLimit} if it is larger than `limit_bytes`.
std::string read_small_file(FileSystem& files, const std::string& path, uint64_t limit_bytes);
// Like read_small_file(), for a file that open_own() opens.
std::string read_own_file(FileSystem& files, const std::string& path, uint64_t limit_bytes);
// Replaces the file at `path` by `contents` atomically: writes the contents to `path` + ".partial",
// syncs and renames this file, and syncs the directory.
void write_file_atomically(FileSystem& files, const std::string& path, std::string_view contents);
// The first two steps of write_file_atomically(). The first writes and syncs the file with the name
// `path` + ".partial". The second renames this file to `path`, or removes it if the renaming fails.
// Afterwards the caller syncs the directory.
void write_partial_file(FileSystem& files, const std::string& path, std::string_view contents);
void rename_partial_file(FileSystem& files, const std::string& path);
// Removes the file that write_partial_file() wrote. Ignores errors.
void remove_partial_file(FileSystem& files, const std::string& path);

}  // namespace voxdag
