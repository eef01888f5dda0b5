/* Names in OBJ files: of materials, which faces have numbers of, and of groups. */
#ifndef EBPO_MESH_OBJ_NAMES_H
#define EBPO_MESH_OBJ_NAMES_H

#include <ebpo/mesh.h>

#include "core/text.h"
#include "mesh/obj_text.h"

/* Faces that stand under one `g` or `o` line. */
typedef struct ebpo_obj_runs {
    ebpo_named_run *of; /* [count] the first is what stands before any name; that is "" */
    uint64_t count, capacity;
} ebpo_obj_runs;

void ebpo_obj_runs_free(ebpo_obj_runs *runs);

/* Begins a run. EBPO_E_LIMIT, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_obj_runs_add(ebpo_obj_runs *runs, obj_word run, const char *name,
                                            ebpo_error *error);

typedef struct obj_names {
    obj_word *material; /* [count] in order of first use; 0 is none */
    uint32_t *slot;     /* a table of numbers */
    uint64_t count, capacity, slots;
    uint32_t current;
    uint32_t *of_face; /* [faces] */
    uint64_t face_capacity;
    uint64_t faces; /* that have one */
} obj_names;

/* A material begins. EBPO_E_LIMIT, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_obj_use_material(obj_names *names, obj_word material,
                                                ebpo_error *error);

/* All faces of the mesh that have none yet have the current one. EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_obj_give_material(obj_names *names, const ebpo_mesh *mesh,
                                                 ebpo_error *error);

/* If there are any, they become an attribute of faces, with a header that has the names. */
EBPO_MUST_USE ebpo_status ebpo_obj_keep_materials(obj_names *names, ebpo_mesh *mesh,
                                                  ebpo_error *error);

void ebpo_obj_names_free(obj_names *names, ebpo_workspace *workspace);

#endif
