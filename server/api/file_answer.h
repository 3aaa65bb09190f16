// Answers with a large file: whole, one range or several (RFC 9110, sections 13 and 14).
#pragma once

#include <memory>
#include <string>

#include "core/io/file_system.h"
#include "server/http/message.h"

namespace voxdag::server {

struct FileAnswer {
  std::shared_ptr<ReadableFile> file;  // not empty
  std::string type;
  std::string sha256;  // of the file in hex, used as its ETag
  std::string name;    // file name for Content-Disposition
};

// Answers with 200, 206 or 304. Throws Problem (416).
Response answer_with_file(const Request& request, FileAnswer answer);

}  // namespace voxdag::server
