/* Proves a file's promises. Of the builder's geometry only the exact predicates are used: cells,
 * half-spaces and clipping are done here in another way. */
#include "verify/verify_parts.h"

#include "core/error.h"
#include "core/fp_env.h"
#include "mesh/mesh_parts.h"
#include "verify/nesting.h"
#include "verify/verify_colours.h"
#include "verify/verify_source.h"
#include "verify/verify_subtrees.h"
#include "verify/structure.h"
#include "verify/verify_walk.h"

/* `file`: where the tree is from, or NULL. */
static ebpo_status verify_tree_of(ebpo_tally *tally, const ebpo_file *file, const ebpo_tree *tree,
                                  const ebpo_verify_options *options, ebpo_error *error)
{
    if (!ebpo_check_shape(tally, tree))
        return EBPO_OK;
    ebpo_twin_tree view;
    ebpo_status status = ebpo_twin_make(&view, tree, options->workspace, error);
    if (status != EBPO_OK)
        return status;
    ebpo_check_structure(tally, &view);
    ebpo_check_nesting(tally, &view);
    status = ebpo_check_colours(tally, &view, error);
    if (status == EBPO_OK)
        status = ebpo_verify_walk(tally, &view, options, error);
    if (status == EBPO_OK && file)
        status = ebpo_check_subtrees(tally, file, &view, options, error);
    if (status == EBPO_OK && file)
        status = ebpo_check_gates(tally, file, tree, error);
    ebpo_twin_free(&view);
    return status;
}

ebpo_status ebpo_verify_tree(ebpo_tally *tally, const ebpo_tree *tree,
                             const ebpo_verify_options *options, ebpo_error *error)
{
    return verify_tree_of(tally, NULL, tree, options, error);
}

/* A failure that says something about the file and not about this machine or call. */
static bool is_finding(ebpo_status status)
{
    return status == EBPO_E_FORMAT || status == EBPO_E_VERSION || status == EBPO_E_LIMIT;
}

static ebpo_read_options reading(const ebpo_verify_options *options)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.threads = options->threads;
    read.workspace = options->workspace;
    return read;
}

static ebpo_status check_content(const ebpo_file *file, const ebpo_verify_options *options,
                                 ebpo_tally *tally, ebpo_error *error)
{
    ebpo_error own = EBPO_ERROR_INIT;
    ebpo_read_options read = reading(options);
    ebpo_status status = ebpo_file_check_content(file, &read, &own);
    if (status == EBPO_OK || is_finding(status)) {
        ebpo_tally_check(tally, EBPO_VERIFY_CONTENT, status == EBPO_OK, "%s", own.message);
        return EBPO_OK;
    }
    return ebpo_fail_with(error, &own);
}

static ebpo_status check_tree(const ebpo_file *file, const ebpo_verify_options *options,
                              ebpo_tally *tally, ebpo_error *error)
{
    ebpo_error own = EBPO_ERROR_INIT;
    ebpo_read_options read = reading(options);
    ebpo_tree tree = { 0 };
    ebpo_status status = ebpo_file_read_tree(file, &read, &tree, &own);
    if (status == EBPO_OK || is_finding(status))
        ebpo_tally_check(tally, EBPO_VERIFY_STRUCTURE, status == EBPO_OK, "%s", own.message);
    if (status == EBPO_OK) {
        status = verify_tree_of(tally, file, &tree, options, error);
        ebpo_tree_free(&tree);
        return status;
    }
    return is_finding(status) ? EBPO_OK : ebpo_fail_with(error, &own);
}

static ebpo_status check_source(const ebpo_file *file, const ebpo_verify_options *options,
                                ebpo_tally *tally, ebpo_error *error)
{
    ebpo_error own = EBPO_ERROR_INIT;
    ebpo_read_options read = reading(options);
    read.attributes = options->source->attributes != NULL;
    ebpo_mesh stored;
    bool ordered = false;
    if (ebpo_file_info(file)->pruned)
        return ebpo_check_source(tally, file, NULL, false, options->source, &read, error);
    ebpo_status status = ebpo_file_read_source_mesh(file, &read, &stored, &ordered, &own);
    if (is_finding(status)) {
        ebpo_tally_check(tally, EBPO_VERIFY_SOURCE, false, "%s", own.message);
        return EBPO_OK;
    }
    if (status != EBPO_OK)
        return ebpo_fail_with(error, &own);
    status = ebpo_check_source(tally, file, &stored, ordered, options->source, &read, error);
    ebpo_mesh_free(&stored);
    return status;
}

ebpo_status ebpo_verify(const ebpo_file *file, const ebpo_verify_options *options,
                        ebpo_verify_report *report, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_verify_options wanted = EBPO_VERIFY_OPTIONS_INIT;
    ebpo_verify_report found = EBPO_VERIFY_REPORT_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_verify_report, report, error);
    if (status == EBPO_OK)
        status = EBPO_TAKE(ebpo_verify_options, &wanted, options, error);
    if (status != EBPO_OK)
        return status;
    EBPO_GIVE(ebpo_verify_report, report, &found);
    options = &wanted;
    if (!file)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "verify: no file; open one with ebpo_open");
    if (options->source) {
        ebpo_status shape = ebpo_mesh_check_shape(options->source, error);
        if (shape != EBPO_OK)
            return shape;
        if (options->source->arrangement)
            return ebpo_fail(
                error, EBPO_E_ARGUMENT,
                "verify: the source has been arranged (ebpo_mesh_arrange); give it as it was read");
    }
    ebpo_tally tally = { 0 };
    status = ebpo_check_places(&tally, file, options, error);
    /* where chunks lie elsewhere than the list says, sums tell nothing more */
    if (status == EBPO_OK && tally.violations[EBPO_VERIFY_STRUCTURE] == 0)
        status = ebpo_check_sums(&tally, file, error);
    if (status == EBPO_OK)
        status = check_content(file, options, &tally, error);
    if (status == EBPO_OK)
        status = check_tree(file, options, &tally, error);
    if (status == EBPO_OK && options->source)
        status = check_source(file, options, &tally, error);
    if (status == EBPO_OK)
        status = ebpo_count_spare(file, &options->progress, &found.spare_bytes, &found.spare_filled,
                                  error);
    if (status == EBPO_OK)
        ebpo_tally_report(&tally, &found);
    EBPO_GIVE(ebpo_verify_report, report, &found);
    return status;
}
