#include "scheduler/build_spec.h"

#include <nlohmann/json.hpp>

namespace voxdag {

std::string geometry_json(const GeometryOptions& options) {
  nlohmann::ordered_json json = {{"resolution", options.resolution},
                                 {"hash_bits", options.hash_bits},
                                 {"skip_invalid", options.skip_invalid}};
  if (options.bounds) json["bounds"] = *options.bounds;
  if (options.voxel_size) json["voxel_size"] = *options.voxel_size;
  if (options.color) json["color_resolution"] = options.color_resolution;
  return json.dump();
}

}  // namespace voxdag
