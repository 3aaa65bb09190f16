#include "merge/checkpoint/merge_state.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/fields/field.h"
#include "core/format/artifact/artifact_fields.h"
#include "core/format/bytes.h"
#include "core/format/checksum.h"

namespace voxdag {

template <class Visitor>
void fields(Visitor& visit, GlobalLevel& level) {
  visit("nodes", level.nodes);
  visit("words", level.words);
}

template <class Visitor>
void fields(Visitor& visit, PlacedNode& node) {
  visit("cube", node.cube);
  visit("hash", node.hash);
  visit("position", node.position);
}

template <class Visitor>
void fields(Visitor& visit, ArtifactRoot& root) {
  visit("cube", root.cube);
  visit("index", root.index);
  visit("hash", root.hash);
  visit("voxels", root.voxels);
  visit("svo_nodes", root.svo_nodes);
}

template <class Visitor>
void fields(Visitor& visit, MergeReport& report) {
  visit("voxels", report.voxels);
  visit("svo_nodes", report.svo_nodes);
  visit("dag_nodes", report.dag_nodes);
  visit("input_nodes", report.input_nodes);
  visit("passes", report.passes);
  visit("scratch_bytes", report.scratch_bytes);
  visit("hash_partitions", report.hash_partitions);
  visit("streamed_groups", report.streamed_groups);
}

template <class Visitor>
void fields(Visitor& visit, FinalPassState& pass) {
  visit("level", pass.level);
  visit("output", pass.output);
  visit("narrow_words", pass.narrow_words);
  visit("levels", pass.file.levels);
  visit("checksums", pass.file.checksums);
  visit("map_rows", pass.map_rows);
  visit("map_id", pass.map.id);
  visit("map_words", pass.map.words);
  visit("map_checksums", pass.map.checksums);
  visit("placed", pass.placed);
  visit("roots", pass.roots);
}

template <class Visitor>
void fields(Visitor& visit, MergeState& state) {
  visit("inputs_checksum", state.inputs_checksum);
  visit("next_scratch_id", state.next_scratch_id);
  visit("report", state.report);
  visit("intermediates", state.intermediates);
  visit("final_pass", state.final_pass);
}

namespace {

constexpr uint64_t kMagic = 0x0a4752454d474456;  // "VDGMERG\n"
constexpr uint32_t kVersion = 3;

// Base class of Put, which encodes, and of Get, which decodes, all members that fields() lists. The
// derived class provides the functions for words, counts, flags and texts.
template <class Derived>
class Coder {
 public:
  template <class T>
  void operator()(const char*, T& value) {
    auto& self = static_cast<Derived&>(*this);
    if constexpr (IsVector<T>::value) {
      self.count(value, 8);
      for (auto& item : value) (*this)("", item);
    } else if constexpr (IsOptional<T>::value) {
      if (!self.flag(value.has_value())) return;
      if (!value) value.emplace();
      (*this)("", *value);
    } else if constexpr (std::is_same_v<T, std::string>) {
      self.text(value);
    } else if constexpr (std::is_arithmetic_v<T>) {
      self.word(value);
    } else {
      fields(self, value);
    }
  }
};

class Put : public Coder<Put> {
 public:
  explicit Put(ByteSink& out) : out_(out) {}
  template <class T>
  void word(const T& word) {
    out_.put(word);
  }
  void count(const auto& items, size_t) { out_.put(uint64_t{items.size()}); }
  bool flag(bool value) {
    out_.put(uint8_t{value});
    return value;
  }
  void text(const std::string& text) {
    count(text, 1);
    out_.put_bytes(std::as_bytes(std::span(text)));
  }

 private:
  ByteSink& out_;
};

class Get : public Coder<Get> {
 public:
  explicit Get(ByteSource& in) : in_(in) {}
  template <class T>
  void word(T& word) {
    word = in_.get<T>();
  }
  // Reads a count and resizes `items` to it. Each item takes at least `min_bytes` of the input, so
  // a count is damaged if it exceeds the number of items for which bytes are left. For such a
  // count, no memory is allocated.
  void count(auto& items, size_t min_bytes) {
    const uint64_t n = in_.get<uint64_t>();
    if (n <= in_.left() / min_bytes)
      items.resize(n);
    else
      fail();
  }
  bool flag(bool) {
    const uint8_t value = in_.get<uint8_t>();
    if (value > 1) fail();
    return value == 1;
  }
  void text(std::string& text) {
    count(text, 1);
    const auto bytes = in_.take(text.size());
    std::copy(bytes.begin(), bytes.end(), std::as_writable_bytes(std::span(text)).begin());
  }

 private:
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
  fields(put, state);
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
    fields(get, state);
    sound = source.ok() && source.left() == sizeof(uint64_t);
  }
  if (!sound)
    throw Error(ErrorCode::kCorrupt,
                "the merge's saved state is damaged: expected a state of version " +
                    std::to_string(kVersion) + " with its checksum");
  return state;
}

}  // namespace voxdag
