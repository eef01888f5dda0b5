/* Exports the simplified surface, and the model's faces, as 3D Tiles 1.1.
 *
 * A patch simplifies the faces below one node of the octree, and becomes a tile. The patches of the
 * node's children become the tile's children. Viewers replace the tile by its children (REPLACE).
 * If the mesh is exported, a patch without patches below has one child: a tile with the model's
 * faces that the patch simplifies (except in a subset by a box). Tiles are written one after the
 * other, and then tileset.json. The table of patches, the bounds of all tiles, and one tile are in
 * memory. A tile's geometricError is the greatest of the certified errors of this tile and the
 * tiles below, because readers expect that children have no greater error.
 *
 * Coordinates are relative to an origin, which is the translation of the root tile. In glTF, y
 * points upwards, and readers of 3D Tiles turn y to z. So the glTF nodes of tiles first turn z to
 * y.
 *
 * Source: OGC, "3D Tiles Specification 1.1". */
#include "core/strict_fp.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "derive/export_job.h"
#include "derive/gltf_surface.h"
#include "format/patch_table.h"
#include "geometry/cells.h"
#include "levels/surface_mesh.h"

enum { CACHE_BYTES = 64 << 20 };

static const char TILESET[] = "tileset.json";

/* A tile; all lengths are in the model's unit. */
typedef struct tile {
    /* bounds of the content; include_children extends them to the tiles below */
    double min[3], max[3];
    double error;    /* geometricError of the tile */
    uint64_t number; /* number of the tile's file */
} tile;

typedef struct tiler {
    const ebpo_export_job *job;
    const ebpo_info *info;
    ebpo_chunks *chunks;
    ebpo_patch_table table;
    tile *patch; /* [table.count] tiles of the patches */
    tile *faces; /* [table.count] for patches without patches below: tiles of faces */
    double origin[3];
    char *folder;   /* path of the temporary folder */
    uint64_t files; /* number of tile files that may exist */
} tiler;

/* --- tiles --- */

/* Sets `out` to the path of a file in the folder. */
static ebpo_status name_file(const tiler *t, const char *name, char out[PATH_MAX],
                             ebpo_error *error)
{
    if (snprintf(out, PATH_MAX, "%s/%s", t->folder, name) < PATH_MAX)
        return EBPO_OK;
    return ebpo_fail_file(error, EBPO_E_IO, t->job->path,
                          "the path is too long; write to a folder with a shorter path");
}

/* Creates a file in the folder, and returns it as a stream. Sets *file to the stream's descriptor;
 * fclose closes the stream and the descriptor. */
static FILE *begin_file(const tiler *t, const char *name, int *file, ebpo_error *error)
{
    char path[PATH_MAX];
    if (name_file(t, name, path, error) != EBPO_OK)
        return NULL;
    *file = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    FILE *f = *file >= 0 ? fdopen(*file, "w+b") : NULL;
    if (!f)
        ebpo_fail_errno(error, t->job->path, "a file in the folder cannot be made");
    if (!f && *file >= 0)
        close(*file);
    return f;
}

/* Waits until the data of a file is on the disk, and closes the file. */
static ebpo_status end_file(const tiler *t, FILE *f, int file, ebpo_error *error)
{
    bool ok = !ferror(f) && fflush(f) == 0 && fsync(file) == 0;
    int saved = errno;
    if (fclose(f) == 0 && ok)
        return EBPO_OK;
    errno = ok ? errno : saved;
    return ebpo_fail_errno(error, t->job->path, "could not be written");
}

/* Writes a tile with the geometry and colours of `mesh`, and with the grid and name of `surface`.
 * Sets the bounds of the tile. Adds the greatest rounding error of a vertex to the error of the
 * tile. */
static ebpo_status write_tile(tiler *t, ebpo_gltf_surface *surface, const ebpo_surface_mesh *mesh,
                              tile *out, ebpo_error *error)
{
    static const uint32_t point[3] = { 0, 0, 0 }; /* the triangle of a patch that is a point */
    char name[40];
    ebpo_gltf_written written;
    bool is_point = mesh->mesh.face_count == 0;
    surface->vertex_count = mesh->mesh.vertex_count;
    surface->triangle_count = is_point ? 1 : mesh->mesh.face_count;
    surface->triangles = is_point ? point : mesh->mesh.faces;
    surface->xyz = mesh->mesh.xyz64;
    surface->normals = mesh->normals;
    surface->colours = mesh->colours.vertex;
    surface->colour_bytes = 4;
    surface->rotates = true;
    memcpy(surface->origin, t->origin, sizeof t->origin);
    out->number = t->files++;
    snprintf(name, sizeof name, "%" PRIu64 ".glb", out->number);
    int file;
    FILE *f = begin_file(t, name, &file, error);
    if (!f)
        return error ? error->status : EBPO_E_IO;
    ebpo_status status = ebpo_gltf_surface_write(f, t->job->path, surface, &written, error);
    if (status == EBPO_OK) {
        status = end_file(t, f, file, error);
    } else {
        fclose(f);
        return status;
    }
    memcpy(out->min, written.min, sizeof out->min);
    memcpy(out->max, written.max, sizeof out->max);
    out->error += written.change;
    t->job->report->bytes += written.bytes;
    t->job->report->tiles++;
    t->job->report->largest_change = fmax(t->job->report->largest_change, written.change);
    return status;
}

