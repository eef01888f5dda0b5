/* crossing_faces MODEL.ply...: checks that each model is a closed 2-manifold whose faces have no
 * common points except shared corners and edges. Prints a line for each model; exit code 1: a check
 * fails. Reads only PLY files of ebpo-generate. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "crossing_faces.h"

typedef struct model {
    float (*xyz)[3];
    uint32_t (*corners)[3];
    uint64_t vertices, faces;
} model;

static bool read_head(FILE *in, model *m)
{
    static const char *const lines[] = { "property float x\n", "property float y\n",
                                         "property float z\n" };
    char line[256];
    int same = 0;
    bool little = false;
    while (fgets(line, sizeof line, in) && strcmp(line, "end_header\n") != 0) {
        little |= strcmp(line, "format binary_little_endian 1.0\n") == 0;
        sscanf(line, "element vertex %" SCNu64, &m->vertices);
        sscanf(line, "element face %" SCNu64, &m->faces);
        if (strncmp(line, "property", 8) == 0)
            same += same < 3 ? strcmp(line, lines[same]) == 0
                             : strncmp(line, "property list uchar ", 20) == 0;
    }
    return little && same == 4 && m->vertices && m->faces && m->vertices < UINT32_MAX &&
           m->faces < UINT32_MAX;
}

static bool read_model(const char *path, model *m)
{
    FILE *in = fopen(path, "rb");
    memset(m, 0, sizeof *m);
    bool ok = in && read_head(in, m);
    if (ok) {
        m->xyz = malloc(m->vertices * sizeof *m->xyz);
        m->corners = malloc(m->faces * sizeof *m->corners);
        ok = m->xyz && m->corners && fread(m->xyz, sizeof *m->xyz, m->vertices, in) == m->vertices;
    }
    for (uint64_t f = 0; ok && f < m->faces; f++) {
        ok = fgetc(in) == 3 && fread(m->corners[f], 12, 1, in) == 1;
        for (int k = 0; ok && k < 3; k++)
            ok = m->corners[f][k] < m->vertices;
    }
    if (in)
        fclose(in);
    return ok;
}

static bool check(const char *path)
{
    model m;
    uint64_t first[2] = { 0, 0 }, clashes = 0;
    bool ok = read_model(path, &m);
    if (!ok) {
        printf("%s: not a PLY file of ebpo-generate\n", path);
    } else {
        face_model faces = { (const float(*)[3])m.xyz, (const uint32_t(*)[3])m.corners, m.vertices,
                             m.faces };
        uint64_t flat = crossing_flat_faces(&faces);
        bool manifold = crossing_closed_manifold(&faces);
        printf("%s: %" PRIu64 " faces, %s, %" PRIu64 " without area", path, m.faces,
               manifold ? "a closed manifold" : "not a closed manifold", flat);
        if (flat == 0) {
            clashes = crossing_faces(&faces, first);
            printf(", %" PRIu64 " pairs intersect", clashes);
        }
        if (clashes)
            printf(", the first %" PRIu64 " and %" PRIu64, first[0], first[1]);
        printf("\n");
        ok = manifold && flat == 0 && clashes == 0;
    }
    free(m.xyz);
    free(m.corners);
    return ok;
}

int main(int argc, char **argv)
{
    bool ok = argc > 1;
    for (int i = 1; i < argc; i++)
        ok = check(argv[i]) && ok;
    return ok ? EXIT_SUCCESS : EXIT_FAILURE;
}
