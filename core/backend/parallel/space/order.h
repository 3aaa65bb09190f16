// A permutation of items, refined by stable radix sorts. To sort by a long key, sort by its least
// significant part first, then by the more significant parts.
#pragma once

#include <cstdint>

#include "core/backend/parallel/space/space.h"
#include "core/base/host_device.h"

namespace voxdag::parallel {

struct CountUp {
  uint32_t* out;
  VOXDAG_HD void operator()(uint32_t i) const { out[i] = i; }
};

template <class Key>
struct KeysInOrder {
  Key key;
  const uint32_t* items;
  uint64_t* keys;
  VOXDAG_HD void operator()(uint32_t i) const { keys[i] = key(items[i]); }
};

template <class T>
struct Gather {
  const uint32_t* items;
  const T* from;
  T* to;
  VOXDAG_HD void operator()(uint32_t i) const { to[i] = from[items[i]]; }
};

// Returns an array of the elements from[items[i]] for i < count.
template <class T, class Space>
SpaceArray<Space, T> gather(Space& space, uint32_t count, const uint32_t* items, const T* from) {
  SpaceArray<Space, T> out(space, count);
  space.for_each(count, Gather<T>{items, from, out.data()});
  return out;
}

struct InvertOrder {
  const uint32_t* items;
  uint32_t* place_of;
  VOXDAG_HD void operator()(uint32_t i) const { place_of[items[i]] = i; }
};

template <class Space>
class Order {
 public:
  Order(Space& space, uint32_t count)
      : space_(space), count_(count), keys_(space, count), items_(space, count) {
    space_.for_each(count, CountUp{items_.data()});
  }

  uint32_t count() const { return count_; }
  const uint32_t* items() const { return items_.data(); }

  // Sorts the items stably by a range of the bits of key(item). The functor `key` must have a
  // host+device operator(), because the space may call it on the device.
  template <class Key>
  void sort_by(Key key, BitRange bits) {
    SpaceArray<Space, uint64_t> key_scratch(space_, count_);
    SpaceArray<Space, uint32_t> item_scratch(space_, count_);
    space_.for_each(count_, KeysInOrder<Key>{key, items_.data(), keys_.data()});
    space_.sort_pairs(keys_, key_scratch, items_, item_scratch, count_, bits);
  }

  // Returns the inverse permutation: the position of each item.
  SpaceArray<Space, uint32_t> places() {
    SpaceArray<Space, uint32_t> place_of(space_, count_);
    space_.for_each(count_, InvertOrder{items_.data(), place_of.data()});
    return place_of;
  }

 private:
  Space& space_;
  const uint32_t count_;
  SpaceArray<Space, uint64_t> keys_;
  SpaceArray<Space, uint32_t> items_;
};

struct KeyAt {
  const uint64_t* keys;
  VOXDAG_HD uint64_t operator()(uint32_t item) const { return keys[item]; }
};

}  // namespace voxdag::parallel
