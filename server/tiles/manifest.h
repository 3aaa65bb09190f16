// The manifest of a DAG for viewers (docs/api.md).
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "core/format/global/voxdag_reader.h"
#include "query/dag/dag_view.h"
#include "query/render/views.h"
#include "voxdag/cancel_token.h"

namespace voxdag::server {

// Position of a grid in the scene.
struct GridPlace {
  std::array<double, 3> origin{};
  double edge = 1;
};

// Returns the members that every manifest has. `root` is the word offset of the DAG's root node;
// nullopt if the DAG has no voxels.
nlohmann::ordered_json manifest_of(const query::DagView& dag, const std::string& digest,
                                   const GridPlace& place, std::optional<uint64_t> root);

// Aspect ratios (width / height) of the pictures for which a manifest has the cameras of named
// views. For a picture with another aspect ratio, a viewer computes the camera from both cameras.
inline constexpr double kWideAspect = 16.0 / 9, kTallAspect = 1.0 / 2;

// Returns the camera of the named view of a DAG, which must not be empty. Throws the errors of
// `views`.
nlohmann::ordered_json camera_of(const std::string& view, query::NamedViews& views,
                                 const query::DagView& dag, const GridPlace& place,
                                 double aspect = kWideAspect);

// Returns the placement, in voxels, of a camera that camera_of() has returned for a file.
query::Placement placement_of(const nlohmann::json& camera, const voxdag_reader::File& file);

// Returns the manifest of a file. Computing its cameras takes up to a second, or longer if the file
// must first be read from the disk.
nlohmann::ordered_json file_manifest(const voxdag_reader::File& file, const query::DagView& dag,
                                     const std::string& digest, const CancelToken& cancel);

}  // namespace voxdag::server
