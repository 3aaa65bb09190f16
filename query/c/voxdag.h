/* Queries of finished .vdag files, for C and every language that can call C. A .vdag file of any
 * size is mapped into memory instead of being read completely.
 *
 *     voxdag_file* file;
 *     if (voxdag_open("scene.vdag", &file) != VOXDAG_OK) { puts(voxdag_error()); exit(1); }
 *     voxdag_lookup(file, 13, positions, count, set);
 *     voxdag_close(file);
 *
 * A position has three integers, x, y and z. It names a cell of the grid with 2^grid_levels cells
 * per edge. The cell is a voxel if `grid_levels` is the file's number of levels. With a smaller
 * `grid_levels` it is larger. A cell is set if any voxel in it is set. Every function that can fail
 * returns a status;
 * voxdag_error() returns the message of the last failure on the calling thread. A file is
 * immutable: any number of threads may query it concurrently. docs/library.md describes conventions
 * and units.
 *
 * A struct that can get more members in a later version begins with `struct_size`, which the caller
 * sets to the sizeof of the struct. Programs compiled with this header run with every later
 * libvoxdag.so of the same soname. */
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
  VOXDAG_INVALID_INPUT,       /* a wrong argument, or an attribute that the file does not have */
  VOXDAG_NOT_FOUND,           /* no such file */
  VOXDAG_CORRUPT,             /* the file is damaged, or not a .vdag file */
  VOXDAG_UNSUPPORTED_VERSION, /* the file has a later format version */
  VOXDAG_IO,                  /* the system failed to read the file */
  VOXDAG_OUT_OF_MEMORY,       /* the machine has too little memory for the answer */
  VOXDAG_LIMIT,               /* a limit of the format is exceeded; the message names it */
  VOXDAG_INTERNAL             /* a defect of this library */
} voxdag_status;

/* An open file. */
typedef struct voxdag_file voxdag_file;

/* Bits of voxdag_facts.attributes. */
#define VOXDAG_HAS_COLORS 1u
#define VOXDAG_HAS_ALPHAS 2u
#define VOXDAG_HAS_NORMALS 4u
#define VOXDAG_HAS_MATERIALS 8u

/* The material of a cell that is not set. */
#define VOXDAG_NO_MATERIAL UINT32_MAX

typedef struct voxdag_facts {
  size_t struct_size;    /* sizeof(voxdag_facts), set by the caller */
  uint32_t grid_levels;  /* the grid has 2^grid_levels voxels per edge */
  uint32_t color_levels; /* the finest grid with attributes has 2^color_levels cells per edge */
  uint32_t attributes;   /* VOXDAG_HAS_... */
  uint32_t materials;    /* the number of materials */
  double origin[3];      /* the low corner of the grid in the units of the scene */
  double edge;           /* the edge of the grid in the units of the scene */
  uint64_t voxels;       /* the number of set voxels */
  uint64_t svo_nodes;    /* the number of octree nodes without sharing */
  uint64_t dag_nodes;    /* the number of nodes of the DAG, including bricks */
  uint64_t bytes;        /* the size of the file */
} voxdag_facts;

/* The cells p with low <= p < high on every axis. The region may extend beyond the grid. */
typedef struct voxdag_region {
  int64_t low[3];
  int64_t high[3];
} voxdag_region;

typedef struct voxdag_ray {
  double origin[3];    /* in voxels */
  double direction[3]; /* of any length except 0 */
} voxdag_ray;

typedef struct voxdag_ray_limits {
  size_t struct_size;  /* sizeof(voxdag_ray_limits), set by the caller */
  double max_distance; /* in voxels; INFINITY for no limit */
  double stop_size;    /* in voxels; a ray ends at a set cell with at most this edge */
} voxdag_ray_limits;

typedef struct voxdag_hit {
  double distance;  /* in voxels; infinite without a hit */
  int64_t voxel[3]; /* the low corner of the hit cell, in voxels; -1 without a hit */
  int8_t normal[3]; /* of the hit face; zeros without a hit or if the ray began in the cell */
  int8_t reserved[5];
} voxdag_hit;

/* A box, in voxels. */
typedef struct voxdag_box {
  double low[3];
  double high[3];
} voxdag_box;

/* A capsule: all points whose distance from the segment between `from` and `to` is less than
 * `radius`, in voxels. If both ends are equal, the capsule is a sphere. */
typedef struct voxdag_capsule {
  double from[3];
  double to[3];
  double radius;
} voxdag_capsule;

/* A brick: 4x4x4 cells of a grid, with the low corner `low`. The cell low + (x, y, z) is set if
 * bit 32x1 + 16y1 + 8z1 + 4x0 + 2y0 + z0 of `mask` is 1. x1 is the high bit of x (0 to 3) and x0
 * the low bit, likewise for y and z. */
typedef struct voxdag_brick {
  int64_t low[3];
  uint64_t mask;
} voxdag_brick;

/* The version of the library, such as "0.1.0". */
VOXDAG_API const char* voxdag_version(void);

/* Returns the message of the last function that failed on this thread; "" if none has failed. The
 * result is never null. It is valid until the next call on this thread. */
VOXDAG_API const char* voxdag_error(void);

VOXDAG_API voxdag_status voxdag_open(const char* path, voxdag_file** file);
/* Opens a file that is already in memory, such as an entry of an archive: `size` bytes at `data`.
 * They must remain valid and unchanged until voxdag_close(). They are copied if `data` is not
 * aligned to 8 bytes. */
