/* The queries of voxdag.h from C: usage query_example FILE.vdag */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <voxdag.h>

static void expect(voxdag_status status) {
  if (status == VOXDAG_OK) return;
  fprintf(stderr, "query_example: %s\n", voxdag_error());
  exit(1);
}

int main(int argc, char** argv) {
  if (argc != 2) {
    fprintf(stderr, "usage: query_example FILE.vdag\n");
    return 2;
  }
  voxdag_file* file;
  voxdag_facts facts = {.struct_size = sizeof facts};
  expect(voxdag_open(argv[1], &file));
  expect(voxdag_get_facts(file, &facts));
  const int64_t edge = INT64_C(1) << facts.grid_levels;

  const voxdag_region lower_half = {{0, 0, 0}, {edge, edge / 2, edge}};
  uint64_t count;
  expect(voxdag_count(file, facts.grid_levels, &lower_half, &count));
  printf("%llu of %llu voxels lie in the lower half\n", (unsigned long long)count,
         (unsigned long long)facts.voxels);

  /* Finds the first voxel below the center of the grid's top face. */
  const double middle = (double)edge / 2;
  const voxdag_ray down = {{middle, (double)edge, middle}, {0, -1, 0}};
  voxdag_hit hit;
  expect(voxdag_cast_rays(file, &down, 1, NULL, &hit));
  if (isfinite(hit.distance)) {
    uint8_t set = 0;
    expect(voxdag_lookup(file, facts.grid_levels, (const int64_t(*)[3])hit.voxel, 1, &set));
    printf("a ray down the middle hits voxel %lld %lld %lld, which is %s\n", (long long)hit.voxel[0],
           (long long)hit.voxel[1], (long long)hit.voxel[2], set ? "set" : "not set");
  }
  voxdag_close(file);
  return 0;
}
