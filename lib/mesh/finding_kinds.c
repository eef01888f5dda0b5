/* What kinds of findings are called, and their colours. */
#include <string.h>

#include <ebpo/places.h>

static const struct finding_kind {
    const char *name;
    uint8_t rgb[3];
} kinds[EBPO_FINDING_KINDS] = {
    [EBPO_FOUND_BOUNDARY_EDGE] = { "boundary_edges", { 255, 127, 14 } },
    [EBPO_FOUND_NONMANIFOLD_EDGE] = { "nonmanifold_edges", { 214, 39, 40 } },
    [EBPO_FOUND_MISORIENTED_EDGE] = { "misoriented_edges", { 148, 103, 189 } },
    [EBPO_FOUND_UNBALANCED_EDGE] = { "unbalanced_edges", { 140, 86, 75 } },
    [EBPO_FOUND_REPEATED_FACE] = { "repeated_faces", { 31, 119, 180 } },
    [EBPO_FOUND_INDEX_REPEATED_FACE] = { "index_repeated_faces", { 188, 189, 34 } },
    [EBPO_FOUND_ZERO_AREA_FACE] = { "zero_area_faces", { 255, 221, 0 } },
    [EBPO_FOUND_BOWTIE_VERTEX] = { "bowtie_vertices", { 227, 119, 194 } },
    [EBPO_FOUND_REPEATED_POSITION] = { "repeated_positions", { 44, 160, 44 } },
    [EBPO_FOUND_UNREFERENCED_VERTEX] = { "unreferenced_vertices", { 23, 190, 207 } },
};

const char *ebpo_finding_name(int32_t kind)
{
    return kind >= 0 && kind < EBPO_FINDING_KINDS ? kinds[kind].name : NULL;
}

void ebpo_finding_colour(int32_t kind, uint8_t rgb[3])
{
    static const uint8_t grey[3] = { 200, 200, 200 };
    memcpy(rgb, ebpo_finding_name(kind) ? kinds[kind].rgb : grey, 3);
}
