/* Internals shared by the parts of the mesh module. Other modules take ebpo_mesh_position from
 * here. */
#ifndef EBPO_MESH_MESH_PARTS_H
#define EBPO_MESH_MESH_PARTS_H

#include <math.h>

#include <ebpo/mesh.h>

#include "geometry/cells.h"
#include "geometry/polygon.h"

#define EBPO_NO_INDEX UINT32_MAX

/* Of a mesh whose vertices and faces are in the order of a Morton curve (ebpo_mesh_arrange), or of
 * which faces were dropped. */
struct ebpo_arrangement {
    /* around the referenced vertices, with exact walls down to box.grid_level */
    ebpo_box box;
    /* vertices that faces name come first, along the curve; the others after them, likewise */
    uint64_t referenced;
    /* [vertex_count] octcode of the vertex's cell at box.grid_level, ascending among the referenced
     * and among the others. NULL: arranged for mending, or mended since; neighbours in space are
     * still neighbours in memory, but what builds has to arrange again */
    uint64_t *key;
    int level;                 /* that was asked for: -1: as deep as is sensible */
    bool grouped;              /* vertices at one position are one run */
    uint32_t *vertex_source;   /* [vertex_count] numbers in the source */
    uint32_t *face_source;     /* [face_count] */
    ebpo_workspace *workspace; /* the mesh's, of all arrays */
    /* of a component: what the mesh has of which it is one, mended; else 0 */
    uint64_t whole_vertices, whole_faces;
    uint64_t dropped_faces; /* of the source, since: their numbers are nobody's */
};

/* Its geometry and order, without attributes, in its workspace; freed by ebpo_mesh_free. On failure
 * cleared. */
EBPO_MUST_USE ebpo_status ebpo_mesh_copy(const ebpo_mesh *mesh, ebpo_mesh *out, ebpo_error *error);

/* NULL: nothing. */
void ebpo_arrangement_free(struct ebpo_arrangement *arrangement);

/* Numbers for messages and reports. */
static inline uint64_t ebpo_mesh_source_vertex(const ebpo_mesh *mesh, uint64_t v)
{
    return mesh->arrangement ? mesh->arrangement->vertex_source[v] : v;
}
static inline uint64_t ebpo_mesh_source_face(const ebpo_mesh *mesh, uint64_t f)
{
    return mesh->arrangement ? mesh->arrangement->face_source[f] : f;
}

/* How many there are of them; of a component, in the whole mesh. */
static inline uint64_t ebpo_mesh_whole_vertices(const ebpo_mesh *mesh)
{
    return mesh->arrangement && mesh->arrangement->whole_vertices
               ? mesh->arrangement->whole_vertices
               : mesh->vertex_count;
}
static inline uint64_t ebpo_mesh_whole_faces(const ebpo_mesh *mesh)
{
    return mesh->arrangement && mesh->arrangement->whole_faces ? mesh->arrangement->whole_faces
                                                               : mesh->face_count;
}
/* EBPO_E_ARGUMENT for a component: mending gives numbers anew, but its own are another mesh's. */
EBPO_MUST_USE ebpo_status ebpo_mesh_check_whole(const ebpo_mesh *mesh, ebpo_error *error);

/* Position of vertex i (< vertex_count) as doubles; exact for both kinds of coordinates. */
static inline void ebpo_mesh_position(const ebpo_mesh *mesh, uint64_t i, double out[3])
{
    if (mesh->xyz32) {
        const float *p = mesh->xyz32 + 3 * i;
        out[0] = p[0], out[1] = p[1], out[2] = p[2];
    } else {
        const double *p = mesh->xyz64 + 3 * i;
        out[0] = p[0], out[1] = p[1], out[2] = p[2];
    }
}

/* True when the face names a vertex twice. */
static inline bool ebpo_face_repeats_index(const uint32_t face[3])
{
    return face[0] == face[1] || face[1] == face[2] || face[2] == face[0];
}

/* Returns whether a sum of `count` rounded terms of a volume, the largest of which is `most`, may
 * be rounding alone: sheets with two sides have no volume and no outside. */
static inline bool ebpo_volume_is_noise(double sum, uint64_t count, double most)
{
    return (sum < 0 ? -sum : sum) <= 1e-12 * (double)count * most;
}

/* Makes the face look the other way. */
static inline void ebpo_face_turn(uint32_t face[3])
{
    uint32_t v = face[1];
    face[1] = face[2];
    face[2] = v;
}

/* Steps of mending. EARLIER: orienting as earlier builds did it, which left consistent components
 * as they were. */
enum {
    EBPO_MEND_WELD = 1,
    EBPO_MEND_ORIENT = 2,
    EBPO_MEND_FILL = 4,
    EBPO_MEND_FLIP = 8,
    EBPO_MEND_EARLIER = 16,
    EBPO_MEND_DROP = 32
};

