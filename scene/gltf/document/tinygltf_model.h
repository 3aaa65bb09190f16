// Declares tinygltf's model; tinygltf.h defines it.
#pragma once

namespace voxdag_tinygltf {
class Model;
}

namespace voxdag::gltf {
namespace tinygltf = voxdag_tinygltf;
}
