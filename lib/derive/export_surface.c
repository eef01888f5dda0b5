/* Exports the simplified surface as GLB: the surface of a level, or the surface with the least
 * error that has at most a given number of triangles.
 *
 * Positions are stored on a grid that has 2^16 steps along each axis of the root cell. This grid
 * contains the grids of patches of levels 0 to 6, so the vertices of these patches are stored
 * exactly. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "derive/export_job.h"
#include "derive/gltf_surface.h"
#include "geometry/cells.h"
#include "io/publish.h"

enum { GRID_BITS = 16 };

/* The patches of a file, and the patches to export. A patch is the simplified surface of a node. */
typedef struct choice {
    ebpo_surface table; /* only `patch` and the counts are read */
    uint64_t *child;    /* [patch_count + 1] index of each patch's first child; ascending */
    uint64_t *patch;    /* [count] indices of the patches to export; ascending */
    uint64_t count;
    int level; /* deepest level of a patch in `patch` */
} choice;

static const uint64_t *row_of(const choice *c, uint64_t patch)
{
    return c->table.patch + EBPO_PATCH_COLUMNS * patch;
}

static ebpo_octcode octcode_of(const choice *c, uint64_t patch)
{
    return row_of(c, patch)[EBPO_PATCH_OCTCODE];
}

/* Finds the first child of each patch. Patches ascend by octcode (locational code), so the children
 * of successive patches also ascend. */
static ebpo_status find_children(choice *c, ebpo_error *error)
{
    uint64_t child = 1;
    c->child = ebpo_alloc(c->table.patch_count + 1, sizeof *c->child);
    if (!c->child)
        return ebpo_fail_memory(error, c->table.patch_count * sizeof *c->child);
    for (uint64_t i = 0; i < c->table.patch_count; i++) {
        while (child < c->table.patch_count &&
               ebpo_octcode_parent(octcode_of(c, child)) < octcode_of(c, i))
            child++;
        c->child[i] = child;
    }
    c->child[c->table.patch_count] = c->table.patch_count;
    return EBPO_OK;
}

static bool is_divided(const choice *c, uint64_t patch)
{
    uint64_t child = c->child[patch];
    return child < c->table.patch_count &&
           ebpo_octcode_parent(octcode_of(c, child)) == octcode_of(c, patch);
}

/* Chooses the coarsest patches with at most this error. In a region where no patch has so small an
 * error, the finest patch is chosen. Returns the number of triangles of the chosen patches.
 * `replaced`: [patch_count] scratch. */
static uint64_t choose_by_error(choice *c, uint64_t error, uint8_t *replaced)
{
    uint64_t triangles = 0;
    c->count = 0;
    memset(replaced, 0, c->table.patch_count);
    for (uint64_t i = 0, parent = 0; i < c->table.patch_count; i++) {
        while (i && octcode_of(c, parent) < ebpo_octcode_parent(octcode_of(c, i)))
            parent++;
        if (i && !replaced[parent])
            continue;
        replaced[i] = row_of(c, i)[EBPO_PATCH_ERROR] > error && is_divided(c, i);
        if (replaced[i])
            continue;
        c->patch[c->count++] = i;
        triangles += row_of(c, i)[EBPO_PATCH_TRIANGLES];
    }
    return triangles;
}

