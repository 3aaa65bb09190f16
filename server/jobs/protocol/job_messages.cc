#include "server/jobs/protocol/job_messages.h"

#include <iterator>
#include <utility>

#include "core/fields/json_text.h"
#include "server/base/warning_json.h"

namespace voxdag {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ClusterTasks, batches, built, waiting, failed_attempts, running,
                                   built_of_node)

}  // namespace voxdag

namespace voxdag::server {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(StageBegun, stage, unit, total)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(StageResumed, done)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(StageAdvanced, done, total)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SubvolumeTotals, built, total, voxels, nodes, bytes)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Usage, memory_bytes, disk_bytes)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(WarningReported, warning)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Failure, code, text)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Result, json)
void to_json(nlohmann::json& line, const StageEnded&) { line = nlohmann::json::object(); }
void from_json(const nlohmann::json&, StageEnded&) {}

namespace {

// Names of the messages, in the order of the variant's alternatives.
constexpr std::string_view kNames[] = {
    "stage_begun", "stage_resumed", "stage_advanced", "stage_ended", "subvolumes",
    "usage",       "cluster_tasks", "warning",        "failure",     "result"};
constexpr size_t kKinds = std::variant_size_v<Message>;
static_assert(std::size(kNames) == kKinds);

// True if all numbers in `object` are unsigned integers. Also checks the objects in it, down to a
// nesting depth of `depth`. The JSON library would silently convert other numbers.
bool has_whole_numbers(const nlohmann::json& object, int depth) {
  for (const auto& member : object) {
    if (member.is_number() && !member.is_number_unsigned()) return false;
    if (depth > 0 && member.is_object() && !has_whole_numbers(member, depth - 1)) return false;
  }
  return true;
}

template <size_t... I>
std::optional<Message> message_of(const nlohmann::json& line, std::index_sequence<I...>) {
  const std::string& name = line.at("message").get_ref<const std::string&>();
  std::optional<Message> message;
  ((name == kNames[I] ? void(message = line.get<std::variant_alternative_t<I, Message>>())
                      : void()),
   ...);
  return message;
}

}  // namespace

std::string encode(const Message& message) {
  nlohmann::json line = std::visit([](const auto& m) { return nlohmann::json(m); }, message);
  line["message"] = kNames[message.index()];
  return json_text(line);
}

std::optional<Message> decode(std::string_view text) {
  try {
    const auto line = parse_json<nlohmann::json>(text);
    if (!has_whole_numbers(line, 1)) return {};
    return message_of(line, std::make_index_sequence<kKinds>());
  } catch (const nlohmann::json::exception&) {
    // A malformed line is not a message.
  }
  return {};
}

}  // namespace voxdag::server
