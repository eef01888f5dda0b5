/* Builds the tree of a mesh: runs the stages that builder.h lists, in order, and fills in the
 * result's ebpo_info.
 *
 * This file checks options and chooses the deepest level (EBP 2017, equation 3). The tree is cut
 * into pieces, which are subtrees, and the top, which is the set of the nodes above the pieces. In
 * the code, the top and each piece are an `ebpo_branch`: `b->top` and `b->piece[i]` (builder.h).
 * Several threads process the pieces, one piece per thread at a time. The envelopes of a piece are
 * computed from the envelope of the parent of the piece's root, so the envelopes of the top are
 * computed first. A selection chooses the planes of the envelopes. If the selection works from the
 * leaves up, the planes of all nodes are chosen before any envelope is computed. ebpo_build takes
 * over the mesh and frees it, also on failure. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "construct/arrange.h"
#include "mesh/attributes.h"
#include "core/alloc.h"
#include "core/os.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "format/border_loops.h"
#include "construct/pieces.h"
#include "construct/planes.h"
#include "construct/capped.h"
#include "construct/construct_stages.h"
#include "construct/supports.h"
#include "construct/thesis_levels.h"
#include "ebpo_config.h"

/* Implements EBP 2017, equation 3. Returns the least i >= 1 for which the longest side of the
 * mesh's bounding box, divided by 2^i, is less than the mean length of the edges. */
static int level_limit(const ebpo_mesh_report *report)
{
    double side = 0;
    for (int k = 0; k < 3; k++)
        side = fmax(side, report->max[k] - report->min[k]);
    int level = 1;
    for (side /= 2; level < EBPO_MAX_LEVEL && !(side < report->mean_edge); side /= 2)
        level++;
    return level;
}

/* Returns an error if a text option has control characters, or is too long for its field of
 * ebpo_info. `capacity`: bytes of this field. */
static ebpo_status check_text(const char *name, const char *text, size_t capacity,
                              ebpo_error *error)
{
    if (!text)
        return EBPO_OK;
    if (strlen(text) >= capacity)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "%s is longer than %zu bytes", name, capacity - 1);
    for (const unsigned char *c = (const unsigned char *)text; *c; c++)
        if (*c < 32 || *c == 127)
            return ebpo_fail(error, EBPO_E_ARGUMENT, "%s contains a control character", name);
    return EBPO_OK;
}

static ebpo_status check_options(const ebpo_build_options *o, const ebpo_info *info,
                                 ebpo_error *error)
{
    if (o->max_level < -1 || o->max_level > EBPO_MAX_LEVEL)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "max_level %d is not in 0 .. %d", o->max_level,
                         EBPO_MAX_LEVEL);
    if (!(o->epsilon >= 0) || o->epsilon > 1)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "epsilon %g is not in 0 .. 1", o->epsilon);
    if (o->rule > EBPO_RULE_POSITIVE)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "unknown winding rule %d; give a value of ebpo_rule", (int)o->rule);
    if (!ebpo_selection_function(o->select))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "unknown selection %d of planes; give a value of ebpo_selection",
                         (int)o->select);
    if (!(o->percent > 0 && o->percent <= 100))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "percent %g is not above 0 and at most 100",
                         o->percent);
    if (!(o->k_root == 0 || (o->k_root >= 1 && o->k_root <= 1e9)))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "k_root %g is neither 0 nor in 1 .. 1e9",
                         o->k_root);
    if ((unsigned)o->normals > EBPO_NORMALS_ANGLE)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "unknown distance of normals %d; give a value of ebpo_normal_distance",
                         (int)o->normals);
    ebpo_status status = check_text("unit", o->unit, sizeof info->unit, error);
    if (status == EBPO_OK)
        status = check_text("crs", o->crs, sizeof info->crs, error);
    if (status == EBPO_OK)
        status = check_text("date", o->date, sizeof info->date, error);
    return status;
}

static void copy_text(char *to, const char *from)
{
    if (from)
        strcpy(to, from); /* check_options checked the length */
}

/* Copies the name of the source file. Names of files may contain any bytes, but the format requires
 * text: a byte that is neither printable ASCII nor part of a valid UTF-8 sequence becomes "_". */
