// How long work tells the world how far it is. Stages follow one another; within a stage any
// thread may advance. Implementations (a terminal's bar, plain lines, the service) are thread-safe.
#pragma once

#include <cstdint>
#include <string_view>

namespace voxdag {

class Progress {
 public:
  virtual ~Progress() = default;
  // A stage starts; `total` counts `unit`s ("triangles", "subvolumes", "nodes"), 0 if unknown.
  virtual void begin_stage(std::string_view stage, uint64_t total, std::string_view unit) = 0;
  // `count` more units are done.
  virtual void advance(uint64_t count) = 0;
  // The total became known or changed (a subvolume was split, say).
  virtual void set_total(uint64_t total) = 0;
  virtual void end_stage() = 0;
  // A warning that a user should read, one sentence.
  virtual void warn(std::string_view message) = 0;
};

// Says nothing.
class NoProgress : public Progress {
 public:
  void begin_stage(std::string_view, uint64_t, std::string_view) override {}
  void advance(uint64_t) override {}
  void set_total(uint64_t) override {}
  void end_stage() override {}
  void warn(std::string_view) override {}
};

}  // namespace voxdag
