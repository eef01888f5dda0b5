/* Acceleration structures ("accels"). An accel is a subtree of the octree (or the whole tree),
 * decoded for queries. An accel has child tables, leaves that list faces, the faces in blocks, and
 * a bounding hierarchy over the blocks. After an accel is made, only the kinds of its leaves
 * change; the first queries find these kinds. Any thread may use an accel.
 *
 * Terms: the "shared" faces of a subtree are listed by its leaves, but also by an earlier leaf of
 * the file outside the subtree; all its other faces are "owned". The "local index" of a face is its
 * position among all faces of the accel, shared faces first. A "slot" is the position of a face in
 * the blocks. The "frame" of a subtree is the coordinates (x - centre) * scale, in which the
 * subtree's cell has a size of 1 to 2. */
#ifndef EBPO_QUERY_ACCEL_H
#define EBPO_QUERY_ACCEL_H

#include <ebpo/file.h>
#include <pthread.h>
#include <stdatomic.h>

#include "format/slice.h"
#include "geometry/cells.h"
#include "geometry/level_nodes.h"

/* --- leaves --- */

/* Kinds of leaves, as in the extended octree (Brunet and Navazo 1990: face and edge nodes) and the
 * SP-octree (Cano and Torres 2002: convex and concave nodes). In the kinds 1 to 4, the signs of the
 * leaf's planes at a point decide if the point is inside. */
typedef enum ebpo_leaf_kind {
    EBPO_LEAF_GENERAL = 0, /* the point's winding number is computed from the leaf's faces */
    EBPO_LEAF_ONE_PLANE = 1,
    EBPO_LEAF_TWO_PLANES = 2,
    EBPO_LEAF_CONVEX = 3,
    EBPO_LEAF_CONCAVE = 4,
    /* The kind is not known yet; the leaf is treated as a general leaf. A free cell face is a cell
     * face of the leaf that no face intersects. */
    /* a free cell face and the boxes of the leaf's list are not known either */
    EBPO_LEAF_UNKNOWN = 5,
    EBPO_LEAF_CLAIMED = 6, /* a thread is finding the free cell face and the boxes */
    EBPO_LEAF_BOUNDED = 7, /* the free cell face and the boxes are known */
    EBPO_LEAF_SORTED = 8   /* as EBPO_LEAF_BOUNDED, and a thread is finding the kind */
} ebpo_leaf_kind;
/* Finding a free cell face takes as long as one query, and finding the kind as long as dozens of
 * queries. So a leaf's first query finds the cell face, and the leaf's 128th query finds the kind.
 */
enum { EBPO_LEAF_CELL_FACE_QUERIES = 1, EBPO_LEAF_KIND_QUERIES = 128 };
/* Values of `cell_face` for a leaf without a free cell face. EBPO_NEAR_BORDER: the leaf of a
 * surface is near the border (the edges of holes). Then the rule for the integer winding number
 * does not decide in the whole leaf, and `rows` holds the leaf's mark (ebpo_marked_entry in
 * holes.h) in place of a row number. */
enum { EBPO_NO_CELL_FACE = 6, EBPO_NEAR_BORDER = 7 };
/* A leaf with more planes is of the general kind. */
enum { EBPO_KIND_PLANES_MAX = 16 };

/* An entry of a leaf's list: a block. Bits 0 to 28 are the block's number. Bit 29 is set in the
 * last entry of the leaf. Bits 32 to 39 are the block's lanes whose faces the leaf lists (the block
 * may have faces that the leaf does not list). Bits 40 to 63 are a box around the listed faces
 * within the cell, in sixteenths of the cell (EBPO_LISTED_CELLS), rounded outward. For each axis,
 * four bits are the lower side and four bits are 15 minus the upper side. Bits 40 to 63 are 0 (the
 * whole cell) until ebpo_leaf_is_bounded is true for the leaf's kind. */
typedef _Atomic uint64_t ebpo_listed_block;
enum { EBPO_LISTED_CELLS = 16, EBPO_LISTED_BOX = 40, EBPO_LISTED_LANES = 32 };
#define EBPO_LISTED_LAST (UINT64_C(1) << 29)

