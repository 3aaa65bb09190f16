// Decodes the record of an interrupted ingest, which the job store keeps. The target corrects the
// checksum. If a decoded record is encoded and decoded again, the result is the same.
#include "scheduler/state/checkpoint/ingest_record.h"

#include "core/base/error.h"
#include "tests/fuzz/support/fuzz_target.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxdag;
  const auto bytes = fuzz::with_checksum(fuzz::bytes_of(data, size));
  try {
    const IngestRecord record = decode_ingest_record(bytes);
    const IngestRecord again = decode_ingest_record(encode(record));
    fuzz::require(again.request == record.request && again.files == record.files &&
                      again.state.position == record.state.position,
                  "a record that was decoded is encoded to the same record");
  } catch (const Error&) {
  }
  return 0;
}
