/* Components of a mesh while they are being found, and grouped. */
#ifndef EBPO_MESH_COMPONENT_PARTS_H
#define EBPO_MESH_COMPONENT_PARTS_H

#include <ebpo/groups.h>

#include "core/text.h"
#include "mesh/mesh_parts.h"

/* Faces that share vertices. */
typedef struct ebpo_found_component {
    uint64_t first; /* the least source number of its faces */
    uint32_t face;  /* that face, in the mesh as it is */
    bool open;      /* an edge is not used as often in one direction as in the other */
    double volume;  /* of a closed one, signed, in a unit of all components' own (mesh_parts.h) */
    double min[3], max[3];
    uint32_t host; /* of a cavity: what it is in; else itself */
} ebpo_found_component;

/* Numbers of faces or vertices, those of one group together, each group's ascending. */
typedef struct ebpo_number_groups {
    uint64_t *begin; /* [groups + 1] into `of` */
    uint32_t *of;
} ebpo_number_groups;

struct ebpo_components {
    const ebpo_mesh *mesh;
    const ebpo_mesh_groups *named; /* NULL: components; else neither list, number nor place */
    uint64_t count;                /* first all, then those that are no cavity of another one */
    ebpo_found_component *list;    /* [all] */
    ebpo_component *facts;         /* [count] */
    /* [face_count] the component of each face, borrowed; NULL: that of its vertices */
    uint32_t *of_face;
    uint32_t *number; /* [vertex_count] the component; EBPO_NO_INDEX: no face names the vertex */
    uint32_t *place;  /* [vertex_count] among its component's vertices */
    ebpo_number_groups faces, vertices;
};

/* EBPO_E_FORMAT: no faces, or one names a vertex that is not there. EBPO_E_ARGUMENT. */
EBPO_MUST_USE ebpo_status ebpo_components_check(const ebpo_mesh *mesh, ebpo_error *error);

/* Of faces (else vertices) by their components or named groups. */
EBPO_MUST_USE ebpo_status ebpo_components_group(const ebpo_components *c, bool faces,
                                                ebpo_number_groups *g, ebpo_error *error);

/* Components, each with its faces, edges and volume, but no cavity joined to another one; freed by
 * ebpo_components_free. On failure as well. `closed`: NULL, or of ebpo_mesh_find_shells: each shell
 * is one, and other faces that share vertices; it becomes `of_face`. */
EBPO_MUST_USE ebpo_status ebpo_components_find(const ebpo_mesh *mesh, uint32_t *closed,
                                               unsigned threads, const ebpo_progress *progress,
                                               ebpo_components **out, ebpo_error *error);

/* The component of each vertex, [vertex_count]; EBPO_NO_INDEX: no face names it. The mesh's
 * workspace owns it. On failure NULL. */
EBPO_MUST_USE ebpo_status ebpo_components_number(const ebpo_mesh *mesh, uint32_t **number,
                                                 ebpo_error *error);

/* Edges and volumes; needs the groups of faces. */
EBPO_MUST_USE ebpo_status ebpo_components_measure(ebpo_components *c, unsigned threads,
                                                  const ebpo_progress *progress, ebpo_error *error);

/* Sets each one's host; needs what is measured. */
EBPO_MUST_USE ebpo_status ebpo_cavities_place(const ebpo_components *c, ebpo_error *error);

/* Groups of faces that a file has names for. */

struct ebpo_mesh_groups {
    ebpo_mesh_group *list; /* [count] those with faces first, in the order of these */
    uint64_t count, with_faces, face_count;
    char *names;
    uint64_t *run_end; /* [run_count] the number after its last face, ascending */
    uint32_t *run_group;
    uint64_t run_count;
};

/* Runs of one name are one group; "" and "default" are one name. The first run's name is told only
 * if it has faces. EBPO_E_LIMIT, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_mesh_groups_new(const ebpo_named_run *runs, uint64_t count,
                                               ebpo_mesh_groups **out, ebpo_error *error);

/* The group of a face by its number in the source; EBPO_NO_INDEX: it is in none. */
uint32_t ebpo_mesh_group_of(const ebpo_mesh_groups *groups, uint64_t face);

#endif
