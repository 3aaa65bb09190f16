// The native module voxdag._native. Users call the Python functions in python/voxdag, which call
// this module.
#include <nanobind/nanobind.h>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/format/global/open_global.h"
#include "python/native/bindings.h"
#include "python/native/path_text.h"

namespace nb = nanobind;

namespace voxdag::python {
namespace {

// Sets voxdag.Error, which voxdag/_error.py defines, as the current Python exception.
void raise(const Error& error) {
  const nb::object type = nb::module_::import_("voxdag._error").attr("Error");
  const nb::object raised = type(message_text(error.message()), error_name(error.code()));
  PyErr_SetObject(type.ptr(), raised.ptr());
}

}  // namespace
}  // namespace voxdag::python

NB_MODULE(_native, module) {
  voxdag::set_audience(voxdag::kPythonUsers);
  nb::register_exception_translator([](const std::exception_ptr& thrown, void*) {
    try {
      std::rethrow_exception(thrown);
    } catch (const voxdag::Error& error) {
      voxdag::python::raise(error);
    }
  });
  voxdag::python::bind_build(module);
  voxdag::python::bind_components(module);
  voxdag::python::bind_dag(module);
  voxdag::python::bind_derive(module);
  voxdag::python::bind_edit(module);
  voxdag::python::bind_render(module);
}
