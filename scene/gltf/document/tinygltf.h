// tinygltf without its image decoders, in a namespace of voxdag. Draco's archive contains another
// version of tinygltf, and a program that links voxdag may contain one as well. Two versions in one
// namespace would crash.
#pragma once

#include <nlohmann/json.hpp>

#include "scene/gltf/document/tinygltf_model.h"

#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_INCLUDE_JSON
#define tinygltf voxdag_tinygltf
#include <tiny_gltf.h>
#undef tinygltf
