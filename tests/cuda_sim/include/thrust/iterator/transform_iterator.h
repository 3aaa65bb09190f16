#pragma once

#include <cstdint>

namespace thrust {

template <class T, class F>
struct transform_iterator {
  auto operator[](uint32_t i) const { return f(base[i]); }
  const T* base;
  F f;
};

template <class T, class F>
transform_iterator<T, F> make_transform_iterator(const T* base, F f) {
  return {base, f};
}

}  // namespace thrust
