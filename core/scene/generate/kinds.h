// The generators, one file each. A generator that runs again with the same options makes the same
// calls: generate_scene() runs it twice.
#pragma once

#include "core/scene/generate/generate.h"
#include "core/scene/generate/scene_builder.h"

namespace voxdag {

void make_city(const GenerateOptions& options, SceneBuilder& scene);
void make_menger(const GenerateOptions& options, SceneBuilder& scene);
void make_terrain(const GenerateOptions& options, SceneBuilder& scene);
void make_soup(const GenerateOptions& options, SceneBuilder& scene);
void make_spheres(const GenerateOptions& options, SceneBuilder& scene);

}  // namespace voxdag