/* ebpo_listed and ebpo_list load and store an entry. ebpo_listed_number and ebpo_listed_lanes
 * return the block's number and the lanes of an entry. */
static inline uint64_t ebpo_listed(const ebpo_listed_block *b)
{
    return atomic_load_explicit(b, memory_order_relaxed);
}
static inline void ebpo_list(ebpo_listed_block *b, uint64_t listed)
{
    atomic_store_explicit(b, listed, memory_order_relaxed);
}
static inline uint32_t ebpo_listed_number(uint64_t b) { return b & (EBPO_LISTED_LAST - 1); }
static inline unsigned ebpo_listed_lanes(uint64_t b) { return b >> EBPO_LISTED_LANES & 255; }

/* A leaf. ebpo_leaf_query sets `rows`, `cell_face` and `cell_face_step` and then `kind`.
 * `cell_face` and `cell_face_step` are valid if ebpo_leaf_is_bounded is true for the kind. `rows`
 * is valid if ebpo_leaf_has_planes is true for the kind (or see EBPO_NEAR_BORDER). Valid values do
 * not change. */
typedef struct ebpo_accel_leaf {
    uint32_t list; /* index in ebpo_accel.list of the leaf's first entry */
    /* winding number at the lowest corner, shifted by an infinitely small vector (format-spec,
     * section 10) */
    int32_t winding;
    /* if ebpo_leaf_has_planes is true for the kind: number of the first row of the leaf's planes
     * (EBPO_KIND_ROW); see also EBPO_NEAR_BORDER */
    uint32_t rows;
    _Atomic uint8_t kind;    /* ebpo_leaf_kind; if !has_windings (ebpo_accel), always
                              * EBPO_LEAF_GENERAL */
    _Atomic uint8_t queries; /* approximate number of queries until the kind is known */
    /* 2 axis + side (1: upper) of a cell face that no face intersects, or EBPO_NO_CELL_FACE or
     * EBPO_NEAR_BORDER */
    uint8_t cell_face;
    /* winding number on `cell_face` minus the winding number at the lowest corner */
    int8_t cell_face_step;
} ebpo_accel_leaf;

/* Returns true if `cell_face`, `cell_face_step` and the boxes of the leaf's list may be read. */
static inline bool ebpo_leaf_is_bounded(ebpo_leaf_kind kind)
{
    return kind != EBPO_LEAF_UNKNOWN && kind != EBPO_LEAF_CLAIMED;
}

/* A row of a leaf's planes. The leaf's first row is its head. Then each group of four planes has
 * four rows: the components n0 of the four normals, n1, n2, and the offsets d. At a point xi in the
 * cell's coordinates (0 .. 1 on each axis), a plane's value is n . xi - d, where
 * |n0| + |n1| + |n2| = 1. The sign of a value is certain if its absolute value exceeds
 * EBPO_PLANE_ERROR. */
typedef union ebpo_kind_row {
    float of_four[4];
    struct {
        /* inner: winding number where the values of all planes are negative; outer: winding number
         * elsewhere in the cell */
        int32_t inner, outer;
        /* number of groups of four planes; the last group is filled up with plane 0 */
        uint32_t fours;
    } head;
} ebpo_kind_row;
#define EBPO_PLANE_ERROR 0x1p-19f

/* The planes of a subtree's leaves that were found so far. Rows are stored in pages. A row's number
 * consists of the page's number and the row's number within the page. */
