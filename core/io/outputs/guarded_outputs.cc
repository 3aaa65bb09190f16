#include "core/io/outputs/guarded_outputs.h"

#include "core/base/error.h"
#include "core/base/options/option_text.h"

namespace voxdag {
namespace {

[[noreturn]] void refuse_to_replace(const std::string& path) {
  throw Error(ErrorCode::kInvalidInput,
              path +
                  " was created or changed by another program in the meantime, so it is kept: "
                  "expected a free name; move the file and " +
                  repeat_text());
}

}  // namespace

void GuardedOutputs::guard(const std::string& path) { set(path, file_at(path, false)); }

void GuardedOutputs::guard_output(const std::string& path) {
  guard(path);
  guard(path + ".partial");
}

bool GuardedOutputs::is_unchanged() {
  const std::lock_guard lock(mutex_);
  for (const auto& [path, file] : guarded_)
    if (file.exists ? !is_at(path, file) : file_at(path, false).exists) return false;
  return true;
}

std::unique_ptr<WritableFile> GuardedOutputs::create(const std::string& path) {
  const auto guarded = find(path);
  if (!guarded) return ForwardingFiles::create(path);
  if (!is_at(path, *guarded) && !create_new(path)) refuse_to_replace(path);
  auto file = ForwardingFiles::create(path);
  set(path, file_at(path, true));
  return file;
}

void GuardedOutputs::rename(const std::string& from, const std::string& to) {
  const auto guarded = find(to);
  if (!guarded || is_at(to, *guarded))
    ForwardingFiles::rename(from, to);
  else if (!rename_new(from, to))
    refuse_to_replace(to);
  if (guarded) set(to, file_at(to, true));
  if (find(from)) set(from, {});
}

void GuardedOutputs::remove(const std::string& path) {
  const auto guarded = find(path);
  if (guarded && !is_at(path, *guarded) && exists(path)) refuse_to_replace(path);
  ForwardingFiles::remove(path);
  if (guarded) set(path, {});
}

std::optional<GuardedOutputs::Replaceable> GuardedOutputs::find(const std::string& path) {
  const std::lock_guard lock(mutex_);
  const auto found = guarded_.find(path);
  if (found == guarded_.end()) return std::nullopt;
  return found->second;
}

void GuardedOutputs::set(const std::string& path, const Replaceable& replaceable) {
  const std::lock_guard lock(mutex_);
  guarded_[path] = replaceable;
}

GuardedOutputs::Replaceable GuardedOutputs::file_at(const std::string& path, bool is_own) {
  const auto identity = files().identify(path);
  if (!identity) return {};
  return {true, is_own, *identity};
}

bool GuardedOutputs::is_at(const std::string& path, const Replaceable& expected) {
  if (!expected.exists) return false;
  const Replaceable found = file_at(path, expected.is_own);
  const FileIdentity &a = found.identity, &b = expected.identity;
  return found.exists && a.inode == b.inode &&
         (expected.is_own || (a.bytes == b.bytes && a.modified_ns == b.modified_ns));
}

}  // namespace voxdag
