#include "server/api/access/tokens.h"

#include <openssl/crypto.h>

#include <sstream>

#include "core/base/error.h"
#include "core/format/checksum.h"
#include "core/io/random_id.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kMaxTokenFileBytes = uint64_t{1} << 20;
constexpr size_t kHashDigits = 64;

bool is_name(const std::string& name) {
  return !name.empty() && name.size() <= 64 &&
         name.find_first_not_of(
             "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
             "._@-") == std::string::npos;
}

}  // namespace

const char* role_name(Role role) {
  static constexpr const char* kNames[] = {"none", "read", "submit", "admin"};
  return kNames[static_cast<size_t>(role)];
}

std::optional<Role> parse_role(std::string_view name) {
  if (name == "read") return Role::kRead;
  if (name == "submit") return Role::kSubmit;
  if (name == "admin") return Role::kAdmin;
  return {};
}

Tokens Tokens::read(FileSystem& files, const std::string& path) {
  std::istringstream text(read_small_file(files, path, kMaxTokenFileBytes));
  Tokens tokens;
  std::string line;
  for (int number = 1; std::getline(text, line); ++number) {
    std::istringstream fields(line);
    std::string role, name, hash, more;
    if (!(fields >> role) || role.starts_with('#')) continue;
    fields >> name >> hash >> more;
    const auto parsed = parse_role(role);
    if (!parsed || !is_name(name) || hash.size() != kHashDigits || !more.empty() ||
        hash.find_first_not_of("0123456789abcdef") != std::string::npos)
      throw Error(
          ErrorCode::kInvalidInput,
          path + ":" + std::to_string(number) +
              ": invalid token: expected ROLE NAME SHA256. ROLE is one of read, submit and "
              "admin; NAME has 1 to 64 of the characters A-Z, a-z, 0-9 and ._@-; SHA256 has 64 "
              "lowercase hexadecimal digits");
    tokens.entries_.push_back({{*parsed, name, ""}, hash});
  }
  if (tokens.entries_.empty())
    throw Error(
        ErrorCode::kInvalidInput,
        path + " has no tokens: expected lines ROLE NAME SHA256, as written by voxdag token");
  return tokens;
}

std::optional<Caller> Tokens::find(std::string_view token) const {
  const std::string hash = sha256_hex(token);
  const Entry* found = nullptr;
  for (const Entry& entry : entries_)
    if (CRYPTO_memcmp(entry.sha256.data(), hash.data(), kHashDigits) == 0) found = &entry;
  if (!found) return {};
  return found->caller;
}

NewToken make_token(const std::string& role, const std::string& name) {
  if (!parse_role(role))
    throw Error(ErrorCode::kInvalidInput, "role '" + role + "': expected read, submit or admin");
  if (!is_name(name))
    throw Error(ErrorCode::kInvalidInput,
                "name '" + name + "': expected up to 64 letters, digits and . _ @ -");
  NewToken made;
  for (int i = 0; i < 4; ++i) made.token += random_id();
  made.line = role + " " + name + " " + sha256_hex(made.token);
  return made;
}

}  // namespace voxdag::server