enum { EBPO_KIND_PAGES = 23, EBPO_KIND_PAGE_BITS = 27 };
#define EBPO_NO_ROWS UINT32_MAX
typedef struct ebpo_leaf_kinds {
    pthread_mutex_t lock; /* protects the following fields; to read the rows of a leaf whose kind
                           * is known, no lock is needed */
    ebpo_kind_row *page[EBPO_KIND_PAGES];
    uint32_t pages;
    uint64_t used, space;  /* used rows and capacity of the last page */
    _Atomic uint64_t rows; /* capacity of all pages, in rows */
    uint64_t rows_max;     /* maximum of `rows`; leaves beyond this limit stay general */
    /* for each kind, the number of leaves that are known to have this kind */
    _Atomic uint64_t of_kind[5];
    _Atomic uint64_t one_cell_face; /* number of leaves of the general kind with a free cell face */
} ebpo_leaf_kinds;
#define EBPO_KIND_ROW(kinds, number)                  \
    ((kinds)->page[(number) >> EBPO_KIND_PAGE_BITS] + \
     ((number) & ((1u << EBPO_KIND_PAGE_BITS) - 1)))

/* Returns the kind of a leaf. Everything that the thread that set the kind wrote before is visible
 * to the caller. */
static inline ebpo_leaf_kind ebpo_leaf_kind_of(const ebpo_accel_leaf *leaf)
{
    return (ebpo_leaf_kind)atomic_load_explicit(&leaf->kind, memory_order_acquire);
}

static inline bool ebpo_leaf_has_planes(ebpo_leaf_kind kind)
{
    return kind >= EBPO_LEAF_ONE_PLANE && kind <= EBPO_LEAF_CONCAVE;
}

/* --- faces --- */

/* A block of at most eight faces, one in each lane. The block is a record of variable size, which
 * begins with this head. After the head follow x of all vertices, then y, then z, in the model's
 * unit: floats, or doubles (from byte EBPO_MESHLET_WIDE on). Corner i of lane l is vertex
 * (corner[i] >> 4 * l) % 16. A block with more than 16 different vertices stores 24, and corner i
 * of lane l is vertex 8 * i + l. Lanes without a face repeat the first face. Kernels read blocks
 * with face_block.h. See docs/develop/blocks.md. */
typedef struct ebpo_meshlet {
    uint32_t face; /* local index of the first face; the other faces have the next indices */
    uint32_t corner[3];
    uint8_t faces, vertices; /* number of faces; number of vertices */
    uint8_t spare[2];
} ebpo_meshlet;
/* EBPO_BLOCK: lanes of a block. Slot: block number * EBPO_BLOCK + lane. */
enum { EBPO_BLOCK = 8, EBPO_NO_SLOT = 0x7fffffff };
enum { EBPO_MESHLET_SHARED = 16, EBPO_MESHLET_VERTICES = 24, EBPO_MESHLET_WIDE = 24 };
/* Records begin at multiples of this number of bytes, which is called a unit. The block's number is
 * the position of its record in units. */
enum { EBPO_MESHLET_UNIT = 64 };
/* Maximum number of units: slots (block * EBPO_BLOCK + lane) have 32 bits. */
enum { EBPO_BLOCKS_MAX = 1 << 29 };

/* --- bounding hierarchy over the blocks --- */

/* A node of the hierarchy: at most eight children and their boxes. The sides of boxes have 8 bits:
 * on axis k, a box reaches from origin + step * low to origin + step * high, in the subtree's frame
 * (ebpo_accel: centre, scale). Coordinates in the frame are about -1 .. 1, and greater if listed
 * faces extend beyond the cell. The boxes are enlarged by the rounding errors of single precision
 * (docs/develop/bounds.md). */
typedef struct ebpo_bound {
    _Alignas(64) float origin[3];
    float step[3];
    uint8_t low[3][8], high[3][8];
    uint32_t child[8]; /* index of a node, or number of a block + EBPO_IS_BLOCK */
    /* A search tests bounding cylinders only if its squared distance limit exceeds this value. If
     * the limit is smaller, the node is large compared with the search, and cylinders exclude
     * hardly any child. */
    float cylinder_limit2;
    uint32_t parent; /* index of the parent; 0 for the root of the hierarchy */
    uint8_t count;   /* number of children, which are in the first lanes */
    uint8_t spare[15];
} ebpo_bound;
#define EBPO_IS_BLOCK UINT32_C(0x80000000)
#define EBPO_NO_CHILD UINT32_MAX

/* The sides of a child's box on one axis, decoded. The rounding error of a side is at most 2^-52
 * times the greater of |origin| and |side|. */
