// Bearer tokens and their roles. The file holds hashes only:
//
//     # role name sha256(token)
//     admin  anna  9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08
//
// Tokens have 256 random bits, so that an unsalted SHA-256 is enough.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/file_system.h"

namespace voxdag::server {

// Each role includes all roles before it.
enum class Role { kNone, kRead, kSubmit, kAdmin };

// Parses "read", "submit" or "admin"; nullopt for anything else.
std::optional<Role> parse_role(std::string_view name);

struct Caller {
  Role role = Role::kNone;
  std::string name;  // for the audit log
  // Identifies the client for limits: all requests with the same text share one limit. The text
  // contains the token's name, or the client's address for a request without a token.
  std::string client;
};

class Tokens {
 public:
  // Throws Error{kInvalidInput} for a file without tokens, and with the line number for a malformed
  // line.
  static Tokens read(FileSystem& files, const std::string& path);

  // Runs in constant time for known and unknown tokens.
  std::optional<Caller> find(std::string_view token) const;

 private:
  struct Entry {
    Caller caller;
    std::string sha256;
  };
  std::vector<Entry> entries_;
};

// A new token and its line for the token file.
struct NewToken {
  std::string token;
  std::string line;
};
// Throws Error{kInvalidInput} for an invalid role or name.
NewToken make_token(const std::string& role, const std::string& name);

}  // namespace voxdag::server
