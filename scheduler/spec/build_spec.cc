#include "scheduler/spec/build_spec.h"

#include <nlohmann/json.hpp>

namespace voxdag {

std::string geometry_json(const GeometryOptions& options) {
  nlohmann::ordered_json json = {{"resolution", options.resolution},
                                 {"hash_bits", options.hash_bits},
                                 {"skip_invalid", options.skip_invalid}};
  if (options.bounds) json["bounds"] = *options.bounds;
  if (options.voxel_size) json["voxel_size"] = *options.voxel_size;
  if (options.attributes.any()) json["color_resolution"] = options.color_resolution;
  if (options.attributes.any() && options.attributes != AttributeSet{Attribute::kColor})
    json["attributes"] = options.attributes.names();
  return json.dump();
}

}  // namespace voxdag