VOXDAG_API voxdag_status voxdag_open_memory(const void* data, size_t size, voxdag_file** file);
/* Closes a file. Ignores a null pointer. No thread may use the file during this call or later. */
VOXDAG_API void voxdag_close(voxdag_file* file);
/* Fills the first facts->struct_size bytes of `facts`. */
VOXDAG_API voxdag_status voxdag_get_facts(const voxdag_file* file, voxdag_facts* facts);
/* Returns the name of a material; null for an unknown number. The last material has the name "" and
 * stands for triangles without a material. The result is valid while the file is open. */
VOXDAG_API const char* voxdag_material_name(const voxdag_file* file, uint32_t material);

/* Sets set[i] to 1 if cells[i] is set, else to 0. Cells outside the grid are not set. `count` is
 * the number of cells, here and below. */
VOXDAG_API voxdag_status voxdag_lookup(const voxdag_file* file, uint32_t grid_levels,
                                       const int64_t (*cells)[3], size_t count, uint8_t* set);

/* The next four functions write one attribute of each cell. The color grid is the finest grid with
 * attributes; a smaller cell has the value of the color grid's cell that contains it. The functions
 * return VOXDAG_INVALID_INPUT if the file does not have the attribute.
 *   colors      red, green and blue in sRGB, and 255; zeros for a cell that is not set
 *   alphas      0 to 255, linear; 0 for a cell that is not set
 *   normals     unit vectors; zeros for a cell that is not set
 *   materials   numbers for voxdag_material_name(), or VOXDAG_NO_MATERIAL */
VOXDAG_API voxdag_status voxdag_colors(const voxdag_file* file, uint32_t grid_levels,
                                       const int64_t (*cells)[3], size_t count, uint8_t (*rgba)[4]);
VOXDAG_API voxdag_status voxdag_alphas(const voxdag_file* file, uint32_t grid_levels,
                                       const int64_t (*cells)[3], size_t count, uint8_t* alphas);
VOXDAG_API voxdag_status voxdag_normals(const voxdag_file* file, uint32_t grid_levels,
                                        const int64_t (*cells)[3], size_t count,
                                        float (*normals)[3]);
VOXDAG_API voxdag_status voxdag_materials(const voxdag_file* file, uint32_t grid_levels,
                                          const int64_t (*cells)[3], size_t count,
                                          uint32_t* materials);

/* Finds the first set cell on each ray. `count` is the number of rays and of hits. If `limits` is
 * null, the rays have no maximum distance and hit single voxels. */
VOXDAG_API voxdag_status voxdag_cast_rays(const voxdag_file* file, const voxdag_ray* rays,
                                          size_t count, const voxdag_ray_limits* limits,
                                          voxdag_hit* hits);

/* Sets occluded[i] to 1 if a set cell is on ray i within the limits, so if voxdag_cast_rays() would
 * find a hit; else to 0. Faster than voxdag_cast_rays(). */
VOXDAG_API voxdag_status voxdag_occluded(const voxdag_file* file, const voxdag_ray* rays,
                                         size_t count, const voxdag_ray_limits* limits,
                                         uint8_t* occluded);

/* Counts the set cells in a region. */
VOXDAG_API voxdag_status voxdag_count(const voxdag_file* file, uint32_t grid_levels,
                                      const voxdag_region* region, uint64_t* count);

/* Writes 1 (set) or 0 for each cell of a region: the cell low + (x, y, z) is written to
 * cells[(x * ny + y) * nz + z], where ny and nz are the lengths of the region along y and z. */
VOXDAG_API voxdag_status voxdag_dense(const voxdag_file* file, uint32_t grid_levels,
                                      const voxdag_region* region, uint8_t* cells);

/* Writes the set cells of a region to `cells`, in Morton order. Returns VOXDAG_INVALID_INPUT unless
 * `capacity`, the length of `cells`, is at least the region's voxdag_count(). */
VOXDAG_API voxdag_status voxdag_list(const voxdag_file* file, uint32_t grid_levels,
                                     const voxdag_region* region, size_t capacity,
                                     int64_t (*cells)[3]);

/* Writes the bricks that have set cells in a region, in Morton order, to the array `bricks` of
 * length `capacity`. Leaves out the bricks that do not fit. A mask has only those set cells of
 * its brick that are in the region. Sets *count to the number of all bricks of the region, which
 * can be larger than `capacity`. To get only this number, use the capacity 0. */
VOXDAG_API voxdag_status voxdag_bricks(const voxdag_file* file, uint32_t grid_levels,
                                       const voxdag_region* region, size_t capacity,
                                       voxdag_brick* bricks, size_t* count);

/* For each of `count` shapes: set overlaps[i] to 1 if shape i overlaps a set cell, else to 0. A
 * shape that only touches a cell does not overlap it. */
VOXDAG_API voxdag_status voxdag_overlap_boxes(const voxdag_file* file, uint32_t grid_levels,
                                              const voxdag_box* boxes, size_t count,
                                              uint8_t* overlaps);
VOXDAG_API voxdag_status voxdag_overlap_capsules(const voxdag_file* file, uint32_t grid_levels,
                                                 const voxdag_capsule* capsules, size_t count,
                                                 uint8_t* overlaps);

/* Finds the nearest set voxel for each of `count` voxels, by the distance between the centers, in
 * voxels. If several set voxels are equally near, the result is the first of them in Morton order.
 * If no set voxel is within max_distance, the result is -1 on each axis and an infinite distance.
 * `distances` may be null. */
VOXDAG_API voxdag_status voxdag_nearest(const voxdag_file* file, const int64_t (*voxels)[3],
                                        size_t count, double max_distance, int64_t (*nearest)[3],
                                        double* distances);

#ifdef __cplusplus
}
#endif
#endif
