#pragma once

#include <cstdint>

namespace thrust {

template <class T>
struct counting_iterator {
  explicit counting_iterator(T begin) : first(begin) {}
  T operator[](uint32_t i) const { return first + i; }
  T first;
};

}  // namespace thrust
