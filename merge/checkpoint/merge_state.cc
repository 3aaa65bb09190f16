#include "merge/checkpoint/merge_state.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/format/bytes.h"
#include "core/format/checksum.h"

namespace voxdag {
namespace {

constexpr uint64_t kMagic = 0x0a4752454d474456;  // "VDGMERG\n"
constexpr uint32_t kVersion = 3;

// The fields are described once for both directions: `code(field)` puts or gets one.
template <class Code, class T>
void code_all(Code& code, std::vector<T>& items) {
  code.resize(items);
  for (T& item : items) code_fields(code, item);
}

template <class Code>
void code_fields(Code& code, uint64_t& word) {
  code(word);
}

template <class Code>
void code_fields(Code& code, Cube& cube) {
  code(cube.level);
  for (uint32_t& coordinate : cube.position) code(coordinate);
}

template <class Code>
void code_fields(Code& code, ArtifactRef& ref) {
  code(ref.segment);
  code(ref.offset);
  code(ref.bytes);
  code(ref.index_offset);
  code(ref.checksum);
}

template <class Code>
void code_fields(Code& code, GlobalLevel& level) {
  code(level.nodes);
  code(level.words);
}

template <class Code>
void code_fields(Code& code, PlacedNode& node) {
  code_fields(code, node.cube);
  code(node.hash);
  code(node.position);
}

template <class Code>
void code_fields(Code& code, ArtifactRoot& root) {
  code_fields(code, root.cube);
  code(root.index);
  code(root.hash);
  code(root.voxels);
  code(root.svo_nodes);
}

template <class Code>
void code_fields(Code& code, MergeReport& report) {
  code(report.voxels);
  code(report.svo_nodes);
  code(report.dag_nodes);
  code(report.input_nodes);
  code(report.passes);
  code(report.scratch_bytes);
  code(report.hash_partitions);
  code(report.streamed_groups);
}

template <class Code>
void code_fields(Code& code, FinalPassState& pass) {
  code(pass.level);
  code.text(pass.output);
  code(pass.narrow_words);
  code_all(code, pass.file.levels);
  code_all(code, pass.file.checksums);
  code_all(code, pass.map_rows);
  code(pass.map.id);
  code(pass.map.words);
  code_all(code, pass.map.checksums);
  code_all(code, pass.placed);
  code_all(code, pass.roots);
}

template <class Code>
void code_state(Code& code, MergeState& state) {
  code(state.inputs_checksum);
  code(state.next_scratch_id);
  code_fields(code, state.report);
  code_all(code, state.intermediates);
  if (!code.flag(state.final_pass.has_value())) return;
  if (!state.final_pass) state.final_pass.emplace();
  code_fields(code, *state.final_pass);
}

class Put {
 public:
  explicit Put(ByteSink& out) : out_(out) {}
  template <class T>
  void operator()(const T& field) {
    out_.put(field);
  }
  template <class T>
  void resize(const std::vector<T>& items) {
    out_.put(uint64_t{items.size()});
  }
  bool flag(bool value) {
    out_.put(uint8_t{value});
    return value;
  }
  void text(const std::string& text) {
    out_.put(uint64_t{text.size()});
    out_.put_bytes(std::as_bytes(std::span(text)));
  }

 private:
  ByteSink& out_;
};

class Get {
 public:
  explicit Get(ByteSource& in) : in_(in) {}
  template <class T>
  void operator()(T& field) {
    field = in_.get<T>();
  }
  // Every item takes at least 8 bytes, so a damaged count cannot allocate more than the bytes hold.
  template <class T>
  void resize(std::vector<T>& items) {
    items.resize(count(8));
  }
  bool flag(bool) {
    const uint8_t value = in_.get<uint8_t>();
    if (value > 1) fail();
    return value == 1;
  }
  void text(std::string& text) {
    text.resize(count(1));
    const auto bytes = in_.take(text.size());
    std::copy(bytes.begin(), bytes.end(), std::as_writable_bytes(std::span(text)).begin());
  }

 private:
  size_t count(size_t min_bytes) {
    const uint64_t n = in_.get<uint64_t>();
    if (n <= in_.left() / min_bytes) return n;
    fail();
    return 0;
  }
  void fail() { in_.take(in_.left() + 1); }  // makes ok() false

  ByteSource& in_;
};

}  // namespace

std::vector<std::byte> encode_state(MergeState state) {
  std::vector<std::byte> bytes;
  ByteSink sink(bytes);
  sink.put(kMagic);
  sink.put(kVersion);
  Put put(sink);
  code_state(put, state);
  sink.put(checksum64(bytes));
  return bytes;
}

MergeState decode_state(std::span<const std::byte> bytes) {
  MergeState state;
  ByteSource source(bytes);
  bool sound = bytes.size() > sizeof(uint64_t);
  if (sound) {
    ByteSource end(bytes.last(sizeof(uint64_t)));
    sound = end.get<uint64_t>() == checksum64(bytes.first(bytes.size() - sizeof(uint64_t))) &&
            source.get<uint64_t>() == kMagic && source.get<uint32_t>() == kVersion;
  }
  if (sound) {
    Get get(source);
    code_state(get, state);
    sound = source.ok() && source.left() == sizeof(uint64_t);
  }
  if (!sound) throw Error(ErrorCode::kCorrupt, "the merge's state is damaged");
  return state;
}

}  // namespace voxdag