static int compare_numbers(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Chooses patches that have at most `most` triangles together, with the least error. */
static ebpo_status choose_by_triangles(choice *c, uint64_t most, ebpo_error *error)
{
    uint64_t count = c->table.patch_count, low = 0, high = count - 1;
    uint64_t *errors = ebpo_alloc(count, sizeof *errors);
    uint8_t *replaced = ebpo_alloc(count, 1);
    c->patch = ebpo_alloc(count, sizeof *c->patch);
    ebpo_status status = errors && replaced && c->patch
                             ? EBPO_OK
                             : ebpo_fail_memory(error, count * 2 * sizeof *errors);
    if (status == EBPO_OK && row_of(c, 0)[EBPO_PATCH_TRIANGLES] > most)
        status =
            ebpo_fail(error, EBPO_E_ARGUMENT,
                      "the coarsest surface of this file has %llu triangles; request at least as "
                      "many",
                      (unsigned long long)row_of(c, 0)[EBPO_PATCH_TRIANGLES]);
    if (status == EBPO_OK) {
        for (uint64_t i = 0; i < count; i++)
            errors[i] = row_of(c, i)[EBPO_PATCH_ERROR];
        qsort(errors, count, sizeof *errors, compare_numbers);
        while (low < high) { /* with the greatest error, only the root's patch is chosen */
            uint64_t middle = low + (high - low) / 2;
            if (choose_by_error(c, errors[middle], replaced) <= most)
                high = middle;
            else
                low = middle + 1;
        }
        (void)choose_by_error(c, errors[high], replaced);
    }
    free(errors);
    free(replaced);
    return status;
}

static ebpo_status choose_patches(choice *c, const ebpo_export_options *o, ebpo_error *error)
{
    ebpo_status status = find_children(c, error);
    if (status != EBPO_OK)
        return status;
    status = o->triangles
                 ? choose_by_triangles(c, o->triangles, error)
                 : ebpo_surface_select(&c->table, o->last_level, &c->patch, &c->count, error);
    for (uint64_t i = 0; i < c->count && status == EBPO_OK; i++) {
        int level = ebpo_octcode_level(octcode_of(c, c->patch[i]));
        c->level = level > c->level ? level : c->level;
    }
    return status;
}

/* Writes the joined patches. */
static ebpo_status write_mesh(const ebpo_export_job *job, ebpo_publish *publish,
                              const ebpo_surface_mesh *mesh, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(job->file);
    ebpo_gltf_surface s = { .vertex_count = mesh->mesh.vertex_count,
                            .triangle_count = mesh->mesh.face_count,
                            .triangles = mesh->mesh.faces,
                            .xyz = mesh->mesh.xyz64,
                            .normals = mesh->normals,
                            .colours = mesh->colours.vertex,
                            .colour_bytes = 4,
                            .name = "surface" };
    ebpo_gltf_written written;
    FILE *f = ebpo_publish_stream(publish);
    if (!f)
        return ebpo_fail_memory(error, BUFSIZ);
    if (!mesh->mesh.face_count)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, job->path, "it would contain no triangle");
    for (int k = 0; k < 3; k++) {
        s.step[k] = info->box_size[k] / (1 << GRID_BITS);
        s.grid[k] = info->box_origin[k];
    }
    ebpo_status status = ebpo_gltf_surface_write(f, job->path, &s, &written, error);
    if (status != EBPO_OK)
        return status;
    if (ferror(f) || fflush(f) != 0)
        return ebpo_fail_errno(error, job->path, "could not be written");
    job->report->block[0].vertices = written.vertices;
    job->report->largest_change = written.change;
    job->report->error = mesh->error + written.change;
    job->report->bytes = written.bytes;
    return ebpo_publish_commit(publish, error);
}

static ebpo_status export_patches(const ebpo_export_job *job, choice *c, ebpo_publish *publish,
                                  ebpo_error *error)
{
    ebpo_surface surface = { 0 };
    ebpo_surface_mesh mesh = { 0 };
    ebpo_status status = ebpo_file_read_patches(job->file, &c->table, error);
    if (status == EBPO_OK)
        status = choose_patches(c, job->options, error);
    if (status == EBPO_OK && !ebpo_progress_step(&job->options->progress, "exporting", 0, 1, error))
        status = EBPO_E_CANCELLED;
    if (status == EBPO_OK) /* patches of levels 0 to c->level come first in the table */
        status = ebpo_file_read_surface(job->file, 0, c->level, &surface, error);
    if (status == EBPO_OK)
        status = ebpo_surface_join(&surface, ebpo_file_info(job->file), c->patch, c->count, &mesh,
                                   error);
    if (status == EBPO_OK) {
        job->report->block_count = 1;
        job->report->block[0] =
            (ebpo_export_block){ c->level, c->count, mesh.mesh.face_count, mesh.mesh.face_count,
                                 0,        0 };
        job->report->vertex_colours =
            mesh.colours.vertex ? EBPO_EXPORT_WRITTEN : EBPO_EXPORT_NO_COLOURS;
        status = write_mesh(job, publish, &mesh, error);
    }
    ebpo_surface_mesh_free(&mesh);
    ebpo_surface_free(&surface);
    return status;
}

ebpo_status ebpo_export_surface(const ebpo_export_job *job, ebpo_error *error)
{
    ebpo_publish publish = EBPO_PUBLISH_INIT;
    choice c = { .count = 0 };
    ebpo_status status = ebpo_publish_begin(&publish, job->path, error);
    if (status == EBPO_OK)
        status = export_patches(job, &c, &publish, error);
    ebpo_publish_abort(&publish);
    ebpo_surface_free(&c.table);
    free(c.child);
    free(c.patch);
    return status;
}
