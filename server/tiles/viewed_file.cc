#include "server/tiles/viewed_file.h"

#include <array>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/format/checksum.h"
#include "core/format/global/open_global.h"
#include "query/render/views.h"

namespace voxdag::server {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kHeaderBytes = 4096;
constexpr size_t kDigestDigits = 32;
// Of the pictures that the named views are made for.
constexpr double kAspect = 16.0 / 9;

// The header page has the checksum of the table of the checksums of all other bytes.
std::string digest_of(const voxdag_reader::File& file) {
  std::string text(reinterpret_cast<const char*>(file.data()), kHeaderBytes);
  text += "tiles 1 " + std::to_string(kTileLevels);
  if (file.has_colors()) text += " colors 1";
  return sha256_hex(text).substr(0, kDigestDigits);
}

Json camera(const std::string& view, const query::DagView& dag, const voxdag_reader::File& file) {
  const query::Placement p = query::named_view(view, dag, kAspect, {});
  return {{"position", query::world_point(p.eye, file)},
          {"target", query::world_point(p.target, file)},
          {"fov_degrees", p.fov_degrees}};
}

Json describe(const voxdag_reader::File& file, const query::DagView& dag,
              const std::string& digest) {
  const uint32_t levels = file.grid_levels();
  Json json = {{"digest", digest},
               {"resolution", file.resolution()},
               {"levels", levels},
               {"tile_levels", kTileLevels},
               {"batch_max", kMaxTilesOfBatch},
               {"origin", file.origin()},
               {"edge", file.edge()},
               {"voxels", std::to_string(file.voxels())},
               {"root", nullptr}};
  if (file.has_colors())
    json["colors"] = {{"levels", file.color_levels()}, {"batch_max", kMaxColorPagesOfBatch}};
  if (dag.empty()) return json;
  json["root"] = {{"level", 0}, {"offset", 0}};
  if (file.brick_level() == 0) {
    const uint64_t mask = dag.brick(0);
    json["root_brick"] = {static_cast<uint32_t>(mask), static_cast<uint32_t>(mask >> 32)};
  }
  const query::Box box = query::occupied_box(dag);
  json["box"] = {{"low", box.low.v}, {"high", box.high.v}};
  json["camera"] = camera("auto", dag, file);
  for (const std::string& view : query::view_names())
    if (view != "auto" && view != "inside") json["views"][view] = camera(view, dag, file);
  return json;
}

}  // namespace

ViewedFile::ViewedFile(const std::string& path, const FileIdentity& identity)
    : ViewedFile(path, identity, map_global_file(path)) {}

ViewedFile::ViewedFile(const std::string& path, const FileIdentity& identity,
                       std::shared_ptr<const voxdag_reader::Bytes> bytes)
    : identity_(identity),
      bytes_(std::move(bytes)),
      mapping_(bytes_->data(), bytes_->size()),
      file_(read_header(path)),
      dag_(*file_),
      digest_(digest_of(*file_)) {
  expect_whole();
}

std::unique_ptr<voxdag_reader::File> ViewedFile::read_header(const std::string& path) const {
  try {
    return open_global_bytes(path, bytes_);
  } catch (const Error&) {
    expect_whole();  // what zeros look like says nothing about the file
    throw;
  }
}

const std::string& ViewedFile::manifest() const {
  std::call_once(manifest_once_, [&] { manifest_ = describe(*file_, dag_, digest_).dump(); });
  return manifest_;
}

void ViewedFile::expect_whole() const {
  if (mapping_.is_damaged())
    throw Error(ErrorCode::kIo,
                "the DAG became shorter, or its disk failed, while it was looked at");
}

}  // namespace voxdag::server
