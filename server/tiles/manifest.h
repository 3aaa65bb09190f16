// The manifest of a DAG for viewers (docs/api.md).
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "query/dag/dag_view.h"
#include "query/render/views.h"

namespace voxdag::server {

// Position of a grid in the scene.
struct GridPlace {
  std::array<double, 3> origin{};
  double edge = 1;
};

// Returns the members that all manifests have. `root` is the word offset of the root; nullopt for a
// DAG without voxels.
nlohmann::ordered_json manifest_of(const query::DagView& dag, const std::string& digest,
                                   const GridPlace& place, std::optional<uint64_t> root);

// Returns a named view of a DAG that is not empty. Throws like `views`.
nlohmann::ordered_json camera_of(const std::string& view, query::NamedViews& views,
                                 const query::DagView& dag, const GridPlace& place);

}  // namespace voxdag::server
