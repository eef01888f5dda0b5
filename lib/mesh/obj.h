/* Reads the statements and words of an OBJ file, and its material and group names. Source: "Object
 * Files (.obj)", appendix B1 of Wavefront's Advanced Visualizer manual, 3.0. */
#ifndef EBPO_MESH_OBJ_H
#define EBPO_MESH_OBJ_H

#include <ebpo/base.h>
#include <ebpo/mesh.h>

#include "core/text.h"
#include "mesh/import_build.h"

/* A word or a name of the file: n bytes at s, not terminated by zero. */
typedef struct ebpo_obj_word {
    const char *s;
    size_t n;
} ebpo_obj_word;

/* A position `at` in the file. Lines end with a line feed, a carriage return, or both. */
typedef struct ebpo_obj_text {
    const char *at, *end;
    uint64_t line; /* from 1 */
    bool begun;    /* the first statement has been found */
} ebpo_obj_text;

/* Returns the position of the first statement, after a byte order mark if there is one. */
ebpo_obj_text ebpo_obj_text_begin(const uint8_t *data, uint64_t size);

/* Reads the next word of the statement. Returns false at the end of the statement or at a comment.
 * A backslash at the end of a line joins the line with the next line. */
bool ebpo_obj_next_word(ebpo_obj_text *t, ebpo_obj_word *word);

/* Returns the rest of the line as a name, without surrounding blanks. Backslashes are part of the
 * name, because folder names contain backslashes; here, backslashes do not join lines. */
ebpo_obj_word ebpo_obj_name(ebpo_obj_text *t);

/* Moves to the next non-empty statement and reads its first word. Returns false at the end of the
 * file. */
bool ebpo_obj_next_statement(ebpo_obj_text *t, ebpo_obj_word *word);

/* Returns true if the word equals the text. */
bool ebpo_obj_word_is(ebpo_obj_word word, const char *text);

/* Names in OBJ files: materials, which are stored as an index for each face, and groups. */

/* Begins a run of faces with the name `run`. `name`: name of the file, for messages. EBPO_E_LIMIT,
 * EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_obj_runs_add(ebpo_import_runs *runs, ebpo_obj_word run,
                                            const char *name, ebpo_error *error);

/* The materials: their names, and the index of a name for each face. */
typedef struct ebpo_obj_names {
    /* [count] names in order of first use; name 0 stands for faces without a material */
    ebpo_obj_word *material;
    uint32_t *slot; /* [slots] hash table of indices of names; 0: a free slot */
    uint64_t count, capacity, slots;
    uint32_t current;  /* material of the next faces */
    uint32_t *of_face; /* [faces] material of each face */
    uint64_t face_capacity;
    uint64_t faces; /* number of faces to which a material (or 0) was given */
} ebpo_obj_names;

/* Makes a material the current one. EBPO_E_LIMIT, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_obj_use_material(ebpo_obj_names *names, ebpo_obj_word material,
                                                ebpo_error *error);

/* Gives the current material to all faces of the mesh that have no material yet. EBPO_E_MEMORY,
 * EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_obj_give_material(ebpo_obj_names *names, const ebpo_mesh *mesh,
                                                 ebpo_error *error);

/* Adds the materials, if any, as a face attribute, and their names as a header. */
EBPO_MUST_USE ebpo_status ebpo_obj_keep_materials(ebpo_obj_names *names, ebpo_mesh *mesh,
                                                  ebpo_error *error);

void ebpo_obj_names_free(ebpo_obj_names *names, ebpo_workspace *workspace);

#endif
