/* Writes the faces around a point as PLY, for a model of any size, from a disk or by HTTP. Reads
 * only one subtree: that of the cell of level LEVEL that contains the point. In a model of 28
 * million faces, a cell of level 6 contains about 2,000 faces.
 *
 *     draw_around FILE.ebpo.h5|URL X Y Z LEVEL OUT.ply
 *     cc draw_around.c $(pkg-config --cflags --libs ebpo) */
#include <ebpo/ebpo.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

static bool write_faces(const ebpo_subtree_faces *faces, const char *path, ebpo_error *error)
{
    /* The arrays belong to the subtree, so this mesh is not freed. Its members are not const, but
     * ebpo_mesh_write_ply does not change the arrays. */
    ebpo_mesh mesh = { .vertex_count = faces->vertex_count,
                       .face_count = faces->face_count,
                       .xyz32 = (float *)faces->xyz32,
                       .xyz64 = (double *)faces->xyz64,
                       .faces = (uint32_t *)faces->faces };
    return ebpo_mesh_write_ply(&mesh, path, error) == EBPO_OK;
}

static void report(const ebpo_file *file, const ebpo_subtree_nodes *nodes,
                   const ebpo_subtree_faces *faces)
{
    ebpo_file_stats stats = EBPO_FILE_STATS_INIT;
    ebpo_file_get_stats(file, &stats);
    printf("node %" PRIu64 " of level %d: %" PRIu64 " nodes below it, %" PRIu64 " faces, %" PRIu64
           " of them shared with subtrees before it; %" PRIu64 " of %" PRIu64 " bytes read\n",
           nodes->octcodes[0], nodes->level, nodes->node_count - 1, faces->face_count,
           faces->shared_count, stats.bytes_read, ebpo_file_info(file)->file_bytes);
}

int main(int argc, char **argv)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    ebpo_subtree *subtree = NULL;
    ebpo_subtree_options options = EBPO_SUBTREE_OPTIONS_INIT;
    ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
    ebpo_subtree_faces faces = EBPO_SUBTREE_FACES_INIT;
    double point[3];
    if (argc < 7) {
        fprintf(stderr, "usage: draw_around FILE.ebpo.h5|URL X Y Z LEVEL OUT.ply\n");
        return 2;
    }
    for (int k = 0; k < 3; k++)
        point[k] = strtod(argv[2 + k], NULL);
    options.parts = EBPO_PART_MESH; /* only the mesh, without envelopes and source indices */
    /* in bytes; the result is EBPO_E_LIMIT if the cell of LEVEL needs more */
    options.memory = UINT64_C(1) << 30;
    options.or_leaf_above = true;
    if (ebpo_open(argv[1], &file, &error) != EBPO_OK)
        goto done;
    uint64_t octcode = ebpo_octcode_at(ebpo_file_info(file), point, atoi(argv[5]));
    if (octcode == 0) {
        fprintf(stderr, "draw_around: the point is outside the model's box, or LEVEL is invalid\n");
        ebpo_close(file);
        return 1;
    }
    if (ebpo_subtree_open(file, octcode, &options, &subtree, &error) == EBPO_OK &&
        ebpo_subtree_get_nodes(subtree, &nodes) == EBPO_OK &&
        ebpo_subtree_get_faces(subtree, &faces, &error) == EBPO_OK &&
        write_faces(&faces, argv[6], &error))
        report(file, &nodes, &faces);
done:
    if (error.status != EBPO_OK)
        fprintf(stderr, "draw_around: %s\n", error.message);
    ebpo_subtree_close(subtree);
    ebpo_close(file);
    return error.status != EBPO_OK;
}
