#define TINYGLTF_IMPLEMENTATION
#include "scene/gltf/document/tinygltf.h"