/* Merges (within a distance, if it is above 0), drops, orients, flips, fills holes, and turns what
 * these closed: as asked for. */
EBPO_MUST_USE ebpo_status ebpo_mesh_mend(ebpo_mesh *mesh, unsigned steps, double weld_distance,
                                         ebpo_mend_record *record, ebpo_error *error);

/* The first part of ebpo_mesh_orient: neighbouring faces agree. `closed`: NULL, or as for
 * ebpo_mesh_find_shells. */
EBPO_MUST_USE ebpo_status ebpo_mesh_make_consistent(ebpo_mesh *mesh, ebpo_mend_record *record,
                                                    uint32_t **closed, ebpo_error *error);

/* The second part: shells look outwards, or inwards where they are within an odd number of others.
 * `closed`: of ebpo_mesh_find_shells; it is changed. */
EBPO_MUST_USE ebpo_status ebpo_mesh_turn_shells(ebpo_mesh *mesh, uint32_t *closed,
                                                ebpo_mend_record *record, ebpo_error *error);

/* Finds the shell of each face, closed [face_count]: a number that its faces alone have, or
 * EBPO_NO_INDEX for a face that is in none. A shell is closed by itself: faces connected by edges
 * with two faces, or around edges with more. The mesh's workspace owns it. */
EBPO_MUST_USE ebpo_status ebpo_mesh_find_shells(const ebpo_mesh *mesh, unsigned threads,
                                                uint32_t **closed, ebpo_error *error);

/* Decides which vertices stay and which they become, by the rule of ebpo_mesh_weld_within, in a
 * mesh without vertices at one position. map [vertex_count]: the new number of each; from
 * [vertex_count]: the *kept vertices that stay, ascending; *moved: the largest distance. */
EBPO_MUST_USE ebpo_status ebpo_weld_group_within(const ebpo_mesh *mesh, double distance,
                                                 uint32_t *map, uint32_t *from, uint64_t *kept,
                                                 double *moved, ebpo_error *error);

/* What messages call the mesh: its source's name, or "mesh". */
const char *ebpo_mesh_label(const ebpo_mesh *mesh);

/* EBPO_E_ARGUMENT unless the arrays that the counts promise are there, EBPO_E_LIMIT when a count is
 * beyond 2^32 - 2. */
EBPO_MUST_USE ebpo_status ebpo_mesh_check_shape(const ebpo_mesh *mesh, ebpo_error *error);

/* Coordinates in units of powers of two, one for each axis, in which volumes of meshes far from 1
 * neither overflow nor vanish: their signs and order are the same. */

/* Squares and cubes of what lies between 2^-256 and 2^256 are far from overflow and underflow. */
enum { EBPO_EXPONENT_MAX = 256 };

static inline bool ebpo_exponent_is_far(int exponent)
{
    return exponent > EBPO_EXPONENT_MAX || exponent < -EBPO_EXPONENT_MAX;
}

typedef struct ebpo_mesh_frame {
    bool scaled; /* else coordinates are as they are */
    int exponent[3];
} ebpo_mesh_frame;

/* By the corners of all faces. */
ebpo_mesh_frame ebpo_mesh_frame_of(const ebpo_mesh *mesh);

static inline void ebpo_frame_position(const ebpo_mesh_frame *frame, const ebpo_mesh *mesh,
                                       uint64_t vertex, double out[3])
{
    ebpo_mesh_position(mesh, vertex, out);
    if (frame->scaled)
        for (int k = 0; k < 3; k++)
            out[k] = ldexp(out[k], -frame->exponent[k]);
}

/* Vertices with one and the same position. */

/* A hash table of all positions; each keeps the lowest vertex number that has it. 5.3 to 10.7 bytes
 * a vertex. */
typedef struct ebpo_positions {
    const ebpo_mesh *mesh; /* borrowed */
    uint32_t *slots;
    uint64_t mask;
    ebpo_workspace *workspace; /* the mesh's */
    uint64_t repeated;         /* vertices whose position an earlier vertex has */
} ebpo_positions;

/* -0 equals 0; NaNs are compared by their bits. `out` is cleared on failure. The result is the same
 * for any thread count. */
EBPO_MUST_USE ebpo_status ebpo_positions_build(ebpo_positions *out, const ebpo_mesh *mesh,
                                               unsigned threads, const ebpo_progress *progress,
                                               ebpo_error *error);
void ebpo_positions_free(ebpo_positions *positions);

/* The lowest vertex number with the position of v. */
uint32_t ebpo_positions_first(const ebpo_positions *positions, uint32_t v);

#endif
