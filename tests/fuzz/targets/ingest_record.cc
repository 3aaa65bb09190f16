// The record of an interrupted ingest in the job store, whose checksum is made to fit: what was
// decoded can be decoded again from its encoding, and its digest can be continued.
#include "scheduler/ingest/ingest_record.h"

#include "core/base/error.h"
#include "tests/fuzz/targets/fuzz_target.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxdag;
  const auto bytes = fuzz::with_checksum(fuzz::bytes_of(data, size));
  try {
    IngestRecord record = decode_ingest_record(bytes);
    const IngestRecord again = decode_ingest_record(encode(record));
    fuzz::require(again.request == record.request && again.files == record.files &&
                      again.state.position == record.state.position,
                  "a record that was decoded is encoded to the same record");
    const FixedTriangle triangle{};
    record.state.digest.add({&triangle, 1});
    fuzz::require(record.state.digest.hex().size() == 64, "a digest has 64 digits");
  } catch (const Error&) {
  }
  return 0;
}
