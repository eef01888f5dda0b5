/* Carries attributes of operands over to the mesh of a result. For one thread. */
#ifndef EBPO_BOOLEAN_RESULT_ATTRIBUTES_H
#define EBPO_BOOLEAN_RESULT_ATTRIBUTES_H

#include "extras/boolean/boolean.h"
#include "mesh/attributes.h"

/* An array of attributes that operands have and the result gets. */
typedef struct ebpo_carried {
    uint64_t array;   /* index in the attributes of the result's mesh */
    bool of_faces;    /* one row for each face; else for each vertex */
    int normal;       /* index of the first of three columns with a normal; -1: no normals */
    uint64_t *filled; /* a bit for each vertex whose row has been filled; NULL if `of_faces` */
    const ebpo_attribute
        *from; /* array of the current operand; NULL: the operand does not have the array */
} ebpo_carried;

/* All carried arrays. A zero struct carries nothing. */
typedef struct ebpo_carrying {
    ebpo_mesh *mesh; /* the mesh of the result */
    bool coloured;   /* the faces of the mesh have colours by operand, so colours are not carried */
    ebpo_carried *item;
    uint64_t count, capacity;
    double rotation[3][3]; /* rotation of the current operand's pose */
} ebpo_carrying;

/* Adds to the mesh the arrays of vertices and of faces that the operands of the expression have.
 * vertices, faces: numbers of rows for which memory is allocated. If an operand does not have an
 * array, its rows are 0, or 255 for bytes of colours. coloured: the faces of the mesh have colours
 * already. Notes in the mesh which arrays are not carried: arrays of elements other than vertices
 * and faces, lists, and arrays whose name the mesh already has. Must be freed, also after a
 * failure. */
EBPO_MUST_USE ebpo_status ebpo_carrying_begin(ebpo_carrying *c, const ebpo_boolean *b,
                                              ebpo_mesh *mesh, bool coloured, uint64_t vertices,
                                              uint64_t faces, ebpo_error *error);

/* Begins an operand, whose mesh has been read with its attributes. */
void ebpo_carrying_operand(ebpo_carrying *c, const ebpo_posed_solid *solid, const ebpo_mesh *mesh);

/* Fills row `row` of the arrays of vertices with values interpolated between three vertices of the
 * operand. Keeps a row that is filled already. weight: weights of these vertices. sign: -1 if the
 * face is reversed, else 1. */
void ebpo_carry_vertex(ebpo_carrying *c, uint64_t row, const uint32_t corner[3],
                       const double weight[3], int sign);
/* Fills row `row` of the arrays of faces with the values of a face of the operand. */
void ebpo_carry_face(ebpo_carrying *c, uint64_t row, uint64_t face, int sign);

/* Sets the numbers of rows of all arrays to the numbers of vertices and faces of the mesh. */
void ebpo_carrying_end(ebpo_carrying *c);
void ebpo_carrying_free(ebpo_carrying *c);

#endif
