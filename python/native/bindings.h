// Functions that add classes and functions to the native module voxdag._native.
#pragma once

#include <nanobind/nanobind.h>

namespace voxdag::python {

void bind_build(nanobind::module_& module);  // build and plan
void bind_components(nanobind::module_& module);
void bind_dag(nanobind::module_& module);     // finished files
void bind_derive(nanobind::module_& module);  // extracts and exports
void bind_edit(nanobind::module_& module);    // edits
void bind_render(nanobind::module_& module);  // pictures

}  // namespace voxdag::python
