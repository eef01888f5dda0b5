/* A lattice's distances as a file, which appears whole or not at all. */
#include "core/strict_fp.h"

#include <stdlib.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "io/publish.h"
#include "extras/map/map_file.h"
#include "extras/map/map_sums.h"

typedef struct writing {
    ebpo_map_file file;
    ebpo_map_format format;
    ebpo_map_sums *sums;
} writing;

static ebpo_status take_layers(void *user, const double *values, uint64_t first, uint64_t layers,
                               ebpo_error *error)
{
    writing *w = user;
    const ebpo_lattice *l = w->file.lattice;
    ebpo_map_sums_add(w->sums, values, layers * l->count[0] * l->count[1]);
    return w->format == EBPO_MAP_NRRD
               ? ebpo_map_nrrd_layers(&w->file, values, first, layers, error)
               : ebpo_map_vtkhdf_layers(&w->file, values, first, layers, error);
}

static ebpo_status begin(writing *w, ebpo_publish *publish, ebpo_error *error)
{
    w->file.shown = publish->shown;
    w->file.path = ebpo_publish_path(publish);
    if (w->format != EBPO_MAP_NRRD)
        return ebpo_map_vtkhdf_begin(&w->file, error);
    w->file.stream = ebpo_publish_stream(publish);
    return w->file.stream ? ebpo_map_nrrd_begin(&w->file, error) : ebpo_fail_memory(error, 4096);
}

ebpo_status ebpo_map_write(ebpo_model *model, const ebpo_lattice *lattice, const char *path,
                           ebpo_map_format format, const ebpo_map_options *options,
                           ebpo_map_stats *stats, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    writing w = { .file = { .lattice = lattice, .out = EBPO_H5_OUT_INIT, .values = -1 },
                  .format = format,
                  .sums = ebpo_map_sums_new() };
    ebpo_publish publish = EBPO_PUBLISH_INIT;
    ebpo_status status = w.sums ? EBPO_OK : ebpo_fail_memory(error, sizeof *w.sums);
    if (status == EBPO_OK && stats)
        status = EBPO_CHECK_SIZED(ebpo_map_stats, stats, error);
    if (status == EBPO_OK && format != EBPO_MAP_NRRD && format != EBPO_MAP_VTKHDF)
        status = ebpo_fail(error, EBPO_E_ARGUMENT, "this is no format of maps");
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&publish, path, error);
    if (status == EBPO_OK)
        status = begin(&w, &publish, error);
    if (status == EBPO_OK)
        status = ebpo_map_lattice(model, lattice, options, take_layers, &w, error);
    if (status == EBPO_OK && format != EBPO_MAP_NRRD)
        status = ebpo_map_vtkhdf_end(&w.file, error);
    ebpo_h5_close_id(&w.file.out, w.file.values);
    ebpo_h5_discard(&w.file.out);
    if (status == EBPO_OK)
        status = ebpo_publish_commit(&publish, error);
    ebpo_publish_abort(&publish);
    if (status == EBPO_OK && stats) {
        ebpo_map_stats filled = ebpo_map_sums_stats(w.sums);
        status = EBPO_GIVE(ebpo_map_stats, stats, &filled);
    }
    free(w.sums);
    return status;
}
