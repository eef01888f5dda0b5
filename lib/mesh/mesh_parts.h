/* Declares what the parts of lib/mesh share: the order of a mesh, repair steps, frames and tables
 * of positions. Other folders use ebpo_mesh_position. */
#ifndef EBPO_MESH_MESH_PARTS_H
#define EBPO_MESH_MESH_PARTS_H

#include <math.h>

#include <ebpo/mesh.h>

#include "geometry/cells.h"
#include "geometry/polygon.h"

#define EBPO_NO_INDEX UINT32_MAX

/* The order of a mesh whose vertices and faces are sorted along a Morton curve (ebpo_mesh_arrange),
 * or of which some faces were dropped. */
struct ebpo_arrangement {
    /* the box around the referenced vertices (vertices that faces use); the coordinates of cell
     * faces are exact down to the level box.grid_level */
    ebpo_box box;
    /* number of referenced vertices, which come first, along the curve; unreferenced vertices
     * follow, also along the curve */
    uint64_t referenced;
    /* [vertex_count] octcode (locational code) of the vertex's cell at box.grid_level, ascending
     * among the referenced and among the unreferenced vertices. NULL if the mesh was arranged for
     * repair, or was repaired later. Then neighbours in space are still close in memory, but the
     * builder must arrange the mesh again */
    uint64_t *key;
    int level;                 /* requested level; -1: as deep as useful */
    bool grouped;              /* vertices at one position are adjacent */
    uint32_t *vertex_source;   /* [vertex_count] source indices */
    uint32_t *face_source;     /* [face_count] */
    ebpo_workspace *workspace; /* workspace of the mesh; owns all arrays */
    /* for a component: numbers of vertices and faces of the mesh that contains the component;
     * otherwise 0 */
    uint64_t whole_vertices, whole_faces;
    /* number of source faces that were dropped later; no face has their source indices */
    uint64_t dropped_faces;
};

/* Copies geometry and order, without attributes, into the same workspace; free with ebpo_mesh_free.
 * `out` is cleared on failure. */
EBPO_MUST_USE ebpo_status ebpo_mesh_copy(const ebpo_mesh *mesh, ebpo_mesh *out, ebpo_error *error);

/* Frees an arrangement. NULL is allowed. */
void ebpo_arrangement_free(struct ebpo_arrangement *arrangement);

/* Returns the source index (position in the source mesh), for messages and reports. */
static inline uint64_t ebpo_mesh_source_vertex(const ebpo_mesh *mesh, uint64_t v)
{
    return mesh->arrangement ? mesh->arrangement->vertex_source[v] : v;
}
static inline uint64_t ebpo_mesh_source_face(const ebpo_mesh *mesh, uint64_t f)
{
    return mesh->arrangement ? mesh->arrangement->face_source[f] : f;
}

/* Returns the number of vertices of the mesh; for a component, of the mesh that contains the
 * component. All source indices of vertices are below this number. ebpo_mesh_whole_faces: the same
 * for faces. */
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
/* Returns EBPO_E_ARGUMENT for a component: repair renumbers the source indices, which a component
 * shares with its whole mesh. */
EBPO_MUST_USE ebpo_status ebpo_mesh_check_whole(const ebpo_mesh *mesh, ebpo_error *error);

/* Returns the position of vertex i (< vertex_count) as doubles; exact for both coordinate types. */
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

/* Returns true if the face repeats a vertex. */
static inline bool ebpo_face_repeats_index(const uint32_t face[3])
{
    return face[0] == face[1] || face[1] == face[2] || face[2] == face[0];
}

/* Returns true if a sum of `count` rounded volume terms, the largest of which is `greatest`, may be
 * rounding noise. For example, a closed surface whose two sides coincide has the volume 0, but the
 * rounded sum may differ from 0. */
static inline bool ebpo_volume_is_noise(double sum, uint64_t count, double greatest)
{
    return (sum < 0 ? -sum : sum) <= 1e-12 * (double)count * greatest;
}

/* Reverses the orientation of the face. */
static inline void ebpo_face_turn(uint32_t face[3])
{
    uint32_t v = face[1];
    face[1] = face[2];
    face[2] = v;
}

/* Repair steps. EARLIER has an effect with ORIENT only: the faces are oriented as by earlier
 * versions of this library, which did not turn components whose faces are already consistent. */
enum {
    EBPO_REPAIR_WELD = 1,
    EBPO_REPAIR_ORIENT = 2,
    EBPO_REPAIR_FILL = 4,
    EBPO_REPAIR_FLIP = 8,
    EBPO_REPAIR_EARLIER = 16,
    EBPO_REPAIR_DROP = 32
};

/* Performs the requested steps: merges vertices, drops faces, orients, flips, fills holes, and
 * orients the components that filling holes has closed. Vertices are merged if they are within
 * weld_distance of each other (0: at equal positions). */