static void copy_name(char *to, const char *from)
{
    while (*from) {
        const unsigned char *c = (const unsigned char *)from;
        int length = c[0] < 0x80                   ? 1
                     : c[0] >= 0xc2 && c[0] < 0xe0 ? 2
                     : c[0] >= 0xe0 && c[0] < 0xf0 ? 3
                     : c[0] >= 0xf0 && c[0] < 0xf5 ? 4
                                                   : 0;
        bool valid = length > 0 && c[0] >= 32 && c[0] != 127;
        for (int i = 1; i < length && valid; i++)
            valid = (c[i] & 0xc0) == 0x80;
        /* invalid: control characters of Latin 1, overlong sequences, surrogates, code points
         * beyond Unicode */
        if ((c[0] == 0xc2 && c[1] < 0xa0) || (c[0] == 0xe0 && c[1] < 0xa0) ||
            (c[0] == 0xed && c[1] >= 0xa0) || (c[0] == 0xf0 && c[1] < 0x90) ||
            (c[0] == 0xf4 && c[1] >= 0x90))
            valid = false;
        for (int i = 0; i < (valid ? length : 1); i++)
            *to++ = valid ? from[i] : '_';
        from += valid ? length : 1;
    }
    *to = 0;
}

/* Sets the fields of `info` that are known before the stages run. */
static void fill_info(ebpo_info *info, const ebpo_builder *b, const ebpo_mesh *mesh,
                      const ebpo_mesh_report *report, const ebpo_repair_record *repair_record)
{
    const ebpo_build_options *o = b->options;
    info->version_major = EBPO_FORMAT_MAJOR;
    info->version_minor = EBPO_FORMAT_MINOR;
    copy_text(info->generator, "ebpo " EBPO_VERSION);
    copy_text(info->unit, o->unit);
    copy_text(info->crs, o->crs);
    copy_text(info->date, o->date);
    copy_name(info->source_name, mesh->source_name);
    memcpy(info->source_format, mesh->source_format, sizeof info->source_format);
    memcpy(info->source_sha256, mesh->source_sha256, sizeof info->source_sha256);
    info->source_size = mesh->source_size;
    info->solid = b->solid;
    info->rule = o->rule;
    info->double_coordinates = mesh->xyz64 != NULL;
    info->vertex_count = mesh->vertex_count;
    info->face_count = mesh->face_count;
    info->source_vertex_count =
        ebpo_mesh_whole_vertices(mesh) + (repair_record ? repair_record->welded_vertices : 0);
    info->source_face_count =
        ebpo_mesh_whole_faces(mesh) +
        (repair_record ? repair_record->dropped_faces - repair_record->added_faces : 0);
    memcpy(info->box_origin, b->box.origin, sizeof info->box_origin);
    memcpy(info->box_size, b->box.size, sizeof info->box_size);
    info->grid_level = b->box.grid_level;
    info->max_level = b->max_level;
    info->leaf_faces = o->leaf_faces;
    info->epsilon = o->epsilon;
    const ebpo_selection_traits *traits = ebpo_selection_describe(o->select);
    info->selection = o->select;
    info->percent = traits->from_leaves && !(o->k_root > 0) ? o->percent : 0;
    info->k_root = traits->from_leaves ? o->k_root : 0;
    info->normals = traits->uses_normal_distance ? o->normals : 0;
    info->seed = traits->uses_seed ? o->seed : 0;
    if (repair_record)
        info->repair_record = *repair_record;
    info->report = *report;
    /* ebpo_build_border and ebpo_build_surface add these two parts if they can make them */
    info->parts = o->parts & ~(uint32_t)(EBPO_PART_BORDER | EBPO_PART_SURFACE);
    if (!ebpo_attributes_hold(mesh->attributes) || !(o->parts & EBPO_PART_MESH))
        info->parts &= ~(uint32_t)EBPO_PART_ATTRIBUTES;
    if (!ebpo_attributes_coloured(mesh->attributes) || !(o->parts & EBPO_PART_MESH))
        info->parts &= ~(uint32_t)EBPO_PART_COLOURS;
}

