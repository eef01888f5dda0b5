#include "core/strict_fp.h"

#include "levels/stream_node.h"

#include <string.h>

#include "format/schema.h"
#include "geometry/cells.h"
#include "geometry/octcode.h"
#include "levels/cell_to_model.h"

void ebpo_node_begin(ebpo_stream_node *out, const ebpo_box *box, uint64_t octcode,
                     ebpo_node_type type)
{
    ebpo_cell cell = ebpo_cell_of_octcode(octcode);
    *out = (ebpo_stream_node){ .octcode = octcode, .type = type, .colour = EBPO_COLOUR_OF_NOTHING };
    ebpo_cell_bounds(box, cell, out->min, out->max);
    if (type == EBPO_BLACK)
        out->volume = ebpo_cell_volume(box, cell.level);
}

void ebpo_node_add_planes(ebpo_stream_node *out, const ebpo_box *box, const uint32_t *codes,
                          unsigned count, ebpo_node_buffers *capacity)
{
    ebpo_cell cell = ebpo_cell_of_octcode(out->octcode);
    for (unsigned i = 0; i < count; i++) {
        int32_t n[3], d;
        if (ebpo_plane_decode(codes[i], n, &d))
            ebpo_plane_to_world(box, cell, n, d, capacity->planes[out->plane_count++]);
    }
    out->planes = (const double(*)[4])capacity->planes;
}

void ebpo_node_add_polygons(ebpo_stream_node *out, const ebpo_box *box, const ebpo_polytope *p,
                            ebpo_node_buffers *capacity)
{
    ebpo_cell cell = ebpo_cell_of_octcode(out->octcode);
    ebpo_polytope_to_world(p, box, cell, capacity->vertices);
    for (int f = 0; f <= p->face_count; f++)
        capacity->polygon_first[f] = p->first[f];
    for (int i = 0; i < p->corner_count; i++)
        capacity->corners[i] = p->corner[i];
    out->volume = ebpo_polytope_volume(p) * ebpo_cell_volume(box, cell.level);
    out->vertex_count = (uint32_t)p->vertex_count;
    out->polygon_count = (uint32_t)p->face_count;
    out->vertices = (const double(*)[3])capacity->vertices;
    out->polygon_first = capacity->polygon_first;
    out->corners = capacity->corners;
}
