// Bearer tokens and their roles. The token file contains only the hashes of the tokens:
//
//     # role name sha256(token)
//     admin  anna  9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08
//
// A token has 256 random bits and cannot be guessed, so the hash needs no salt.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/file_system.h"

namespace voxdag::server {

// Each role has the rights of all roles before it.
enum class Role { kNone, kRead, kSubmit, kAdmin };

// Parses "read", "submit" or "admin"; nullopt for anything else.
std::optional<Role> parse_role(std::string_view name);
const char* role_name(Role role);

struct Caller {
  Role role = Role::kNone;
  std::string name;  // for the audit log
  // Identifies the client for limits: all requests with the same text share one limit. The text
  // contains the token's name, or the client's address for a request without a token.
  std::string client;
};

class Tokens {
 public:
  // Reads a token file. Throws Error{kInvalidInput} if the file has no tokens or a malformed line;
  // the message then has the number of the line.
  static Tokens read(FileSystem& files, const std::string& path);

  // Returns the caller with this token; nullopt for an unknown token. Takes the same time for every
  // token, so that the time reveals nothing about the hashes.
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
// Creates a token. Throws Error{kInvalidInput} for an invalid role or name.
NewToken make_token(const std::string& role, const std::string& name);

}  // namespace voxdag::server
