#include "server/jobs/process/messages.h"

#include <nlohmann/json.hpp>

namespace voxdag::server {
namespace {

using nlohmann::json;

// Members of a line; each throws json::exception unless it is there and of its type.
const std::string& text(const json& line, const char* name) {
  return line.at(name).get_ref<const std::string&>();
}
uint64_t count(const json& line, const char* name) {
  return line.at(name).get_ref<const json::number_unsigned_t&>();
}

// Each message as JSON, and below it the same message read back.

json encoded(const StageBegun& m) {
  return {{"message", "stage_begun"}, {"stage", m.stage}, {"unit", m.unit}, {"total", m.total}};
}
StageBegun stage_begun(const json& line) {
  return {text(line, "stage"), text(line, "unit"), count(line, "total")};
}

json encoded(const StageAdvanced& m) {
  return {{"message", "stage_advanced"}, {"done", m.done}, {"total", m.total}};
}
StageAdvanced stage_advanced(const json& line) {
  return {count(line, "done"), count(line, "total")};
}

json encoded(const StageEnded&) { return {{"message", "stage_ended"}}; }

json encoded(const SubvolumeTotals& m) {
  return {{"message", "subvolumes"}, {"built", m.built}, {"total", m.total},
          {"voxels", m.voxels},      {"nodes", m.nodes}, {"bytes", m.bytes}};
}
SubvolumeTotals subvolumes(const json& line) {
  return {count(line, "built"), count(line, "total"), count(line, "voxels"), count(line, "nodes"),
          count(line, "bytes")};
}

json encoded(const Usage& m) {
  return {{"message", "usage"}, {"memory_bytes", m.memory_bytes}, {"disk_bytes", m.disk_bytes}};
}
Usage usage(const json& line) { return {count(line, "memory_bytes"), count(line, "disk_bytes")}; }

json encoded(const Warning& m) { return {{"message", "warning"}, {"text", m.text}}; }
Warning warning(const json& line) { return {text(line, "text")}; }

json encoded(const Failure& m) {
  return {{"message", "failure"}, {"code", m.code}, {"text", m.text}};
}
Failure failure(const json& line) { return {text(line, "code"), text(line, "text")}; }

json encoded(const Result& m) { return {{"message", "result"}, {"json", m.json}}; }
Result result(const json& line) { return {text(line, "json")}; }

}  // namespace

std::string encode(const Message& message) {
  return std::visit([](const auto& m) { return encoded(m); }, message)
      .dump(-1, ' ', false, json::error_handler_t::replace);
}

std::optional<Message> decode(std::string_view text_of_line) {
  try {
    const json line = json::parse(text_of_line);
    const std::string& name = text(line, "message");
    if (name == "stage_begun") return stage_begun(line);
    if (name == "stage_advanced") return stage_advanced(line);
    if (name == "stage_ended") return StageEnded{};
    if (name == "subvolumes") return subvolumes(line);
    if (name == "usage") return usage(line);
    if (name == "warning") return warning(line);
    if (name == "failure") return failure(line);
    if (name == "result") return result(line);
  } catch (const json::exception&) {
    // A broken line is as good as none.
  }
  return {};
}

}  // namespace voxdag::server
