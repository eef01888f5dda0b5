/* Choosing by size: the file's size falls as max_error grows, so the least max_error that fits is
 * found by trying. Coarse files come first, as they are small and quick to make; what is known of
 * envelopes serves all trials. The best file that fitted is kept and published, so what was
 * measured is what is there. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <sys/stat.h>

#include "core/error.h"
#include "format/reader.h"
#include "format/write_file.h"
#include "io/publish.h"
#include "derive/subset_parts.h"

/* below that share of the coarsest nothing but the whole is tried */
static const double precision = 1.01, finest = 0x1p-40;

typedef struct fitting {
    const ebpo_file *file;
    ebpo_subset_options *options;
    ebpo_publish trial, best; /* best: the finest that fitted, once there is one */
    ebpo_tolerance *need;
    double fits, too_large;          /* max_error */
    uint64_t fit_bytes, large_bytes; /* and the sizes with these */
    ebpo_error *error;
} fitting;

/* Bytes of the file for a max_error, which is the best if it fits, as each is finer than those that
 * fitted before; *pruned: max_error has made a difference. */
static ebpo_status try_error(fitting *f, double max_error, uint64_t *bytes, bool *pruned)
{
    ebpo_tree tree;
    struct stat st;
    ebpo_subset_options o = *f->options;
    o.max_error = max_error;
    ebpo_status status = ebpo_subset_tree_within(&tree, f->file, &o, f->need, f->error);
    if (status != EBPO_OK)
        return status;
    *pruned = tree.info.pruned;
    ebpo_write_options write = ebpo_subset_write_options(&o);
    status =
        ebpo_tree_write_into(&tree, ebpo_publish_path(&f->trial), f->trial.shown, &write, f->error);
    ebpo_tree_free(&tree);
    if (status == EBPO_OK && stat(ebpo_publish_path(&f->trial), &st) != 0)
        status =
            ebpo_fail_errno(f->error, f->trial.shown, "the file in the making cannot be looked at");
    if (status != EBPO_OK)
        return status;
    *bytes = (uint64_t)st.st_size;
    if (*bytes <= f->options->target_bytes) {
        ebpo_publish other = f->best;
        f->best = f->trial;
        f->trial = other;
    }
    return EBPO_OK;
}

/* From the coarsest file on, until one is too large or nothing is pruned any more (*pruned false).
 * `too_large` stays 0 when none is. */
static ebpo_status bracket_size(fitting *f, bool *pruned)
{
    uint64_t bytes = 0;
    double coarsest = 0;
    ebpo_status status = ebpo_tolerance_most(f->need, &coarsest, f->error);
    *pruned = true;
    if (status == EBPO_OK)
        status = try_error(f, coarsest, &bytes, pruned);
    if (status == EBPO_OK && bytes > f->options->target_bytes)
        return ebpo_fail_file(f->error, EBPO_E_ARGUMENT, f->file->in.shown,
                              "no subset with these parts has at most %" PRIu64
                              " bytes; the least has %" PRIu64,
                              f->options->target_bytes, bytes);
    f->fits = coarsest;
    f->fit_bytes = bytes;
    f->too_large = 0;
    for (double e = coarsest / 2;
         status == EBPO_OK && *pruned && f->too_large == 0 && e > coarsest * finest; e /= 2) {
        status = try_error(f, e, &bytes, pruned);
        bool fits = bytes <= f->options->target_bytes;
        *(fits ? &f->fits : &f->too_large) = e;
        *(fits ? &f->fit_bytes : &f->large_bytes) = bytes;
    }
    return status;
}

/* Sizes go about straight from one end to the other, which are a factor of 2 apart: halfway between
 * that guess and the middle, so that neither end stays for long. No functions of libm, as the
 * result is stored. */
static double next_guess(const fitting *f)
{
    double share = .5;
    if (f->large_bytes > f->fit_bytes)
        share = (double)(f->large_bytes - f->options->target_bytes) /
                (double)(f->large_bytes - f->fit_bytes);
    share = .5 * share + .25;
    return f->too_large + share * (f->fits - f->too_large);
}

static ebpo_status find_error(fitting *f)
{
    uint64_t bytes = 0;
    bool pruned = false;
    /* With less than a quarter of the source wanted, it is hardly worth writing everything. */
    bool may_fit =
             !f->options->choose_parts && f->options->target_bytes >= f->file->info.file_bytes / 4,
         tried = f->options->choose_parts || may_fit;
    ebpo_status status = may_fit ? try_error(f, 0, &bytes, &pruned) : EBPO_OK;
    if (status != EBPO_OK || (may_fit && bytes <= f->options->target_bytes))
        return status;
    status = bracket_size(f, &pruned);
    /* Envelopes that coincide with the solid are pruned for any max_error. */
    if (status == EBPO_OK && f->too_large == 0 && pruned && !tried)
        return try_error(f, 0, &bytes, &pruned);
    while (status == EBPO_OK && f->too_large > 0 && f->fits > precision * f->too_large) {
        double e = next_guess(f);
        if (!(e > f->too_large) || !(e < f->fits))
            break;
        status = try_error(f, e, &bytes, &pruned);
        bool fits = bytes <= f->options->target_bytes;
        *(fits ? &f->fits : &f->too_large) = e;
        *(fits ? &f->fit_bytes : &f->large_bytes) = bytes;
    }
    return status;
}

/* The profiles of which the file has all, from the largest on. */
static ebpo_status choose_parts(fitting *f, bool *found)
{
    static const ebpo_profile order[] = { EBPO_PROFILE_FULL, EBPO_PROFILE_COLLISION,
                                          EBPO_PROFILE_LOD };
    ebpo_status status = EBPO_OK;
    *found = false;
    for (size_t i = 0; i < sizeof order / sizeof *order && status == EBPO_OK && !*found; i++) {
        uint64_t bytes = 0;
        bool pruned = false;
        f->options->parts = ebpo_profile_parts(order[i]);
        status = try_error(f, 0, &bytes, &pruned);
        *found = status == EBPO_OK && bytes <= f->options->target_bytes;
    }
    return status;
}

ebpo_status ebpo_subset_fit(const ebpo_file *file, const char *path, ebpo_subset_options *options,
                            ebpo_error *error)
{
    fitting f = { .file = file,
                  .options = options,
                  .trial = EBPO_PUBLISH_INIT,
                  .best = EBPO_PUBLISH_INIT,
                  .error = error };
    bool done = false;
    if (options->max_error != 0)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, file->in.shown,
                              "a maximum error and a target size exclude each other");
    ebpo_status status = ebpo_publish_begin(&f.trial, path, error);
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&f.best, path, error);
    if (status == EBPO_OK && options->choose_parts)
        status = choose_parts(&f, &done);
    if (status == EBPO_OK && !done)
        status = ebpo_tolerance_open(&f.need, file, options->parts & EBPO_PART_PLANES,
                                     options->threads, options->progress, error);
    if (status == EBPO_OK && !done)
        status = find_error(&f);
    ebpo_tolerance_close(f.need);
    if (status == EBPO_OK) {
        ebpo_publish_expect_input(&f.best, &file->in);
        status = ebpo_publish_commit(&f.best, error);
    }
    ebpo_publish_abort(&f.best);
    ebpo_publish_abort(&f.trial);
    return status;
}
