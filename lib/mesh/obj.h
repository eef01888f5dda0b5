/* The statements and words of an OBJ file. Source: "Object Files (.obj)", appendix B1 of
 * Wavefront's Advanced Visualizer manual, 3.0. */
#ifndef EBPO_MESH_OBJ_H
#define EBPO_MESH_OBJ_H

#include <ebpo/base.h>
#include <ebpo/mesh.h>

#include "core/text.h"
#include "mesh/import_build.h"

typedef struct ebpo_obj_word {
    const char *s;
    size_t n;
} ebpo_obj_word;

/* Where one is. Lines end with a line feed, a carriage return, or both. */
typedef struct ebpo_obj_text {
    const char *at, *end;
    uint64_t line; /* from 1 */
    bool begun;    /* the first statement has been found */
} ebpo_obj_text;

/* At the first statement: behind a mark of the order of bytes, if there is one. */
ebpo_obj_text ebpo_obj_text_begin(const uint8_t *data, uint64_t size);

/* The next word of the statement. False at its end, which a comment is too. A backslash at the end
 * of a line joins the next one. */
bool ebpo_obj_next_word(ebpo_obj_text *t, ebpo_obj_word *word);

/* What is left of the line, without blanks around it: a name. Backslashes are part of it, since
 * names of folders have them, so it joins no line. */
ebpo_obj_word ebpo_obj_name(ebpo_obj_text *t);

/* To the next statement that is not empty, past what is left of this one, and its first word. False
 * at the end of the file. */
bool ebpo_obj_next_statement(ebpo_obj_text *t, ebpo_obj_word *word);

bool ebpo_obj_word_is(ebpo_obj_word word, const char *text);

/* Names in OBJ files: of materials, which faces have numbers of, and of groups. */

/* Begins a run. EBPO_E_LIMIT, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_obj_runs_add(ebpo_import_runs *runs, ebpo_obj_word run,
                                            const char *name, ebpo_error *error);

typedef struct ebpo_obj_names {
    ebpo_obj_word *material; /* [count] in order of first use; 0 is none */
    uint32_t *slot;          /* a table of numbers */
    uint64_t count, capacity, slots;
    uint32_t current;
    uint32_t *of_face; /* [faces] */
    uint64_t face_capacity;
    uint64_t faces; /* that have one */
} ebpo_obj_names;

/* A material begins. EBPO_E_LIMIT, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_obj_use_material(ebpo_obj_names *names, ebpo_obj_word material,
                                                ebpo_error *error);

/* All faces of the mesh that have none yet have the current one. EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_obj_give_material(ebpo_obj_names *names, const ebpo_mesh *mesh,
                                                 ebpo_error *error);

/* If there are any, they become an attribute of faces, with a header that has the names. */
EBPO_MUST_USE ebpo_status ebpo_obj_keep_materials(ebpo_obj_names *names, ebpo_mesh *mesh,
                                                  ebpo_error *error);

void ebpo_obj_names_free(ebpo_obj_names *names, ebpo_workspace *workspace);

#endif
