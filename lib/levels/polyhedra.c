#include "core/strict_fp.h"

#include "levels/polyhedra.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/cells.h"
#include "geometry/octcode.h"

static const uint64_t count_limit = UINT32_MAX - 1;

void ebpo_polyhedra_free(ebpo_polyhedra *piece)
{
    free(piece->xyz);
    free(piece->faces);
    piece->xyz = NULL;
    piece->faces = NULL;
    piece->vertex_count = piece->vertex_capacity = piece->face_count = piece->face_capacity = 0;
    free(piece->nodes);
    free(piece->corners);
    piece->nodes = NULL;
    piece->corners = NULL;
    piece->node_count = piece->node_capacity = piece->polygon_count = piece->polygon_capacity = 0;
}

static void add_fan(ebpo_polyhedra *piece, const uint32_t *number, const uint16_t *loop,
                    int corners)
{
    for (int i = 1; i + 1 < corners; i++) {
        uint32_t *face = piece->faces + 3 * piece->face_count++;
        face[0] = number[loop[0]];
        face[1] = number[loop[i]];
        face[2] = number[loop[i + 1]];
    }
}

/* Room for the node of a polytope, which is begun. */
static bool begin_node(ebpo_polyhedra *piece, const ebpo_polytope *p, const ebpo_box *box,
                       ebpo_cell cell, ebpo_node_type type)
{
    if (!ebpo_grow(&piece->nodes, &piece->node_capacity, piece->node_count + 1,
                   sizeof *piece->nodes) ||
        !ebpo_grow(&piece->corners, &piece->polygon_capacity,
                   piece->polygon_count + (uint64_t)p->face_count, 1))
        return false;
    piece->nodes[piece->node_count++] =
        (ebpo_lod_node){ .octcode = ebpo_octcode_of_cell(cell),
                         .volume = ebpo_polytope_volume(p) * ebpo_cell_volume(box, cell.level),
                         .type = type };
    return true;
}

static void end_polygon(ebpo_polyhedra *piece, unsigned corners)
{
    piece->corners[piece->polygon_count++] = (uint8_t)corners;
    piece->nodes[piece->node_count - 1].polygon_count++;
}

ebpo_status ebpo_polyhedra_add(ebpo_polyhedra *piece, const ebpo_polytope *p, const ebpo_box *box,
                               ebpo_cell cell, ebpo_node_type type, bool walls, ebpo_error *error)
{
    if (piece->vertex_count + EBPO_POLYTOPE_VERTICES > count_limit)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "the level has more than 4294967294 vertices; choose a coarser level");
    if (!ebpo_grow(&piece->xyz, &piece->vertex_capacity,
                   piece->vertex_count + (uint64_t)p->vertex_count, 3 * sizeof(double)) ||
        !ebpo_grow(&piece->faces, &piece->face_capacity,
                   piece->face_count + (uint64_t)p->corner_count, 3 * sizeof(uint32_t)) ||
        (piece->wants_nodes && !begin_node(piece, p, box, cell, type)))
        return ebpo_fail_memory(error,
                                (piece->vertex_count + piece->face_count) * 3 * sizeof(double));
    uint32_t number[EBPO_POLYTOPE_VERTICES];
    uint8_t sides[EBPO_POLYTOPE_VERTICES];
    ebpo_polytope_sides(p, sides);
    memset(number, 0xff, sizeof number);
    uint64_t first_vertex = piece->vertex_count;
    for (int f = 0; f < p->face_count; f++) {
        if (p->tag[f] < 0 && !walls)
            continue;
        for (int i = p->first[f]; i < p->first[f + 1]; i++) {
            uint16_t v = p->corner[i];
            if (number[v] != UINT32_MAX)
                continue;
            for (int k = 0; k < 3; k++)
                piece->xyz[3 * piece->vertex_count + (uint64_t)k] =
                    ebpo_wall_point(box, cell, k, p->vertex[v][k], sides[v]);
            number[v] = (uint32_t)piece->vertex_count++;
        }
        add_fan(piece, number, p->corner + p->first[f], p->first[f + 1] - p->first[f]);
        if (piece->wants_nodes)
            end_polygon(piece, p->first[f + 1] - p->first[f]);
    }
    if (piece->wants_nodes)
        piece->nodes[piece->node_count - 1].vertex_count =
            (uint32_t)(piece->vertex_count - first_vertex);
    return EBPO_OK;
}

static void append(ebpo_mesh *out, const ebpo_polyhedra *piece)
{
    if (piece->vertex_count)
        memcpy(out->xyz64 + 3 * out->vertex_count, piece->xyz,
               piece->vertex_count * 3 * sizeof(double));
    uint32_t *faces = out->faces + 3 * out->face_count, base = (uint32_t)out->vertex_count;
    for (uint64_t i = 0; i < 3 * piece->face_count; i++)
        faces[i] = piece->faces[i] + base;
    out->vertex_count += piece->vertex_count;
    out->face_count += piece->face_count;
}

static void append_nodes(ebpo_lod_nodes *out, const ebpo_polyhedra *piece)
{
    if (piece->node_count)
        memcpy(out->nodes + out->node_count, piece->nodes, piece->node_count * sizeof *out->nodes);
    if (piece->polygon_count)
        memcpy(out->corners + out->polygon_count, piece->corners, piece->polygon_count);
    out->node_count += piece->node_count;
    out->polygon_count += piece->polygon_count;
}

static ebpo_status make_nodes(ebpo_lod_nodes *out, ebpo_polyhedra *const *pieces, uint64_t count,
                              ebpo_error *error)
{
    uint64_t nodes = 0, polygons = 0;
    for (uint64_t i = 0; i < count; i++) {
        nodes += pieces[i]->node_count;
        polygons += pieces[i]->polygon_count;
    }
    out->nodes = ebpo_alloc(nodes, sizeof *out->nodes);
    out->corners = ebpo_alloc(polygons, 1);
    return out->nodes && out->corners
               ? EBPO_OK
               : ebpo_fail_memory(error, nodes * sizeof *out->nodes + polygons);
}

ebpo_status ebpo_polyhedra_join(ebpo_mesh *out, ebpo_lod_nodes *out_nodes,
                                ebpo_polyhedra *const *pieces, uint64_t count, ebpo_error *error)
{
    uint64_t vertices = 0, faces = 0;
    for (uint64_t i = 0; i < count; i++) {
        vertices += pieces[i]->vertex_count;
        faces += pieces[i]->face_count;
    }
    if (vertices > count_limit || faces > count_limit)
        return ebpo_fail(
            error, EBPO_E_LIMIT,
            "the level has more than 4294967294 vertices or faces; choose a coarser level");
    memset(out, 0, sizeof *out);
    out->xyz64 = ebpo_alloc(vertices, 3 * sizeof(double));
    out->faces = ebpo_alloc(faces, 3 * sizeof(uint32_t));
    if (!out->xyz64 || !out->faces ||
        (out_nodes && make_nodes(out_nodes, pieces, count, error) != EBPO_OK)) {
        ebpo_mesh_free(out);
        return ebpo_fail_memory(error,
                                vertices * 3 * sizeof(double) + faces * 3 * sizeof(uint32_t));
    }
    for (uint64_t i = 0; i < count; i++) {
        append(out, pieces[i]);
        if (out_nodes)
            append_nodes(out_nodes, pieces[i]);
        ebpo_polyhedra_free(pieces[i]);
    }
    return EBPO_OK;
}
