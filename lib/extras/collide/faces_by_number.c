#include "core/strict_fp.h"

#include "extras/collide/faces_by_number.h"

#include <string.h>

void ebpo_faces_by_number_begin(ebpo_faces_by_number *f, const ebpo_model *model,
                                const uint32_t *slots)
{
    *f = (ebpo_faces_by_number){ .model = model, .slots = slots };
    if (model->whole)
        return;
    f->faces.array = ebpo_reader_array(model->file, EBPO_A_FACES, 0);
    f->vertices.array = ebpo_reader_array(model->file, EBPO_A_VERTICES, 0);
}

void ebpo_faces_by_number_end(ebpo_faces_by_number *f)
{
    if (!f->model || f->model->whole)
        return;
    ebpo_held_chunk_release(f->model->chunks, &f->faces);
    ebpo_held_chunk_release(f->model->chunks, &f->vertices);
}

ebpo_status ebpo_faces_by_number_vertex(ebpo_faces_by_number *f, uint64_t vertex, double out[3],
                                        ebpo_error *error)
{
    ebpo_status status = ebpo_held_chunk_move(f->model->chunks, &f->vertices, vertex, error);
    if (status != EBPO_OK)
        return status;
    uint64_t row = vertex - f->vertices.begin;
    if (f->model->info->double_coordinates) {
        memcpy(out, f->vertices.rows + row * 3 * sizeof(double), 3 * sizeof(double));
        return EBPO_OK;
    }
    float x[3];
    memcpy(x, f->vertices.rows + row * sizeof x, sizeof x);
    for (int k = 0; k < 3; k++)
        out[k] = (double)x[k];
    return EBPO_OK;
}

ebpo_status ebpo_faces_by_number_corners(ebpo_faces_by_number *f, uint64_t face, uint32_t out[3],
                                         ebpo_error *error)
{
    ebpo_status status = ebpo_held_chunk_move(f->model->chunks, &f->faces, face, error);
    if (status == EBPO_OK)
        memcpy(out, f->faces.rows + (face - f->faces.begin) * 3 * sizeof *out, 3 * sizeof *out);
    return status;
}

ebpo_status ebpo_faces_by_number_get(ebpo_faces_by_number *f, uint64_t face, double out[3][3],
                                     ebpo_error *error)
{
    uint32_t corner[3];
    if (f->model->whole) {
        ebpo_accel_triangle(f->model->whole, f->slots[face], out);
        return EBPO_OK;
    }
    ebpo_status status = ebpo_faces_by_number_corners(f, face, corner, error);
    for (int i = 0; i < 3 && status == EBPO_OK; i++)
        status = ebpo_faces_by_number_vertex(f, corner[i], out[i], error);
    return status;
}