typedef struct ebpo_bound_sides {
    double low, high;
} ebpo_bound_sides;
static inline ebpo_bound_sides ebpo_bound_side(const ebpo_bound *b, int lane, int axis)
{
    double origin = (double)b->origin[axis], step = (double)b->step[axis];
    return (ebpo_bound_sides){ origin + step * b->low[axis][lane],
                               origin + step * b->high[axis][lane] };
}

/* Bounding cylinders of a node's children, which are used in addition to boxes, because cylinders
 * of neighbouring layers of a curved surface overlap less than boxes. Let x be a point of the
 * child, relative to the middle of the child's decoded box, and a = axis / 2^15. Then
 *     along_step * from <= x . a <= along_step * to, and
 *     x . x - (x . a)^2 <= (aside_step * radius)^2.
 * Values have 16 bits. With 8 bits, the error of the axis would be as large as the thickness of
 * cylinders, and a fifth more blocks would be visited. */
typedef struct ebpo_bound_cylinder {
    _Alignas(64) int16_t axis[3][8];
    int16_t from[8], to[8], radius[8];
    float along_step, aside_step;
    uint8_t large; /* a bit for each child with more than EBPO_LARGE_CHILD blocks */
    uint8_t spare[23];
} ebpo_bound_cylinder;
/* The cylinders of larger children exclude pairs of nodes, but they do not change the order in
 * which pairs are visited (collide/pair_walk_kernels.c). */
enum { EBPO_LARGE_CHILD = 1024 };

/* A child's bounding cylinder, decoded. */
typedef struct ebpo_child_cylinder {
    double axis[3], from, to, radius;
} ebpo_child_cylinder;
static inline ebpo_child_cylinder ebpo_bound_cylinder_of(const ebpo_bound_cylinder *b, int lane)
{
    double along = (double)b->along_step, aside = (double)b->aside_step;
    return (ebpo_child_cylinder){ { b->axis[0][lane] * 0x1p-15, b->axis[1][lane] * 0x1p-15,
                                    b->axis[2][lane] * 0x1p-15 },
                                  along * b->from[lane],
                                  along * b->to[lane],
                                  aside * b->radius[lane] };
}

/* How much of a subtree an accel has. Each value includes the values before it. */
typedef enum ebpo_accel_content {
    EBPO_ACCEL_FACES = 0, /* the faces in blocks, and the hierarchy over blocks */
    EBPO_ACCEL_NODES = 1, /* the child tables, and the leaves with their lists */
    EBPO_ACCEL_PLANES = 2 /* the plane codes of gray nodes */
} ebpo_accel_content;

