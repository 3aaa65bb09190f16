#include "scheduler/state/checkpoint/ingest_record.h"

#include <cstring>
#include <type_traits>

#include "core/base/error.h"
#include "core/format/bytes.h"
#include "core/format/checksum.h"

namespace voxdag {
namespace {

// Version of the record's layout.
constexpr uint64_t kRecordVersion = 5;

template <class Plain>
void put(ByteSink& out, const Plain& value) {
  static_assert(std::is_trivially_copyable_v<Plain>);
  out.put_bytes(std::as_bytes(std::span(&value, 1)));
}

void put(ByteSink& out, const std::string& text) {
  out.put(uint64_t{text.size()});
  out.put_bytes(std::as_bytes(std::span(text)));
}

template <class Plain>
Plain get(ByteSource& in) {
  Plain value;
  if (const auto bytes = in.take(sizeof value); !bytes.empty())
    std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

std::string get_text(ByteSource& in) {
  const auto bytes = in.take(in.get<uint64_t>());
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

std::vector<std::byte> encode(const IngestRecord& record) {
  std::vector<std::byte> bytes;
  ByteSink out(bytes);
  out.put(kRecordVersion);
  put(out, record.request);
  put(out, record.state);
  for (const SourceFile& file : record.files) {
    put(out, file.path);
    put(out, file.identity);
  }
  out.put(checksum64(bytes));
  return bytes;
}

IngestRecord decode_ingest_record(std::span<const std::byte> bytes) {
  const auto corrupt = [](const char* what) {
    return Error(
        ErrorCode::kCorrupt,
        std::string(
            "the job store (job.db in the work folder): the record of the read triangles ") +
            what + ": expected a complete record");
  };
  if (bytes.size() < sizeof(uint64_t)) throw corrupt("ends too early");
  ByteSource in(bytes.first(bytes.size() - sizeof(uint64_t)));
  if (const auto version = in.get<uint64_t>(); version != kRecordVersion)
    throw Error(
        ErrorCode::kUnsupportedVersion,
        "the job store (job.db in the work folder): the record of the read triangles has version " +
            std::to_string(version) + ": expected " + std::to_string(kRecordVersion));
  if (ByteSource(bytes.last(sizeof(uint64_t))).get<uint64_t>() !=
      checksum64(bytes.first(bytes.size() - sizeof(uint64_t))))
    throw corrupt("fails its checksum");
  IngestRecord record;
  record.request = get_text(in);
  record.state = get<IngestState>(in);
  while (in.left()) {
    const std::string path = get_text(in);
    record.files.push_back({path, get<FileIdentity>(in)});
  }
  if (!in.ok()) throw corrupt("ends too early");
  return record;
}

}  // namespace voxdag
