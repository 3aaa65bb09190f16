#include "scheduler/ingest/ingest_record.h"

#include <cstring>
#include <type_traits>

#include "core/base/error.h"

namespace voxdag {
namespace {

// Another one for every change of what follows it.
constexpr uint64_t kRecordVersion = 2;

void put_bytes(std::vector<std::byte>& out, std::span<const std::byte> bytes) {
  const size_t at = out.size();
  out.resize(at + bytes.size());
  if (!bytes.empty()) std::memcpy(out.data() + at, bytes.data(), bytes.size());
}

template <class Plain>
void put(std::vector<std::byte>& out, const Plain& value) {
  static_assert(std::is_trivially_copyable_v<Plain>);
  put_bytes(out, std::as_bytes(std::span(&value, 1)));
}

void put(std::vector<std::byte>& out, const std::string& text) {
  put(out, uint64_t{text.size()});
  put_bytes(out, std::as_bytes(std::span(text)));
}

class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) : left_(bytes) {}
  template <class Plain>
  Plain get() {
    Plain value;
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
  }
  std::string text() {
    const auto bytes = take(get<uint64_t>());
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  bool at_end() const { return left_.empty(); }

 private:
  std::span<const std::byte> take(uint64_t size) {
    if (size > left_.size())
      throw Error(ErrorCode::kCorrupt, "job store: the record of what was ingested ends too early");
    const auto taken = left_.first(size);
    left_ = left_.subspan(size);
    return taken;
  }

  std::span<const std::byte> left_;
};

}  // namespace

std::vector<std::byte> encode(const IngestRecord& record) {
  std::vector<std::byte> out;
  put(out, kRecordVersion);
  put(out, record.request);
  put(out, record.state);
  for (const SourceFile& file : record.files) {
    put(out, file.path);
    put(out, file.identity);
  }
  return out;
}

IngestRecord decode_ingest_record(std::span<const std::byte> bytes) {
  Reader in(bytes);
  if (const auto version = in.get<uint64_t>(); version != kRecordVersion)
    throw Error(ErrorCode::kUnsupportedVersion,
                "job store: the record of what was ingested is of version " +
                    std::to_string(version) + ": expected " + std::to_string(kRecordVersion));
  IngestRecord record;
  record.request = in.text();
  record.state = in.get<IngestState>();
  while (!in.at_end()) {
    const std::string path = in.text();
    record.files.push_back({path, in.get<FileIdentity>()});
  }
  return record;
}

}  // namespace voxdag
