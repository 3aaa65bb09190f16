// A large file as an answer: whole, in part or in parts (RFC 9110, sections 13 and 14).
#pragma once

#include <memory>
#include <string>

#include "core/io/file_system.h"
#include "server/http/message.h"

namespace voxdag::server {

struct FileAnswer {
  std::shared_ptr<ReadableFile> file;  // not empty
  std::string type;
  std::string sha256;  // of the file, in hex: its ETag
  std::string name;    // to save it under
};

// 200, 206, or 304. Throws Problem (416).
Response answer_with_file(const Request& request, FileAnswer answer);

}  // namespace voxdag::server