/* Arranges the mesh if it is not arranged yet, or if the tree is deeper than the levels for which
 * it was arranged. Then makes the boxes of vertices. */
static ebpo_status arrange_for_levels(ebpo_builder *b, ebpo_mesh *mesh, ebpo_error *error)
{
    const ebpo_progress *progress = &b->options->progress;
    ebpo_status status = mesh->arrangement && mesh->arrangement->key
                             ? EBPO_OK
                             : ebpo_arrange(mesh, -1, b->threads, progress, error);
    if (status == EBPO_OK && mesh->arrangement->box.grid_level < b->max_level)
        status = ebpo_arrange(mesh, b->max_level, b->threads, progress, error);
    if (status != EBPO_OK)
        return status;
    b->mesh = mesh;
    b->box = mesh->arrangement->box;
    b->vertex_count = mesh->arrangement->referenced;
    b->key = mesh->arrangement->key;
    b->face_count = mesh->face_count;
    b->face = (const uint32_t(*)[3])mesh->faces;
    if (!ebpo_progress_stage(progress, "bounds", error))
        return EBPO_E_CANCELLED;
    return ebpo_bounds_make(b, error);
}

/* Sets the builder's options and deepest level, and arranges the mesh. */
static ebpo_status builder_begin(ebpo_builder *b, ebpo_mesh *mesh, const ebpo_mesh_report *report,
                                 const ebpo_build_options *options, ebpo_error *error)
{
    b->options = options;
    b->threads = ebpo_thread_count(options->threads);
    b->solid = report->balanced;
    if (!b->solid && options->require_solid)
        return ebpo_fail(
            error, EBPO_E_NOT_SOLID,
            "%s does not balance (%llu edges are not used equally often in both directions), so it "
            "does not bound a solid; run 'ebpo check' to see the repairs that make one, or omit "
            "--require-solid for a surface model",
            mesh->source_name[0] ? mesh->source_name : "the mesh",
            (unsigned long long)report->unbalanced_edges.count);
    b->max_level = options->max_level >= 0 ? options->max_level : level_limit(report);
    return arrange_for_levels(b, mesh, error);
}

static void builder_free(ebpo_builder *b)
{
    ebpo_capped_free(b->capped);
    ebpo_bounds_free(&b->bounds);
    ebpo_array_free(b->workspace, b->final_index);
    ebpo_branch_free(&b->top);
    for (uint64_t i = 0; i < b->piece_count; i++)
        ebpo_branch_free(&b->piece[i]);
    free(b->piece);
    free(b->top_envelope);
    ebpo_store_free(b->store);
}

/* The parallel job in which each task processes one piece. */
typedef struct piece_job {
    ebpo_builder *b;
    ebpo_emit_scratch **scratch; /* [threads] */
    /* time for making cells, and for computing envelopes: nanoseconds, sums over all threads */
    _Atomic uint64_t cells_ns, envelopes_ns;
} piece_job;

/* Makes the nodes of pieces, numbers their fresh faces, computes their envelopes and moves the
 * results to the store. */
static ebpo_status process_pieces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    piece_job *job = context;
    ebpo_builder *b = job->b;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++) {
        ebpo_branch *piece = &b->piece[i];
        uint64_t begun = ebpo_clock();
        status = ebpo_build_partition(b, piece, error);
        if (status == EBPO_OK)
            status = ebpo_build_number(b, piece, error);
        uint64_t numbered = ebpo_clock();
        job->cells_ns += numbered - begun;
        if (status == EBPO_OK)
            status = ebpo_emit_piece(b, job->scratch[worker], piece, error);
        ebpo_branch_release(piece);
        if (status == EBPO_OK)
            status = ebpo_build_pack(b, piece->out, error);
        job->envelopes_ns += ebpo_clock() - numbered;
    }
    return status;
}

