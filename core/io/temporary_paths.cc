#include "core/io/temporary_paths.h"

#include <filesystem>
#include <mutex>
#include <set>
#include <system_error>
#include <utility>

namespace voxdag {
namespace {

struct RegisteredPaths {
  std::mutex mutex;
  std::multiset<std::string> paths;
};

// Returns the registered paths. They are never destroyed, because threads can use them until the
// process ends.
RegisteredPaths& registered() {
  static auto* const all = new RegisteredPaths;
  return *all;
}

}  // namespace

TemporaryPath::TemporaryPath(std::string path) : path_(std::move(path)) {
  const std::lock_guard lock(registered().mutex);
  registered().paths.insert(path_);
}

TemporaryPath::~TemporaryPath() {
  const std::lock_guard lock(registered().mutex);
  registered().paths.erase(registered().paths.find(path_));
}

void remove_temporary_paths() {
  const std::lock_guard lock(registered().mutex);
  std::error_code ignored;
  for (const std::string& path : registered().paths) std::filesystem::remove_all(path, ignored);
}

}  // namespace voxdag