static ebpo_status write_patch(tiler *t, uint64_t i, ebpo_error *error)
{
    ebpo_surface_mesh mesh = { 0 };
    ebpo_gltf_surface surface = { .name = "patch" };
    int level = ebpo_octcode_level(t->table.row[EBPO_PATCH_COLUMNS * i + EBPO_PATCH_OCTCODE]);
    ebpo_status status = ebpo_table_join(&t->table, t->chunks, &i, 1, NULL, &mesh, error);
    if (status != EBPO_OK)
        return status;
    for (int k = 0; k < 3; k++) { /* uses the grid of the patch, so that no vertex moves */
        surface.step[k] = ldexp(t->info->box_size[k], -level - EBPO_PATCH_GRID);
        surface.grid[k] = t->info->box_origin[k];
    }
    t->patch[i].error = mesh.error;
    status = write_tile(t, &surface, &mesh, &t->patch[i], error);
    if (mesh.colours.vertex)
        t->job->report->vertex_colours = EBPO_EXPORT_WRITTEN;
    ebpo_surface_mesh_free(&mesh);
    return status;
}

static bool is_divided(const tiler *t, uint64_t i)
{
    return t->table.child_end[i] > t->table.child[i];
}

static bool has_faces(const tiler *t, uint64_t i)
{
    /* patches of a subset have the face numbers of the original file */
    return t->job->options->mesh && !t->info->pruned && !is_divided(t, i);
}

static ebpo_status write_faces(tiler *t, uint64_t i, ebpo_error *error)
{
    ebpo_patch faces = EBPO_PATCH_INIT;
    ebpo_surface_mesh mesh = { 0 };
    ebpo_gltf_surface surface = { .name = "faces" };
    ebpo_status status = ebpo_patch_faces_read(&t->table, t->chunks, &i, 1, &faces, error);
    if (status == EBPO_OK)
        status = ebpo_table_join(&t->table, t->chunks, NULL, 0, &faces, &mesh, error);
    if (status == EBPO_OK)
        status = write_tile(t, &surface, &mesh, &t->faces[i], error);
    ebpo_patch_free(&faces);
    ebpo_surface_mesh_free(&mesh);
    return status;
}

static void include_tile(tile *upper, const tile *below)
{
    for (int k = 0; k < 3; k++) {
        upper->min[k] = fmin(upper->min[k], below->min[k]);
        upper->max[k] = fmax(upper->max[k], below->max[k]);
    }
    upper->error = fmax(upper->error, below->error);
}

/* Extends the bounds of each tile, so that they contain the tiles below. Raises the error of each
 * tile to the greatest error of the tiles below, if that is greater. */
static void include_children(tiler *t)
{
    for (uint64_t i = t->table.count; i-- > 0;) {
        if (has_faces(t, i))
            include_tile(&t->patch[i], &t->faces[i]);
        for (uint64_t c = t->table.child[i]; c < t->table.child_end[i]; c++)
            include_tile(&t->patch[i], &t->patch[c]);
    }
}

static ebpo_status write_tiles(tiler *t, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < t->table.count && status == EBPO_OK; i++) {
        if (!ebpo_progress_step(&t->job->options->progress, "exporting", i, t->table.count, error))
            return EBPO_E_CANCELLED;
        status = write_patch(t, i, error);
        if (status == EBPO_OK && has_faces(t, i))
            status = write_faces(t, i, error);
    }
    return status;
}

/* --- the tileset --- */

/* Prints the members of a tile except its children. */
static void print_tile(FILE *f, const tile *shown)
{
    double box[12] = { 0 }, size = 0;
    for (int k = 0; k < 3; k++)
        size = fmax(size, shown->max[k] - shown->min[k]);
    for (int k = 0; k < 3; k++) {
        /* the box is not flat, and is not too small after rounding to float32 */
        double middle = (shown->min[k] + shown->max[k]) / 2,
               half = fmax(shown->max[k] - middle, middle - shown->min[k]);
        box[k] = middle;
        box[3 + 4 * k] = half + size * 0x1p-20 + fabs(middle) * 0x1p-22;
    }
    ebpo_json_numbers(f, "{\"boundingVolume\":{\"box\":", box, 12);
    fprintf(f, "},\"geometricError\":");
    ebpo_json_number(f, shown->error);
    fprintf(f, ",\"content\":{\"uri\":\"%" PRIu64 ".glb\"}", shown->number);
}

