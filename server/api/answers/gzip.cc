#include "server/api/answers/gzip.h"

#include <zlib.h>

#include <algorithm>

#include "core/base/error.h"
#include "server/http/message/headers.h"

namespace voxdag::server {
namespace {

constexpr int kLevel = 1;             // higher levels take twice the time to save a few percent
constexpr int kGzipWindow = 15 + 16;  // window of 32 KiB, with gzip's header
constexpr int kMemory = 8;

// True if the parameters of an entry of Accept-Encoding exclude the entry, as "; q=0" does.
bool is_excluded(std::string_view parameters) {
  const size_t q = parameters.find("q=");
  if (q == std::string_view::npos) return false;
  const std::string_view weight = trimmed(parameters.substr(q + 2));
  return weight.find_first_not_of("0.") == std::string_view::npos;
}

}  // namespace

bool accepts_gzip(std::string_view accepted) {
  bool any = false;
  while (!accepted.empty()) {
    const size_t comma = std::min(accepted.find(','), accepted.size());
    const std::string_view entry = accepted.substr(0, comma);
    const size_t semicolon = std::min(entry.find(';'), entry.size());
    const std::string_view coding = trimmed(entry.substr(0, semicolon));
    const bool allowed = !is_excluded(entry.substr(semicolon));
    if (equal_ignoring_case(coding, "gzip")) return allowed;
    any = any || (coding == "*" && allowed);
    accepted.remove_prefix(std::min(comma + 1, accepted.size()));
  }
  return any;
}

std::string gzip(std::string_view bytes) {
  z_stream stream{};
  if (deflateInit2(&stream, kLevel, Z_DEFLATED, kGzipWindow, kMemory, Z_DEFAULT_STRATEGY) != Z_OK)
    throw Error(ErrorCode::kOutOfMemory,
                "out of memory: zlib cannot compress an answer: expected more free memory");
  std::string out(deflateBound(&stream, bytes.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  // One call compresses all bytes, because the output has space for the worst case.
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

void pack(const Request& request, Response& response) {
  if (response.body.empty() || !accepts_gzip(request.header("Accept-Encoding"))) return;
  std::string packed = gzip(response.body);
  if (packed.size() >= response.body.size()) return;
  response.body = std::move(packed);
  response.headers.emplace("Content-Encoding", "gzip");
}

}  // namespace voxdag::server