EBPO_MUST_USE ebpo_status ebpo_mesh_repair(ebpo_mesh *mesh, unsigned steps, double weld_distance,
                                           ebpo_repair_record *record, ebpo_error *error);

/* Makes neighbouring faces consistent: the first part of ebpo_mesh_orient. If `closed` is not NULL,
 * *closed becomes the array that ebpo_mesh_find_shells computes. */
EBPO_MUST_USE ebpo_status ebpo_mesh_make_consistent(ebpo_mesh *mesh, ebpo_repair_record *record,
                                                    uint32_t **closed, ebpo_error *error);

/* Turns shells outwards, or inwards if they are within an odd number of other shells: the second
 * part of ebpo_mesh_orient. `closed`: the result of ebpo_mesh_find_shells, which this function
 * changes. */
EBPO_MUST_USE ebpo_status ebpo_mesh_turn_shells(ebpo_mesh *mesh, uint32_t *closed,
                                                ebpo_repair_record *record, ebpo_error *error);

/* Finds the shell of each face. *closed becomes an array [face_count]: for each face, a number
 * unique to the face's shell, or EBPO_NO_INDEX. A shell is a set of faces that forms a closed
 * surface. Its faces are connected across edges with two faces, or around edges with more faces.
 * The mesh's workspace owns the array. */
EBPO_MUST_USE ebpo_status ebpo_mesh_find_shells(const ebpo_mesh *mesh, unsigned threads,
                                                uint32_t **closed, ebpo_error *error);

/* Decides which vertices are merged, by the rule of ebpo_mesh_weld_within, in a mesh without
 * repeated positions. map [vertex_count] receives the new index of each vertex. `from`
 * [vertex_count] receives the remaining vertices, ascending; *kept is their number. *moved is the
 * largest distance by which a vertex moves. */
EBPO_MUST_USE ebpo_status ebpo_weld_group_within(const ebpo_mesh *mesh, double distance,
                                                 uint32_t *map, uint32_t *from, uint64_t *kept,
                                                 double *moved, ebpo_error *error);

/* Returns the name of the mesh in messages: its source's name, or "mesh". */
const char *ebpo_mesh_label(const ebpo_mesh *mesh);

/* Returns EBPO_E_ARGUMENT if an array that the counts require is missing, EBPO_E_LIMIT if a count
 * exceeds 2^32 - 2. */
EBPO_MUST_USE ebpo_status ebpo_mesh_check_shape(const ebpo_mesh *mesh, ebpo_error *error);

/* A frame has a power of two as the unit of each axis, so that volumes of meshes with coordinates
 * far from 1 neither overflow nor underflow. Signs and order of coordinates are unchanged. Squares
 * and cubes of values between 2^-256 and 2^256 are far from overflow and underflow. */
enum { EBPO_EXPONENT_MAX = 256 };

/* Returns true if a value with this exponent must be scaled. */
static inline bool ebpo_exponent_is_far(int exponent)
{
    return exponent > EBPO_EXPONENT_MAX || exponent < -EBPO_EXPONENT_MAX;
}

typedef struct ebpo_mesh_frame {
    bool scaled;     /* false: coordinates are unchanged */
    int exponent[3]; /* the unit of axis k is 2^exponent[k] */
} ebpo_mesh_frame;

/* Computes the frame from the corners of all faces. */
ebpo_mesh_frame ebpo_mesh_frame_of(const ebpo_mesh *mesh);

/* Writes the position of a vertex in the units of the frame. */
static inline void ebpo_frame_position(const ebpo_mesh_frame *frame, const ebpo_mesh *mesh,
                                       uint64_t vertex, double out[3])
{
    ebpo_mesh_position(mesh, vertex, out);
    if (frame->scaled)
        for (int k = 0; k < 3; k++)
            out[k] = ldexp(out[k], -frame->exponent[k]);
}

/* The first vertex at the position of each vertex. */
typedef struct ebpo_positions {
    const ebpo_mesh *mesh; /* borrowed */
    uint32_t *first;       /* [vertex_count] lowest vertex index at the position of each vertex */
    ebpo_workspace *workspace; /* workspace of the mesh */
    uint64_t repeated; /* number of vertices that repeat the position of an earlier vertex */
} ebpo_positions;

/* Compares all positions by sorting their hashes, which takes another 16 bytes for each vertex
 * meanwhile. -0 equals 0; NaNs are compared by their bits. `out` is cleared on failure. The result
 * does not depend on the number of threads. */
EBPO_MUST_USE ebpo_status ebpo_positions_build(ebpo_positions *out, const ebpo_mesh *mesh,
                                               unsigned threads, const ebpo_progress *progress,
                                               ebpo_error *error);
void ebpo_positions_free(ebpo_positions *positions);

/* Returns the lowest vertex index at the position of v. */
static inline uint32_t ebpo_positions_first(const ebpo_positions *positions, uint32_t v)
{
    return positions->first[v];
}

#endif