static void print_subtree(FILE *f, const tiler *t, uint64_t i)
{
    print_tile(f, &t->patch[i]);
    if (i == 0) {
        double at[16] = {
            1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, t->origin[0], t->origin[1], t->origin[2], 1
        };
        ebpo_json_numbers(f, ",\"refine\":\"REPLACE\",\"transform\":", at, 16);
    }
    if (is_divided(t, i) || has_faces(t, i))
        fprintf(f, ",\"children\":[\n");
    if (has_faces(t, i)) {
        print_tile(f, &t->faces[i]);
        fputc('}', f);
    }
    for (uint64_t c = t->table.child[i]; c < t->table.child_end[i]; c++) {
        if (c > t->table.child[i])
            fprintf(f, ",\n");
        print_subtree(f, t, c); /* at most EBPO_PATCH_LEVEL deep */
    }
    fprintf(f, is_divided(t, i) || has_faces(t, i) ? "]}" : "}");
}

static ebpo_status write_tileset(tiler *t, ebpo_error *error)
{
    double diagonal = 0;
    for (int k = 0; k < 3; k++)
        diagonal += t->info->box_size[k] * t->info->box_size[k];
    diagonal = fmax(sqrt(diagonal), t->patch[0].error);
    int file;
    FILE *f = begin_file(t, TILESET, &file, error);
    if (!f)
        return error ? error->status : EBPO_E_IO;
    fprintf(f,
            "{\"asset\":{\"version\":\"1.1\",\"generator\":\"ebpo %s\"},\n"
            "\"extensionsUsed\":[\"3DTILES_content_gltf\"],\n"
            "\"extensions\":{\"3DTILES_content_gltf\":{\"extensionsUsed\":"
            "[\"KHR_mesh_quantization\",\"EXT_meshopt_compression\"],\"extensionsRequired\":"
            "[\"KHR_mesh_quantization\",\"EXT_meshopt_compression\"]}},\n",
            ebpo_version());
    fprintf(f, "\"geometricError\":");
    ebpo_json_number(f, diagonal);
    fprintf(f, ",\n\"root\":");
    print_subtree(f, t, 0);
    fprintf(f, "}\n");
    long bytes = ftell(f);
    t->job->report->bytes += bytes > 0 ? (uint64_t)bytes : 0;
    return end_file(t, f, file, error);
}

/* --- the folder --- */

static void remove_folder(const tiler *t)
{
    char name[40], path[PATH_MAX];
    for (uint64_t i = 0; i < t->files; i++) {
        snprintf(name, sizeof name, "%" PRIu64 ".glb", i);
        if (name_file(t, name, path, NULL) == EBPO_OK)
            unlink(path);
    }
    if (name_file(t, TILESET, path, NULL) == EBPO_OK)
        unlink(path);
    rmdir(t->folder);
}

static ebpo_status write_folder(tiler *t, ebpo_error *error)
{
    ebpo_status status = ebpo_patch_table_read(&t->table, t->chunks, error);
    if (status != EBPO_OK)
        return status;
    t->patch = ebpo_alloc_zero(t->table.count, sizeof *t->patch);
    t->faces = ebpo_alloc_zero(t->table.count, sizeof *t->faces);
    if (!t->patch || !t->faces)
        return ebpo_fail_memory(error, 2 * t->table.count * sizeof *t->patch);
    status = ebpo_folder_begin(t->job->path, &t->folder, error);
    if (status == EBPO_OK)
        status = write_tiles(t, error);
    if (status == EBPO_OK) {
        include_children(t);
        t->job->report->error = t->patch[0].error;
        status = write_tileset(t, error);
    }
    if (status == EBPO_OK)
        status = ebpo_folder_publish(t->folder, t->job->path, error);
    if (status != EBPO_OK && t->folder)
        remove_folder(t);
    return status;
}

ebpo_status ebpo_export_tiles(const ebpo_export_job *job, ebpo_error *error)
{
    tiler t = { .job = job, .info = ebpo_file_info(job->file) };
    if (job->options->mesh && !(t.info->parts & EBPO_PART_MESH))
        return ebpo_fail_file(error, EBPO_E_ABSENT, job->path,
                              "faces are requested, and the file was written without its mesh");
    ebpo_choose_origin(t.info, t.origin);
    memcpy(job->report->origin, t.origin, sizeof t.origin);
    ebpo_status status = ebpo_chunks_make(&t.chunks, job->file, CACHE_BYTES, error);
    if (status == EBPO_OK)
        status = write_folder(&t, error);
    ebpo_patch_table_free(&t.table);
    ebpo_chunks_free(t.chunks);
    free(t.patch);
    free(t.faces);
    free(t.folder);
    return status;
}
