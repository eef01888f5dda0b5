/* Carries attributes of operands over to the mesh of a result. For one thread. */
#ifndef EBPO_BOOLEAN_RESULT_ATTRIBUTES_H
#define EBPO_BOOLEAN_RESULT_ATTRIBUTES_H

#include "extras/boolean/boolean.h"
#include "mesh/attributes.h"

/* An array of the result. */
typedef struct ebpo_carried {
    uint64_t array; /* its index in the attributes of the mesh */
    bool of_faces;
    int normal;                 /* first of three columns with a normal; -1: none */
    uint64_t *filled;           /* of vertices: a bit for each row that has its values */
    const ebpo_attribute *from; /* array of the current operand; NULL: it has none */
} ebpo_carried;

/* A zero struct carries nothing. */
typedef struct ebpo_carrying {
    ebpo_mesh *mesh;
    bool coloured; /* its faces have colours of the result */
    ebpo_carried *item;
    uint64_t count, capacity;
    double rotation[3][3]; /* of the current operand */
} ebpo_carrying;

/* Adds the arrays of vertices and faces of all operands that the expression uses to the mesh, with
 * memory for the given numbers of rows. Rows of operands without an array are 0, or 255 for bytes
 * of colours. coloured: faces have colours already. Notes what is not carried: other elements,
 * lists, and arrays whose names are taken. Must be freed, also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_carrying_begin(ebpo_carrying *c, const ebpo_boolean *b,
                                              ebpo_mesh *mesh, bool coloured, uint64_t vertices,
                                              uint64_t faces, ebpo_error *error);

/* Begins an operand, whose mesh has been read with its attributes. */
void ebpo_carrying_operand(ebpo_carrying *c, const ebpo_posed_solid *solid, const ebpo_mesh *mesh);

/* Fills the arrays that do not have vertex `row` yet from a face of the operand; sign -1: the face
 * is reversed. weight: of the face's corners. */
void ebpo_carry_vertex(ebpo_carrying *c, uint64_t row, const uint32_t corner[3],
                       const double weight[3], int sign);
void ebpo_carry_face(ebpo_carrying *c, uint64_t row, uint64_t face, int sign);

/* Sets the numbers of rows. */
void ebpo_carrying_end(ebpo_carrying *c);
void ebpo_carrying_free(ebpo_carrying *c);

#endif
