/* Defines the state of the search for the components of a mesh, and the grouping of faces and
 * vertices by component. */
#ifndef EBPO_MESH_COMPONENT_PARTS_H
#define EBPO_MESH_COMPONENT_PARTS_H

#include <ebpo/groups.h>

#include "core/text.h"
#include "mesh/mesh_parts.h"

/* A component: faces connected by vertices. */
typedef struct ebpo_found_component {
    uint64_t first; /* least source index of the component's faces */
    uint32_t face;  /* index in the current mesh of the face with this source index */
    bool open;      /* true: some edge is not used equally often in both directions */
    /* signed volume of a closed component, in the units of ebpo_mesh_frame (mesh_parts.h) */
    double volume;
    double min[3], max[3]; /* bounding box */
    /* for a cavity, the component around the cavity; otherwise the component itself */
    uint32_t host;
} ebpo_found_component;

/* The indices of faces or vertices by group, ascending within each group. */
typedef struct ebpo_number_groups {
    uint64_t *begin;   /* [groups + 1] begin of each group in `members` */
    uint32_t *members; /* indices of faces or vertices */
} ebpo_number_groups;

struct ebpo_components {
    const ebpo_mesh *mesh;
    const ebpo_mesh_groups *named; /* not NULL: the struct has these named groups in place of
                                      components, and list, number and position are unused */
    uint64_t count; /* number of components; cavities count until they are joined to their hosts */
    ebpo_found_component *list; /* all components, also cavities */
    ebpo_component *facts;      /* [count] results for ebpo_components_get */
    /* [face_count] component of each face, borrowed; NULL: `number` gives the component of a face's
     * vertices */
    uint32_t *of_face;
    uint32_t *number; /* [vertex_count] component of each vertex; EBPO_NO_INDEX: unused vertex */
    /* [vertex_count] position among the component's vertices; NULL: position_of in components.c
     * searches for it */
    uint32_t *position;
    ebpo_number_groups faces, vertices;
};

/* Returns EBPO_E_FORMAT for a mesh without faces or with an invalid vertex index; EBPO_E_ARGUMENT
 * for an invalid mesh. */
EBPO_MUST_USE ebpo_status ebpo_components_check(const ebpo_mesh *mesh, ebpo_error *error);

/* Groups faces (or vertices, if `faces` is false) by their components or named groups. */
EBPO_MUST_USE ebpo_status ebpo_components_group(const ebpo_components *c, bool faces,
                                                ebpo_number_groups *g, ebpo_error *error);

/* Finds components with their faces, edges and volumes; cavities are not yet joined to their hosts.
 * Free with ebpo_components_free, also on failure. `closed`: NULL, or the result of
 * ebpo_mesh_find_shells, the shell (closed surface) of each face. With `closed`, each shell is a
 * component, and only faces in no shell are connected by vertices. The array `closed` becomes the
 * field `of_face` of the result. */
EBPO_MUST_USE ebpo_status ebpo_components_find(const ebpo_mesh *mesh, uint32_t *closed,
                                               unsigned threads, const ebpo_progress *progress,
                                               ebpo_components **out, ebpo_error *error);

/* Computes (*number)[vertex_count]: the component of each vertex, or EBPO_NO_INDEX for an unused
 * vertex. The mesh's workspace owns the array. On failure, *number is NULL. */
EBPO_MUST_USE ebpo_status ebpo_components_number(const ebpo_mesh *mesh, uint32_t **number,
                                                 ebpo_error *error);

/* Finds out which components are closed, and computes their volumes. The groups of faces must
 * exist. */
EBPO_MUST_USE ebpo_status ebpo_components_measure(ebpo_components *c, unsigned threads,
                                                  const ebpo_progress *progress, ebpo_error *error);

/* Sets the host of each component (ebpo_found_component.host). ebpo_components_measure must have
 * been called. */
EBPO_MUST_USE ebpo_status ebpo_cavities_place(const ebpo_components *c, ebpo_error *error);

/* The groups of faces that a file names. */

struct ebpo_mesh_groups {
    ebpo_mesh_group *list; /* [count] groups with faces first, in the order of their faces */
    uint64_t count;        /* number of groups */
    uint64_t with_faces;   /* number of groups with faces */
    uint64_t face_count;   /* number of faces of all groups */
    char *names;
    /* a run is a range of consecutive faces of one group */
    uint64_t *run_end;   /* [run_count] one past the last face of each run, ascending */
    uint32_t *run_group; /* [run_count] group of each run */
    uint64_t run_count;
};

/* Merges all runs with the same name into a group; "" and "default" are the same name. runs[0] has
 * the faces before the first name of the file. If no faces precede the first name, runs[0] makes no
 * group. EBPO_E_LIMIT, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_mesh_groups_new(const ebpo_named_run *runs, uint64_t count,
                                               ebpo_mesh_groups **out, ebpo_error *error);

/* Returns the group of a face, given by its source index, or EBPO_NO_INDEX. */
uint32_t ebpo_mesh_group_of(const ebpo_mesh_groups *groups, uint64_t face);

#endif
