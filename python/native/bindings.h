// Functions that add the members of the native module.
#pragma once

#include <nanobind/nanobind.h>

namespace voxdag::python {

void bind_build(nanobind::module_& module);   // build and plan
void bind_dag(nanobind::module_& module);     // finished files
void bind_derive(nanobind::module_& module);  // extracts and exports
void bind_render(nanobind::module_& module);  // pictures

}  // namespace voxdag::python
