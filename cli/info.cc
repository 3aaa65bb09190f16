#include <cstdio>
#include <nlohmann/json.hpp>

#include "cli/output.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/format/checksum.h"
#include "core/format/global/open_global.h"

namespace voxdag::cli {
namespace {

struct InfoCommand {
  std::string path;
  bool digest = false;
  bool json = false;
};

uint64_t level_bytes(const voxdag_reader::Level& level) {
  return level.word_count * sizeof(uint32_t);
}

nlohmann::ordered_json info_json(const voxdag_reader::File& file, const std::string& sha256) {
  nlohmann::ordered_json levels = nlohmann::ordered_json::array();
  for (uint32_t l = 0; l <= file.brick_level(); ++l)
    levels.push_back(
        {{"level", l}, {"nodes", file.level(l).node_count}, {"bytes", level_bytes(file.level(l))}});
  const double(&origin)[3] = file.origin();
  nlohmann::ordered_json json{
      {"resolution", file.resolution()},
      {"bounds", {{"origin", {origin[0], origin[1], origin[2]}}, {"edge", file.edge()}}},
      {"hash_bits", file.hash_bits()},
      {"voxels", file.voxels()},
      {"svo_nodes", file.svo_nodes()},
      {"dag_nodes", file.dag_nodes()},
      {"bytes", file.file_bytes()},
      {"levels", levels}};
  add_attribute_facts(file, json);
  if (!sha256.empty()) json["sha256"] = sha256;
  return json;
}

void print(const voxdag_reader::File& file, const std::string& sha256) {
  const double(&origin)[3] = file.origin();
  std::printf("%s: %s\n", printable_line(file.path()).c_str(),
              size_text(file.file_bytes()).c_str());
  if (!sha256.empty()) std::printf("  sha256 %s\n", sha256.c_str());
  std::printf("  grid of %lld^3 voxels, low corner %.9g %.9g %.9g, edge %.9g\n",
              static_cast<long long>(file.resolution()), origin[0], origin[1], origin[2],
              file.edge());
  std::printf("  %s voxels, %s octree nodes, %s DAG nodes, hashes of %u bits\n",
              count_text(file.voxels()).c_str(), count_text(file.svo_nodes()).c_str(),
              count_text(file.dag_nodes()).c_str(), file.hash_bits());
  for (const Attribute attribute : attributes_of(file).list()) {
    const nlohmann::ordered_json facts = section_facts(section_of(file, attribute));
    std::printf("  %s of %lld^3 cells and coarser ones: %s, %s\n", traits_of(attribute).plural,
                static_cast<long long>(facts["resolution"].get<int64_t>()),
                count_text(facts["cells"].get<uint64_t>()).c_str(),
                size_text(facts["bytes"].get<uint64_t>()).c_str());
  }
  // The last name is "" and stands for triangles without a material, so it is not counted.
  for (const AttributeTraits& row : kAttributeTable)
    if (const auto& names = section_of(file, row.attribute).names(); !names.empty())
      std::printf("  %s %s\n", count_text(names.size() - 1).c_str(), row.plural);
  std::printf("  level  cube edge            nodes         size\n");
  for (uint32_t l = 0; l <= file.brick_level(); ++l)
    std::printf("  %5u  %9lld  %15s  %11s%s\n", l, static_cast<long long>(file.resolution() >> l),
                count_text(file.level(l).node_count).c_str(),
                size_text(level_bytes(file.level(l))).c_str(),
                l == file.brick_level() ? "  (bricks)" : "");
}

void run(const InfoCommand& command, CommandContext& context) {
  const auto file = open_global_file(command.path);
  const std::string sha256 =
      command.digest ? sha256_of_file(*context.files.open_read(command.path), context.cancel) : "";
  if (command.json)
    print_json(info_json(*file, sha256));
  else
    print(*file, sha256);
}

void declare(Command& command, InfoCommand& state) {
  command.option("file", state.path, "the .vdag file").required();
  command.flag("--digest", state.digest, "also print the SHA-256 of the file");
  command.json_flag(state.json);
}

}  // namespace

void add_info_command(CommandLine& line) {
  add_command<InfoCommand>(line, "info", "print counts and sizes of a DAG, per level");
}

}  // namespace voxdag::cli