static ebpo_status build_pieces(ebpo_builder *b, ebpo_error *error)
{
    piece_job job = { .b = b, .scratch = ebpo_alloc_zero(b->threads, sizeof *job.scratch) };
    ebpo_status status =
        job.scratch ? EBPO_OK : ebpo_fail_memory(error, b->threads * sizeof *job.scratch);
    for (unsigned i = 0; i < b->threads && status == EBPO_OK; i++)
        status = ebpo_emit_scratch_make(&job.scratch[i], b->workspace, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(b->threads, b->workspace, b->piece_count, 1, process_pieces,
                                   &job, &b->options->progress, "envelopes", error);
    for (unsigned i = 0; i < b->threads && job.scratch; i++)
        ebpo_emit_scratch_free(job.scratch[i]);
    free(job.scratch);
    b->options->times->cells += 1e-9 * (double)job.cells_ns;
    b->options->times->envelopes += 1e-9 * (double)job.envelopes_ns;
    return status;
}

/* Builds the top and the pieces. If the selection works from the root down, each piece is finished
 * in one pass. If it works from the leaves up, the top first needs the planes of all pieces. Then
 * the nodes of each piece are made twice, because they are not kept. For ebpo_build_as_theses, the
 * build ends when the planes are chosen. */
static ebpo_status build_tree(ebpo_builder *b, ebpo_error *error)
{
    ebpo_status status = ebpo_build_corner_windings(b, error);
    if (status == EBPO_OK)
        status = ebpo_build_propose(b, error);
    if (b->thesis)
        return status;
    if (status == EBPO_OK)
        status = ebpo_build_top(b, error);
    if (status == EBPO_OK)
        status = build_pieces(b, error);
    return status;
}

/* Runs the stages, from cutting the tree into pieces to the optional parts. */
static ebpo_status run_stages(ebpo_builder *b, ebpo_mesh *mesh, ebpo_tree *out, ebpo_error *error)
{
    ebpo_status status = ebpo_build_split(b, error);
    if (status == EBPO_OK)
        status = build_tree(b, error);
    if (b->thesis)
        return status;
    if (status == EBPO_OK && !ebpo_progress_stage(&b->options->progress, "joining levels", error))
        status = EBPO_E_CANCELLED;
    if (status == EBPO_OK)
        status = ebpo_build_levels(b, out, error);
    if (status == EBPO_OK &&
        !ebpo_progress_stage(&b->options->progress, "numbering vertices", error))
        status = EBPO_E_CANCELLED;
    if (status == EBPO_OK && b->options->parts & EBPO_PART_MESH)
        status = ebpo_build_mesh(b, mesh, out, error);
    if (out->info.level_count == 1) /* no gray node */
        out->info.parts &= ~(uint32_t)EBPO_PART_COLOURS;
    if (status == EBPO_OK && out->info.parts & EBPO_PART_COLOURS)
        status = ebpo_build_gray_colours(b, out, error);
    bool border = !b->solid && b->options->parts & EBPO_PART_BORDER;
    out->info.border_inside = b->capped;
    ebpo_capped_free(b->capped); /* the border makes another tree of caps */
    b->capped = NULL;
    if (status == EBPO_OK && border && !ebpo_progress_stage(&b->options->progress, "border", error))
        status = EBPO_E_CANCELLED;
    if (status == EBPO_OK && border)
        status = ebpo_build_border(out, b->threads, &b->options->progress, error);
    return status == EBPO_OK && b->options->parts & EBPO_PART_SURFACE
               ? ebpo_build_surface(out, b->threads, &b->options->progress, error)
               : status;
}

/* Builds a tree. If `thesis` is not NULL, computes the sums of ebpo_build_as_theses instead. */
static ebpo_status build_mesh(ebpo_mesh *mesh, const ebpo_mesh_report *report,
                              const ebpo_repair_record *repair_record,
                              const ebpo_build_options *options, const ebpo_thesis_run *thesis,
                              ebpo_tree *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_build_options wanted = EBPO_BUILD_OPTIONS_INIT;
    /* requested: the caller's structure; its size may be that of another version of the library */
    ebpo_build_times times = EBPO_BUILD_TIMES_INIT, *requested = NULL;
    ebpo_builder b = { .workspace = mesh->workspace,
                       .top.workspace = mesh->workspace,
                       .bounds.workspace = mesh->workspace,
                       .thesis = thesis };
    memset(out, 0, sizeof *out);
    out->workspace = out->mesh.workspace = mesh->workspace;
    for (int i = 0; i < EBPO_LEVELS_MAX; i++)
        out->level[i].workspace = mesh->workspace;
    ebpo_status status = EBPO_TAKE(ebpo_build_options, &wanted, options, error);
    /* other parts are not made by a build */
    wanted.parts &= EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_LEAF_PLANES |
                    EBPO_PART_ATTRIBUTES | EBPO_PART_COLOURS | EBPO_PART_BORDER | EBPO_PART_SURFACE;
    if (!(wanted.parts & EBPO_PART_MESH))
        wanted.parts &= ~(uint32_t)(EBPO_PART_BORDER | EBPO_PART_SURFACE);
    if (status == EBPO_OK && wanted.times)
        status = EBPO_CHECK_SIZED(ebpo_build_times, wanted.times, error);
    if (status == EBPO_OK) {
        requested = wanted.times;
        wanted.times = &times;
        status = check_options(&wanted, &out->info, error);
    }
    if (status == EBPO_OK)
        status = builder_begin(&b, mesh, report, &wanted, error);
    if (status == EBPO_OK)
        fill_info(&out->info, &b, mesh, report, repair_record);
    if (status == EBPO_OK && !b.solid && !thesis && wanted.parts & EBPO_PART_BORDER &&
        wanted.parts & EBPO_PART_PLANES) {
        ebpo_border_loops loops = { 0 };
        status = ebpo_build_find_border(&loops, mesh, b.threads, error);
        if (status == EBPO_OK)
            status = ebpo_capped_make(&b, &loops, error);
        ebpo_border_loops_free(&loops);
    }
    if (status == EBPO_OK)
        status = run_stages(&b, mesh, out, error);
    if (requested)
        EBPO_GIVE(ebpo_build_times, requested, &times);
    builder_free(&b);
    ebpo_mesh_free(mesh);
    if (status != EBPO_OK)
        ebpo_tree_free(out);
    return status;
}

ebpo_status ebpo_build(ebpo_mesh *mesh, const ebpo_mesh_report *report,
                       const ebpo_repair_record *repair_record, const ebpo_build_options *options,
                       ebpo_tree *out, ebpo_error *error)
{
    return build_mesh(mesh, report, repair_record, options, NULL, out, error);
}

ebpo_status ebpo_build_as_theses(ebpo_mesh *mesh, const ebpo_mesh_report *report,
                                 const ebpo_build_options *options, ebpo_coalescing coalesce,
                                 ebpo_thesis_levels *out, ebpo_error *error)
{
    ebpo_build_options wanted = EBPO_BUILD_OPTIONS_INIT;
    ebpo_thesis_levels levels = EBPO_THESIS_LEVELS_INIT;
    ebpo_thesis_run run = { coalesce, &levels };
    ebpo_tree none;
    ebpo_status status = EBPO_TAKE(ebpo_build_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = EBPO_CHECK_SIZED(ebpo_thesis_levels, out, error);
    if (status == EBPO_OK && (unsigned)coalesce > EBPO_COALESCE_MEAN)
        status = ebpo_fail(error, EBPO_E_ARGUMENT,
                           "unknown criterion of leaves %d; give a value of ebpo_coalescing",
                           (int)coalesce);
    const ebpo_selection_traits *traits = ebpo_selection_describe(wanted.select);
    if (status == EBPO_OK && !(traits && traits->from_leaves))
        status = ebpo_fail(error, EBPO_E_ARGUMENT,
                           "selection %d is not a selection of the theses; give "
                           "EBPO_SELECT_KMEDOIDS, EBPO_SELECT_OFFSET or EBPO_SELECT_RANDOM",
                           (int)wanted.select);
    if (status != EBPO_OK) {
        ebpo_mesh_free(mesh);
        return status;
    }
    wanted.parts |= EBPO_PART_PLANES | EBPO_PART_LEAF_PLANES;
    status = build_mesh(mesh, report, NULL, &wanted, &run, &none, error);
    if (status == EBPO_OK) {
        ebpo_tree_free(&none);
        EBPO_GIVE(ebpo_thesis_levels, out, &levels);
    }
    return status;
}
