#include "tests/crash/faulty_files.h"

#include <signal.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

namespace crash {
namespace {

using voxdag::Error;
using voxdag::ErrorCode;

std::string contents(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

class FaultyWriter : public voxdag::WritableFile {
 public:
  FaultyWriter(FaultyFiles& files, std::unique_ptr<voxdag::WritableFile> file)
      : files_(files), file_(std::move(file)) {}
  const std::string& path() const override { return file_->path(); }
  void write_at(uint64_t offset, std::span<const std::byte> data) override {
    files_.write([&] { file_->write_at(offset, data); },
                 [&] { file_->write_at(offset, data.first(data.size() / 2)); },
                 [&] {
                   std::vector<std::byte> changed(data.begin(), data.end());
                   if (!changed.empty()) changed[changed.size() * 2 / 3] ^= std::byte{8};
                   file_->write_at(offset, changed);
                 });
  }
  void sync() override {
    files_.operate([&] {
      file_->sync();
      std::lock_guard lock(files_.mutex_);
      files_.synced_[path()] = contents(path());
    });
  }
  void release(uint64_t offset, uint64_t bytes) override { file_->release(offset, bytes); }
  void close() override { file_->close(); }

 private:
  FaultyFiles& files_;
  std::unique_ptr<voxdag::WritableFile> file_;
};

class FaultyReader : public voxdag::ReadableFile {
 public:
  FaultyReader(FaultyFiles& files, std::unique_ptr<voxdag::ReadableFile> file)
      : files_(files), file_(std::move(file)) {}
  const std::string& path() const override { return file_->path(); }
  uint64_t size() const override { return file_->size(); }
  voxdag::FileIdentity identity() const override { return file_->identity(); }
  void read_at(uint64_t offset, std::span<std::byte> out) const override {
    files_.read();
    file_->read_at(offset, out);
  }

 private:
  FaultyFiles& files_;
  std::unique_ptr<voxdag::ReadableFile> file_;
};

template <class Operation>
void FaultyFiles::operate(const Operation& operation) {
  const uint64_t number = ++operations_;
  const bool now = number == plan_.at;
  if (now && plan_.fault == Fault::kPowerCut) cut_power();
  if (now && plan_.fault == Fault::kKillBefore) raise(SIGKILL);
  if (plan_.fault == Fault::kIoError && number >= plan_.at)
    throw Error(ErrorCode::kIo, "the test's disk is broken");
  operation();
  if (now && plan_.fault == Fault::kKillAfter) raise(SIGKILL);
}

template <class Operation, class Half, class Flipped>
void FaultyFiles::write(const Operation& operation, const Half& half, const Flipped& flipped) {
  const uint64_t number = operations_ + 1;
  const bool failing = plan_.at > 0 && number >= plan_.at;
  if (failing && (plan_.fault == Fault::kNoSpace || plan_.fault == Fault::kIoError)) half();
  operate([&] {
    if (failing && plan_.fault == Fault::kNoSpace)
      throw Error(ErrorCode::kNoSpace, "the test's disk is full");
    if (number == plan_.at && plan_.fault == Fault::kFlipBit) return flipped();
    operation();
  });
}

void FaultyFiles::read() {
  const uint64_t number = ++reads_;
  if (plan_.fault == Fault::kReadError && number >= plan_.at)
    throw Error(ErrorCode::kIo, "the test's disk cannot be read");
}

std::unique_ptr<voxdag::ReadableFile> FaultyFiles::open_read(const std::string& path) {
  return std::make_unique<FaultyReader>(*this, disk_.open_read(path));
}

std::unique_ptr<voxdag::WritableFile> FaultyFiles::create(const std::string& path) {
  std::unique_ptr<voxdag::WritableFile> file;
  operate([&] {
    std::lock_guard lock(mutex_);
    if (!disk_.exists(path)) unsynced_names_[path] = "";
    synced_[path] = "";
    file = disk_.create(path);
  });
  return std::make_unique<FaultyWriter>(*this, std::move(file));
}

std::unique_ptr<voxdag::WritableFile> FaultyFiles::open_write(const std::string& path) {
  std::unique_ptr<voxdag::WritableFile> file;
  operate([&] {
    std::lock_guard lock(mutex_);
    // What an earlier process left of it is on the disk.
    if (!synced_.contains(path)) synced_[path] = disk_.exists(path) ? contents(path) : "";
    file = disk_.open_write(path);
  });
  return std::make_unique<FaultyWriter>(*this, std::move(file));
}

void FaultyFiles::rename(const std::string& from, const std::string& to) {
  operate([&] {
    disk_.rename(from, to);
    std::lock_guard lock(mutex_);
    unsynced_names_.erase(from);
    unsynced_names_[to] = from;
    synced_[to] = synced_[from];
    synced_.erase(from);
  });
}

void FaultyFiles::remove(const std::string& path) {
  operate([&] {
    disk_.remove(path);
    std::lock_guard lock(mutex_);
    synced_.erase(path);
    unsynced_names_.erase(path);
  });
}

void FaultyFiles::sync_directory(const std::string& path) {
  operate([&] {
    disk_.sync_directory(path);
    std::lock_guard lock(mutex_);
    std::erase_if(unsynced_names_,
                  [&](const auto& name) { return voxdag::parent_directory(name.first) == path; });
  });
}

void FaultyFiles::cut_power() {
  // Held until the end: no other thread may take for durable what is forgotten here.
  std::lock_guard lock(mutex_);
  for (const auto& [path, bytes] : synced_)
    std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
  for (const auto& [name, old] : unsynced_names_) {
    if (old.empty())
      std::filesystem::remove(name);
    else
      std::filesystem::rename(name, old);
  }
  raise(SIGKILL);
}

}  // namespace crash
