// The file of trusted certificates, `webhooks.ca_file`.
#pragma once

#include <string>

#include "core/io/file_system.h"

namespace voxdag::server {

// Throws Error if the file cannot be read, is not PEM, or has no certificate. OpenSSL would report
// this only when a receiver is contacted.
void check_certificates(FileSystem& files, const std::string& path);

}  // namespace voxdag::server