typedef struct ebpo_accel {
    ebpo_node root;        /* root of the subtree */
    ebpo_box box;          /* box of the whole model */
    int deepest;           /* level of the tree's deepest nodes */
    uint8_t content;       /* ebpo_accel_content */
    bool has_windings;     /* a solid, or a surface with its border */
    uint8_t rule;          /* ebpo_rule */
    ebpo_node_table nodes; /* child tables */
    ebpo_accel_leaf *leaf; /* [leaf_count] */
    uint32_t leaf_count;
    ebpo_listed_block *list; /* [list_count] the lists of all leaves */
    uint64_t list_count;
    uint32_t list_longest;  /* number of blocks in the longest list */
    ebpo_leaf_kinds *kinds; /* NULL if !has_windings, or without nodes */
    bool wide;              /* true: blocks hold doubles; false: floats */
    char *meshlets;         /* [units][EBPO_MESHLET_UNIT]: records of all blocks (ebpo_meshlet) */
    uint64_t units;
    uint32_t face_count;
    double centre[3], scale;   /* of the frame */
    float turn_error_constant; /* part of an error bound for blocks of floats; see
                                * query/inside_kernels.c */
    double largest_coordinate; /* upper bound for decoded boxes, in the frame; at least 1 */
    /* A ray whose origin has no coordinate above ray_near, in the frame, is searched without moving
     * the origin, with ray_error and ray_blur (ebpo_ray_search.error and blur). -1: no ray */
    double ray_near, ray_error;
    float ray_blur;
    ebpo_bound *bound;             /* [bound_count] the hierarchy over blocks */
    ebpo_bound_cylinder *cylinder; /* [bound_count] */
    uint32_t bound_count;
    uint32_t root_bound; /* index of the hierarchy's root in `bound` */
    uint32_t shared_count;
    uint32_t *shared;    /* [shared_count] file indices of the shared faces */
    uint64_t first_face; /* file index of the first owned face; the other owned faces have the
                          * next indices */
    /* [face_count] in a whole model, index of each face in the source, the mesh that was converted;
     * NULL: a subtree, or the file has no source indices */
    uint32_t *face_source;
    /* Plane codes of gray nodes (EBPO_ACCEL_PLANES); otherwise NULL. The gray node whose children
     * are group g has the codes gray_planes[gray_first[g] .. gray_first[g + 1] - 1]. */
    uint32_t *gray_planes;
    uint32_t *gray_first; /* [gray_count + 1] */
    uint64_t gray_count;
    void *arrays; /* the allocation of all arrays above, except child tables and kinds; NULL: each
                   * array is a separate allocation */
    /* total bytes of memory. The planes of leaves (ebpo_leaf_kinds) are not counted in a whole
     * model; in a subtree, the most bytes that they can take are counted. */
    uint64_t bytes;
} ebpo_accel;

/* A function (of ebpo_inside_kernels) that sets the boxes of a leaf's list. The function returns a
 * bit for each cell face that the leaf's faces intersect or may intersect: bit 2 * axis + side (1:
 * upper). */
typedef unsigned ebpo_cell_faces_fn(const ebpo_accel *subtree, ebpo_listed_block *list,
                                    ebpo_cell cell);

/* Counts a query in a leaf whose kind is not known, in an accel with windings. Query number
 * EBPO_LEAF_CELL_FACE_QUERIES finds the free cell face and the boxes of the leaf's list. Query
 * number EBPO_LEAF_KIND_QUERIES finds the kind. Returns true if this query has found the kind. If
 * there is no memory for the planes, the leaf becomes a general leaf. */
bool ebpo_leaf_query(const ebpo_accel *subtree, ebpo_accel_leaf *leaf, ebpo_cell cell,
                     ebpo_cell_faces_fn *cell_faces);

/* Makes an accel from a slice (a subtree with its faces as read from the file), and frees the
 * slice, also after a failure. `threads` 0: all cores. */
EBPO_MUST_USE ebpo_status ebpo_accel_make(ebpo_accel **out, ebpo_slice *slice,
                                          const ebpo_info *info, ebpo_accel_content content,
                                          unsigned threads, ebpo_error *error);
/* Does the same as ebpo_accel_make, but returns EBPO_E_LIMIT if the memory, including the slice,
 * would exceed the quota (NULL: no limit). For ordinary subtrees and models, the counts show this
 * before memory is taken. */
EBPO_MUST_USE ebpo_status ebpo_accel_make_within(ebpo_accel **out, ebpo_slice *slice,
                                                 const ebpo_info *info, ebpo_quota *space,
                                                 ebpo_accel_content content, unsigned threads,
                                                 ebpo_error *error);
void ebpo_accel_free(ebpo_accel *subtree);

/* Returns the bytes of memory that the accel of a whole model uses now. */
static inline uint64_t ebpo_accel_bytes(const ebpo_accel *whole)
{
    return whole->bytes + (whole->kinds ? whole->kinds->rows * sizeof(ebpo_kind_row) : 0);
}

/* Computes from counts upper bounds of the bytes that a subtree will keep (*keep), and of the most
 * bytes that exist while the subtree is made, including its slice (*peak). */
void ebpo_accel_estimate(const ebpo_slice_size *size, const ebpo_info *info, uint64_t *keep,
                         uint64_t *peak);
