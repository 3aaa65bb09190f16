// Converts paths and messages between Python, where a str can represent arbitrary bytes, and C++,
// where paths are bytes.
#pragma once

#include <nanobind/nanobind.h>

#include <string>
#include <utility>

namespace voxdag::python {

// A path as bytes. In Python, the path is a str in which each byte that is not UTF-8 is a surrogate
// character, as in the results of os.fsdecode().
struct PathText {
  std::string bytes;
};

// Returns a message as str. Bytes that are not UTF-8 become U+FFFD.
inline nanobind::object message_text(const std::string& message) {
  return nanobind::steal(
      PyUnicode_DecodeUTF8(message.data(), static_cast<Py_ssize_t>(message.size()), "replace"));
}

}  // namespace voxdag::python

namespace nanobind::detail {

template <>
struct type_caster<voxdag::python::PathText> {
  NB_TYPE_CASTER(voxdag::python::PathText, const_name("str"))

  bool from_python(handle source, uint8_t, cleanup_list*) noexcept {
    PyObject* bytes = nullptr;
    if (!PyUnicode_Check(source.ptr()) || !PyUnicode_FSConverter(source.ptr(), &bytes)) {
      PyErr_Clear();
      return false;
    }
    value.bytes.assign(PyBytes_AsString(bytes), static_cast<size_t>(PyBytes_Size(bytes)));
    Py_DECREF(bytes);
    return true;
  }
  static handle from_cpp(const voxdag::python::PathText& path, rv_policy, cleanup_list*) noexcept {
    return PyUnicode_DecodeFSDefaultAndSize(path.bytes.data(),
                                            static_cast<Py_ssize_t>(path.bytes.size()));
  }
};

}  // namespace nanobind::detail
