#include "tests/support/faulty_files.h"

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

class FaultyWriter : public voxdag::ForwardingWriter {
 public:
  FaultyWriter(FaultyFiles& files, std::unique_ptr<voxdag::WritableFile> file)
      : ForwardingWriter(std::move(file)), files_(files) {}
  void write_at(uint64_t offset, std::span<const std::byte> data) override {
    files_.write([&] { ForwardingWriter::write_at(offset, data); },
                 [&] { ForwardingWriter::write_at(offset, data.first(data.size() / 2)); },
                 [&] {
                   std::vector<std::byte> changed(data.begin(), data.end());
                   if (!changed.empty()) changed[changed.size() * 2 / 3] ^= std::byte{8};
                   ForwardingWriter::write_at(offset, changed);
                 });
  }
  void sync() override {
    files_.operate([&] {
      // Bytes that are written during the sync are possibly not durable after it. So only the
      // contents from before the sync count as synced.
      std::string before = contents(path());
      ForwardingWriter::sync();
      std::lock_guard lock(files_.mutex_);
      files_.synced_[path()] = std::move(before);
    });
  }

 private:
  FaultyFiles& files_;
};

class FaultyReader : public voxdag::ForwardingReader {
 public:
  FaultyReader(FaultyFiles& files, std::unique_ptr<voxdag::ReadableFile> file)
      : ForwardingReader(std::move(file)), files_(files) {}
  void read_at(uint64_t offset, std::span<std::byte> out) const override {
    files_.read();
    ForwardingReader::read_at(offset, out);
  }

 private:
  FaultyFiles& files_;
};

template <class Operation, class Half>
void FaultyFiles::operate(const Operation& operation, const Half& half) {
  const uint64_t number = ++operations_;
  const bool now = number == plan_.at;
  if (now && plan_.fault == Fault::kPowerCut) cut_power();
  if (now && plan_.fault == Fault::kKillBefore) raise(SIGKILL);
  if (plan_.fault == Fault::kIoError && number >= plan_.at) {
    half();
    throw Error(ErrorCode::kIo, "the test's disk is broken");
  }
  operation(number);
  if (now && plan_.fault == Fault::kKillAfter) raise(SIGKILL);
}

template <class Operation, class Half, class Flipped>
void FaultyFiles::write(const Operation& operation, const Half& half, const Flipped& flipped) {
  operate(
      [&](uint64_t number) {
        if (plan_.fault == Fault::kNoSpace && number >= plan_.at) {
          half();
          throw Error(ErrorCode::kNoSpace, "the test's disk is full");
        }
        if (plan_.fault == Fault::kFlipBit && number == plan_.at) return flipped();
        operation();
      },
      half);
}

void FaultyFiles::read() {
  const uint64_t number = ++reads_;
  if (plan_.fault == Fault::kReadError && number >= plan_.at)
    throw Error(ErrorCode::kIo, "the test's disk cannot be read");
}

std::unique_ptr<voxdag::ReadableFile> FaultyFiles::reader_of(
    std::unique_ptr<voxdag::ReadableFile> file) {
  return std::make_unique<FaultyReader>(*this, std::move(file));
}

std::unique_ptr<voxdag::WritableFile> FaultyFiles::create(const std::string& path) {
  std::unique_ptr<voxdag::WritableFile> file;
  operate([&] {
    std::lock_guard lock(mutex_);
    if (!exists(path)) unsynced_names_[path] = "";
    synced_[path] = "";
    file = ForwardingFiles::create(path);
  });
  return std::make_unique<FaultyWriter>(*this, std::move(file));
}

std::unique_ptr<voxdag::WritableFile> FaultyFiles::open_write(const std::string& path) {
  std::unique_ptr<voxdag::WritableFile> file;
  operate([&] {
    std::lock_guard lock(mutex_);
    // Contents that an earlier process left count as synced.
    if (!synced_.contains(path)) synced_[path] = exists(path) ? contents(path) : "";
    file = ForwardingFiles::open_write(path);
  });
  return std::make_unique<FaultyWriter>(*this, std::move(file));
}

// Does not count as an operation, because create() follows.
bool FaultyFiles::create_new(const std::string& path) {
  std::lock_guard lock(mutex_);
  if (!ForwardingFiles::create_new(path)) return false;
  unsynced_names_[path] = "";
  synced_[path] = "";
  return true;
}

void FaultyFiles::rename_unsynced(const std::string& from, const std::string& to) {
  std::lock_guard lock(mutex_);
  if (exists(to) && !unsynced_names_.contains(to))
    replaced_[to] = synced_.contains(to) ? synced_[to] : contents(to);
  ForwardingFiles::rename(from, to);
  unsynced_names_.erase(from);
  unsynced_names_[to] = from;
  synced_[to] = synced_[from];
  synced_.erase(from);
}

void FaultyFiles::rename(const std::string& from, const std::string& to) {
  operate([&] { rename_unsynced(from, to); });
}

bool FaultyFiles::rename_new(const std::string& from, const std::string& to) {
  bool is_new = false;
  operate([&] {
    is_new = !exists(to);
    if (is_new) rename_unsynced(from, to);
  });
  return is_new;
}

void FaultyFiles::remove(const std::string& path) {
  operate([&] {
    ForwardingFiles::remove(path);
    std::lock_guard lock(mutex_);
    synced_.erase(path);
    unsynced_names_.erase(path);
    replaced_.erase(path);
  });
}

void FaultyFiles::sync_directory(const std::string& path) {
  operate([&] {
    ForwardingFiles::sync_directory(path);
    std::lock_guard lock(mutex_);
    for (auto* names : {&unsynced_names_, &replaced_})
      std::erase_if(*names,
                    [&](const auto& name) { return voxdag::parent_directory(name.first) == path; });
  });
}

void FaultyFiles::cut_power() {
  // Holds the lock until the process ends. Otherwise, another thread could report bytes as durable
  // after they have been dropped here.
  std::lock_guard lock(mutex_);
  for (const auto& [path, bytes] : synced_)
    std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
  for (const auto& [name, old] : unsynced_names_) {
    if (old.empty())
      std::filesystem::remove(name);
    else
      std::filesystem::rename(name, old);
  }
  for (const auto& [name, bytes] : replaced_)
    std::ofstream(name, std::ios::binary | std::ios::trunc) << bytes;
  raise(SIGKILL);
}

}  // namespace crash