/* ebpo_accel_estimate_whole (for a whole model) and ebpo_accel_estimate_subtree (for a subtree,
 * with planes of gray nodes if slice_size->planes is not 0) compute closer bounds than
 * ebpo_accel_estimate. These closer bounds are valid for ordinary models only (accel_make.c).
 * ebpo_slice_read_within and ebpo_accel_make_within refuse models that exceed these bounds. */
void ebpo_accel_estimate_whole(const ebpo_info *info, uint64_t *keep, uint64_t *peak);
void ebpo_accel_estimate_subtree(const ebpo_slice_size *slice_size, const ebpo_info *info,
                                 uint64_t *keep, uint64_t *peak);
/* Returns the average bytes that an ordinary subtree keeps, computed from the number of subtrees
 * and the counts `all` of all subtrees together. The result is only slightly too high, and lower
 * than the bounds of ebpo_accel_estimate_subtree. */
uint64_t ebpo_accel_mean_bytes(const ebpo_slice_size *all, const ebpo_info *info,
                               uint64_t subtrees);

/* --- nodes of an accel (query_node.c), identified by ebpo_node.entry --- */

ebpo_node ebpo_accel_root(const ebpo_accel *subtree);
/* Returns a child of a gray node. The gray node must not be pruned. */
ebpo_node ebpo_accel_child(const ebpo_accel *subtree, const ebpo_node *gray, unsigned octant);
/* The interface by which cursors (geometry/cursor.h) read nodes of an ebpo_accel. */
extern const ebpo_node_source ebpo_accel_source;

/* Returns the record of a block. */
static inline const ebpo_meshlet *ebpo_accel_meshlet(const ebpo_accel *s, uint32_t block)
{
    return (const void *)(s->meshlets + (uint64_t)block * EBPO_MESHLET_UNIT);
}

/* Returns the coordinates of the block's vertices, [3][vertices]. */
static inline const float *ebpo_meshlet_floats(const ebpo_meshlet *m)
{
    return (const void *)(m + 1);
}
static inline const double *ebpo_meshlet_doubles(const ebpo_meshlet *m)
{
    return (const void *)((const char *)m + EBPO_MESHLET_WIDE);
}

/* Returns the index, in the block, of the vertex at a corner of a face. */
static inline unsigned ebpo_meshlet_vertex(const ebpo_meshlet *m, unsigned lane, unsigned corner)
{
    return m->vertices > EBPO_MESHLET_SHARED ? EBPO_BLOCK * corner + lane
                                             : m->corner[corner] >> 4 * lane & 15;
}

/* Returns the local index of a slot's face, or EBPO_NO_SLOT if the slot is empty. */
static inline uint32_t ebpo_accel_slot_face(const ebpo_accel *s, uint32_t slot)
{
    const ebpo_meshlet *m = ebpo_accel_meshlet(s, slot / EBPO_BLOCK);
    return slot % EBPO_BLOCK < m->faces ? m->face + slot % EBPO_BLOCK : EBPO_NO_SLOT;
}

/* Reads a face's corners. */
static inline void ebpo_accel_triangle(const ebpo_accel *s, uint32_t slot, double out[3][3])
{
    const ebpo_meshlet *m = ebpo_accel_meshlet(s, slot / EBPO_BLOCK);
    for (unsigned i = 0; i < 3; i++) {
        unsigned at = ebpo_meshlet_vertex(m, slot % EBPO_BLOCK, i);
        for (unsigned k = 0; k < 3; k++, at += m->vertices)
            out[i][k] = s->wide ? ebpo_meshlet_doubles(m)[at] : (double)ebpo_meshlet_floats(m)[at];
    }
}

/* Returns the face's index in the file. */
static inline uint64_t ebpo_accel_file_face(const ebpo_accel *s, uint32_t local)
{
    return local < s->shared_count ? s->shared[local] : s->first_face + (local - s->shared_count);
}

/* Prefetches into the processor's cache the value that ebpo_model_source_face will read. */
static inline void ebpo_accel_fetch_face(const ebpo_accel *s, uint32_t local)
{
    if (s->face_source)
        __builtin_prefetch(&s->face_source[local]);
}

#endif
