/* Queries of finished .vdag files, for C and everything that can call it. libvoxdag.so holds
 * nothing but these functions; a .vdag file of any size is mapped, not read.
 *
 *     voxdag_file* file;
 *     if (voxdag_open("scene.vdag", &file) != VOXDAG_OK) { puts(voxdag_error()); exit(1); }
 *     voxdag_lookup(file, 13, positions, count, set);
 *     voxdag_close(file);
 *
 * Positions are voxels, or cells of the coarser grid of 2^grid_levels per edge, a cell being set
 * where any voxel in it is. Every function that can fail returns a status; the text of the last
 * failure on the calling thread is voxdag_error(). A file is immutable: any number of threads may
 * ask at the same time. docs/query.md says more. */
#ifndef VOXDAG_H
#define VOXDAG_H

#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define VOXDAG_API __attribute__((visibility("default")))
#else
#define VOXDAG_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

typedef enum voxdag_status {
  VOXDAG_OK = 0,
  VOXDAG_INVALID_INPUT,       /* an argument that breaks its rules */
  VOXDAG_NOT_FOUND,           /* no such file */
  VOXDAG_CORRUPT,             /* the file is damaged, or not a .vdag file */
  VOXDAG_UNSUPPORTED_VERSION, /* the file is of a later format version */
  VOXDAG_IO,                  /* the system refused to read it */
  VOXDAG_OUT_OF_MEMORY,
  VOXDAG_LIMIT,
  VOXDAG_INTERNAL /* a defect of this library */
} voxdag_status;

/* An open file. */
typedef struct voxdag_file voxdag_file;

typedef struct voxdag_facts {
  uint32_t grid_levels;  /* the grid has 2^grid_levels voxels per edge */
  uint32_t color_levels; /* the finest grid with colors has 2^color_levels cells; 0 for none */
  double origin[3];      /* the low corner of the grid in the units of the scene */
  double edge;           /* of the grid, in the units of the scene */
  uint64_t voxels;       /* that are set */
  uint64_t svo_nodes;
  uint64_t dag_nodes;
  uint64_t bytes; /* of the file */
} voxdag_facts;

/* The half-open box low <= p < high. It may reach beyond the grid. */
typedef struct voxdag_region {
  int64_t low[3];
  int64_t high[3];
} voxdag_region;

typedef struct voxdag_ray {
  double origin[3];    /* in voxels */
  double direction[3]; /* of any length but 0 */
} voxdag_ray;

typedef struct voxdag_hit {
  double distance;  /* in voxels; infinite if nothing was hit */
  int64_t voxel[3]; /* the low corner of the cell that was hit, in voxels; -1 for nothing */
  int8_t normal[3]; /* of the face; 0 if the ray began in the cell, or hit nothing */
  int8_t reserved[5];
} voxdag_hit;

/* What the last function that failed on this thread has to say. Never null; valid until the next
 * call on this thread. */
VOXDAG_API const char* voxdag_error(void);

VOXDAG_API voxdag_status voxdag_open(const char* path, voxdag_file** file);
/* Nothing happens for a null pointer. No other thread may be using the file. */
VOXDAG_API void voxdag_close(voxdag_file* file);
VOXDAG_API voxdag_status voxdag_get_facts(const voxdag_file* file, voxdag_facts* facts);

/* set[i] = 1 if cell i is set, else 0; cells outside the grid are not. */
VOXDAG_API voxdag_status voxdag_lookup(const voxdag_file* file, uint32_t grid_levels,
                                       const int64_t (*cells)[3], size_t count, uint8_t* set);

/* The color of each cell: red, green and blue in sRGB, and 255; all four are 0 for a cell that is
 * not set. Cells finer than the color grid have the color of the cell that they lie in.
 * VOXDAG_INVALID_INPUT for a file without colors: its facts say so. */
VOXDAG_API voxdag_status voxdag_colors(const voxdag_file* file, uint32_t grid_levels,
                                       const int64_t (*cells)[3], size_t count, uint8_t (*rgba)[4]);

/* What each ray hits first, up to max_distance (INFINITY for no limit). Cells of an edge up to
 * stop_edge voxels are hit as a whole: 1 for voxels. */
VOXDAG_API voxdag_status voxdag_cast_rays(const voxdag_file* file, const voxdag_ray* rays,
                                          size_t count, double max_distance, double stop_edge,
                                          voxdag_hit* hits);

/* The number of set cells in a region. */
VOXDAG_API voxdag_status voxdag_count(const voxdag_file* file, uint32_t grid_levels,
                                      const voxdag_region* region, uint64_t* count);

/* All cells of a region, 1 or 0 each: the cell low + (x, y, z) is cells[(x * ny + y) * nz + z],
 * where ny and nz are the lengths of the region along y and z. */
VOXDAG_API voxdag_status voxdag_dense(const voxdag_file* file, uint32_t grid_levels,
                                      const voxdag_region* region, uint8_t* cells);

/* The set cells of a region, in Morton order. VOXDAG_INVALID_INPUT unless `capacity`, the length of
 * `cells`, is at least what voxdag_count() says. */
VOXDAG_API voxdag_status voxdag_list(const voxdag_file* file, uint32_t grid_levels,
                                     const voxdag_region* region, size_t capacity,
                                     int64_t (*cells)[3]);

/* For each voxel the nearest one that is set, by the distance between the centers, which is
 * written to `distances` unless that is null; of several the first in Morton order. Without one up
 * to max_distance: -1, and an infinite distance. */
VOXDAG_API voxdag_status voxdag_nearest(const voxdag_file* file, const int64_t (*voxels)[3],
                                        size_t count, double max_distance, int64_t (*nearest)[3],
                                        double* distances);

#ifdef __cplusplus
}
#endif
#endif
