#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "cli/output.h"
#include "cli/selection_options.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/fields/json_text.h"
#include "core/format/checksum.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/open_global.h"
#include "query/components/components.h"
#include "query/stats/level_stats.h"

namespace voxdag::cli {
namespace {

using nlohmann::ordered_json;

struct InfoCommand {
  std::vector<std::string> paths;
  std::string memory;
  bool digest = false;
  bool stats = false;
  bool csv = false;
  bool levels = false;
  bool json = false;
  bool components = false;
  unsigned connectivity = 26;
};

struct FileFacts {
  std::unique_ptr<voxdag_reader::File> file;
  std::string sha256;                                 // "" if not requested
  std::optional<query::DagStats> stats;               // only with --stats
  std::optional<query::ComponentsReport> components;  // only with --components
  unsigned connectivity = 26;
};

uint64_t level_bytes(const voxdag_reader::Level& level) {
  return level.word_count * sizeof(uint32_t);
}

// Returns the total size of the nodes in bytes, without colors, checksums and padding.
uint64_t node_bytes(const voxdag_reader::File& file) {
  uint64_t bytes = 0;
  for (uint32_t l = 0; l <= file.brick_level() && !file.empty(); ++l)
    bytes += level_bytes(file.level(l));
  return bytes;
}

double bits_per_voxel(const voxdag_reader::File& file) {
  return file.empty()
             ? 0
             : 8 * static_cast<double>(node_bytes(file)) / static_cast<double>(file.voxels());
}

// Returns the number of nodes of the same DAG with leaves of 2x2x2 voxels instead of bricks of
// 4x4x4 voxels. Publications such as SymVox count nodes in this way.
uint64_t dag_nodes_2(const FileFacts& facts) {
  return facts.file->dag_nodes() + facts.stats->octant_masks;
}

ordered_json level_json(const FileFacts& facts, uint32_t l) {
  const voxdag_reader::Level& level = facts.file->level(l);
  ordered_json json = {{"level", l}, {"nodes", level.node_count}, {"bytes", level_bytes(level)}};
  if (!facts.stats || facts.file->empty()) return json;
  const query::LevelStats& stats = facts.stats->levels[l];
  json["svo_nodes"] = stats.svo_nodes;
  json["nodes_by_children"] = stats.nodes_by_children;
  return json;
}

// Returns the name of the order of the nodes (docs/format.md, "Node order"), or its number if this
// program does not know the order.
std::string order_of(const voxdag_reader::File& file) {
  const std::string name = name_of(NodeOrder{file.node_order()});
  return name.empty() ? std::to_string(file.node_order()) : name;
}

ordered_json components_json(const FileFacts& facts) {
  ordered_json largest = ordered_json::array();
  for (const query::Component& c : facts.components->largest)
    largest.push_back({{"voxels", c.voxels},
                       {"box", {c.low[0], c.low[1], c.low[2], c.high[0], c.high[1], c.high[2]}}});
  return {{"connectivity", facts.connectivity},
          {"count", facts.components->components},
          {"largest", largest}};
}

ordered_json info_json(const FileFacts& facts) {
  const voxdag_reader::File& file = *facts.file;
  ordered_json levels = ordered_json::array();
  for (uint32_t l = 0; l <= file.brick_level(); ++l) levels.push_back(level_json(facts, l));
  const double(&origin)[3] = file.origin();
  ordered_json json{
      {"file", file.path()},
      {"resolution", file.resolution()},
      {"bounds", {{"origin", {origin[0], origin[1], origin[2]}}, {"edge", file.edge()}}},
      {"hash_bits", file.hash_bits()},
      {"node_order", order_of(file)},
      {"voxels", file.voxels()},
      {"svo_nodes", file.svo_nodes()},
      {"dag_nodes", file.dag_nodes()},
      {"bytes", file.file_bytes()},
      {"node_bytes", node_bytes(file)},
      {"bits_per_voxel", bits_per_voxel(file)}};
  if (facts.stats) json["dag_nodes_2x2x2"] = dag_nodes_2(facts);
  json["levels"] = levels;
  if (facts.components) json["components"] = components_json(facts);
  add_attribute_facts(file, json);
  if (!facts.sha256.empty()) json["sha256"] = facts.sha256;
  return json;
}

// Returns a JSON value as a field of a CSV line (RFC 4180). Quotes a string with a comma, a space
// or a quote.
std::string csv_field(const ordered_json& value) {
  if (!value.is_string()) return exact_json_text(value);
  std::string text;
  for (const char c : printable_line(value.get<std::string>()))
    text += c == '"' ? "\"\"" : std::string(1, c);
  return text.find_first_of(",\" ") == std::string::npos ? text : "\"" + text + "\"";
}

// Replaces the array `nodes_by_children` of a level by the members children_1 to children_8,
// because each member becomes a column of the CSV table.
void flatten(ordered_json& row) {
  if (!row.contains("nodes_by_children")) return;
  const ordered_json counts = row["nodes_by_children"];
  row.erase("nodes_by_children");
  for (size_t i = 0; i < counts.size(); ++i) row["children_" + std::to_string(i + 1)] = counts[i];
}

// Returns the rows of the CSV table: one for each file, or with --levels one for each level of each
// file.
std::vector<ordered_json> csv_rows(const InfoCommand& command, const std::vector<FileFacts>& all) {
  std::vector<ordered_json> rows;
  for (const FileFacts& facts : all) {
    const ordered_json json = info_json(facts);
    ordered_json head;
    for (const char* name : {"file", "resolution", "voxels", "svo_nodes", "dag_nodes",
                             "dag_nodes_2x2x2", "bytes", "node_bytes", "bits_per_voxel", "sha256"})
      if (json.contains(name)) head[name] = json[name];
    if (facts.components) head["components"] = facts.components->components;
    if (!command.levels) {
      rows.push_back(head);
      continue;
    }
    for (const ordered_json& level : json["levels"]) {
      ordered_json row = {{"file", json["file"]}, {"resolution", json["resolution"]}};
      row.update(level);
      flatten(row);
      rows.push_back(row);
    }
  }
  return rows;
}

void print_csv(const std::vector<ordered_json>& rows) {
  std::string line;
  for (const auto& [name, value] : rows.front().items()) line += (line.empty() ? "" : ",") + name;
  std::printf("%s\n", line.c_str());
  for (const ordered_json& row : rows) {
    line.clear();
    for (const auto& [name, value] : row.items())
      line += (line.empty() ? "" : ",") + csv_field(value);
    std::printf("%s\n", line.c_str());
  }
}

void print_levels(const FileFacts& facts) {
  const voxdag_reader::File& file = *facts.file;
  const bool has_stats = facts.stats && !file.empty();
  std::printf("  level  cube edge            nodes         size%s\n",
              has_stats ? "     octree nodes  nodes with 1 to 8 children" : "");
  for (uint32_t l = 0; l <= file.brick_level(); ++l) {
    std::printf("  %5u  %9lld  %15s  %11s", l, static_cast<long long>(file.resolution() >> l),
                count_text(file.level(l).node_count).c_str(),
                size_text(level_bytes(file.level(l))).c_str());
    if (has_stats) {
      std::printf("  %15s ", count_text(facts.stats->levels[l].svo_nodes).c_str());
      for (const uint64_t nodes : facts.stats->levels[l].nodes_by_children)
        std::printf(" %llu", static_cast<unsigned long long>(nodes));
    }
    std::printf("%s\n", l == file.brick_level() ? "  (bricks)" : "");
  }
}

void print_components(const FileFacts& facts) {
  const query::ComponentsReport& report = *facts.components;
  std::printf("  %s component%s (%u neighbors)%s\n", count_text(report.components).c_str(),
              report.components == 1 ? "" : "s", facts.connectivity,
              report.components > report.largest.size() ? ", the largest are:" : "");
  if (!report.largest.empty()) std::printf("           voxels  box\n");
  for (const query::Component& c : report.largest)
    std::printf("  %15s  %u,%u,%u,%u,%u,%u\n", count_text(c.voxels).c_str(), c.low[0], c.low[1],
                c.low[2], c.high[0], c.high[1], c.high[2]);
}

void print(const FileFacts& facts) {
  const voxdag_reader::File& file = *facts.file;
  const double(&origin)[3] = file.origin();
  std::printf("%s: %s\n", printable_line(file.path()).c_str(),
              size_text(file.file_bytes()).c_str());
  if (!facts.sha256.empty()) std::printf("  sha256 %s\n", facts.sha256.c_str());
  std::printf("  grid of %lld^3 voxels, low corner %.9g %.9g %.9g, edge %.9g\n",
              static_cast<long long>(file.resolution()), origin[0], origin[1], origin[2],
              file.edge());
  std::printf("  %s voxels, %s octree nodes, %s DAG nodes, hashes of %u bits\n",
              count_text(file.voxels()).c_str(), count_text(file.svo_nodes()).c_str(),
              count_text(file.dag_nodes()).c_str(), file.hash_bits());
  std::printf("  %s of nodes, %.4g bits per voxel\n", size_text(node_bytes(file)).c_str(),
              bits_per_voxel(file));
  if (NodeOrder{file.node_order()} != NodeOrder::kByHash)
    std::printf("  nodes in the order %s\n", order_of(file).c_str());
  if (facts.stats)
    std::printf("  with leaves of 2^3 instead of 4^3 voxels: %s DAG nodes\n",
                count_text(dag_nodes_2(facts)).c_str());
  for (const Attribute attribute : attributes_of(file).list()) {
    const ordered_json section = section_facts(section_of(file, attribute));
    std::printf("  %s of %lld^3 cells and coarser ones: %s, %s\n", traits_of(attribute).plural,
                static_cast<long long>(section["resolution"].get<int64_t>()),
                count_text(section["cells"].get<uint64_t>()).c_str(),
                size_text(section["bytes"].get<uint64_t>()).c_str());
  }
  // The last name is "" and stands for triangles without a material, so it is not counted.
  for (const AttributeTraits& row : kAttributeTable)
    if (const auto& names = section_of(file, row.attribute).names(); !names.empty())
      std::printf("  %s %s\n", count_text(names.size() - 1).c_str(), row.plural);
  print_levels(facts);
  if (facts.components) print_components(facts);
}

FileFacts facts_of(const InfoCommand& command, const std::string& path, CommandContext& context) {
  FileFacts facts;
  facts.file = open_global_file(path);
  if (command.digest) facts.sha256 = sha256_of_file(*context.files.open_read(path), context.cancel);
  MemoryBudget budget(memory_limit(command.memory));
  if (command.stats) facts.stats = query::dag_stats(*facts.file, budget, context.cancel);
  if (!command.components) return facts;
  facts.connectivity = command.connectivity;
  const query::ComponentRule rule{command.connectivity == 6 ? query::Connectivity::kFaces
                                                            : query::Connectivity::kCorners};
  const auto progress = make_progress_bar(command.json || command.csv);
  facts.components = query::find_components(*facts.file, rule, budget, *progress, context.cancel);
  return facts;
}

void run(const InfoCommand& command, CommandContext& context) {
  std::vector<FileFacts> all;
  for (const std::string& path : command.paths) all.push_back(facts_of(command, path, context));
  if (command.csv) return print_csv(csv_rows(command, all));
  if (command.json && all.size() == 1) return print_json(info_json(all.front()));
  if (!command.json) {
    for (const FileFacts& facts : all) print(facts);
    return;
  }
  ordered_json list = ordered_json::array();
  for (const FileFacts& facts : all) list.push_back(info_json(facts));
  print_json(ordered_json{{"files", list}});
}

void declare(Command& command, InfoCommand& state) {
  command.option("file", state.paths, "the .vdag file; several may be given").required();
  command.flag("--digest", state.digest, "also print the SHA-256 of the file");
  command.flag(
      "--stats", state.stats,
      "also count the octree nodes of each level, the nodes by their children, and the DAG "
      "nodes with leaves of 2^3 voxels");
  const Option components = command.flag(
      "--components", state.components,
      "also find the connected components of the voxels: their number, and the sizes and boxes of "
      "the largest ones");
  Option connectivity = command.text_option(
      "--connectivity", "6|26",
      [&state](const std::string& text) {
        if (text != "6" && text != "26")
          throw Error(ErrorCode::kInvalidInput,
                      "--connectivity '" + text +
                          "': expected 6 (voxels with a common face are connected) or 26 (also "
                          "with a common edge or corner)");
        state.connectivity = text == "6" ? 6 : 26;
      },
      "neighbors of a voxel that --components connects with it: 6 (common face), or 26 (also "
      "common edge or corner; default)");
  connectivity.needs(components);
  Option csv = command.flag("--csv", state.csv, "print a table as CSV, one line per file");
  Option levels = command.flag("--levels", state.levels, "one line of CSV per level");
  levels.needs(csv);
  command.option(
      "--memory", state.memory,
      "limit of the memory that --stats and --components allocate (default: half the RAM; "
      "at least 64MiB)");
  csv.excludes(command.json_flag(state.json));
}

}  // namespace

void add_info_command(CommandLine& line) {
  add_command<InfoCommand>(line, "info", "print counts and sizes of DAGs, per level");
}

}  // namespace voxdag::cli
