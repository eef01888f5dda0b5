/* Finds the methods to compare: existing files, or files built from one mesh with each selection.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"
#include "cli/mesh_input.h"
#include "cli/mesh_advice.h"
#include "cli/report/report_data.h"
#include "cli/report/report_output.h"
#include "cli/selection_args.h"
#include "cli/words.h"

/* Reports "WHAT: MESSAGE". Returns EXIT_USAGE. */
static int refuse_method(const char *message, const char *what)
{
    fprintf(stderr, "ebpo report: %s: %s; try 'ebpo report --help'\n", what, message);
    return EXIT_USAGE;
}

/* --- files --- */

/* Returns true if the files were made from the same mesh. */
static bool same_model(const ebpo_info *a, const ebpo_info *b)
{
    return memcmp(a->source_sha256, b->source_sha256, sizeof a->source_sha256) == 0 &&
           a->solid == b->solid && a->rule == b->rule &&
           a->source_face_count == b->source_face_count &&
           memcmp(a->report.min, b->report.min, sizeof a->report.min) == 0 &&
           memcmp(a->report.max, b->report.max, sizeof a->report.max) == 0 &&
           memcmp(&a->report.volume, &b->report.volume, sizeof a->report.volume) == 0;
}

/* Reads the facts of the method's file. Returns an exit code. */
static int read_facts(comparison *c, method *m)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    ebpo_status status = remote_open(&file, m->path, &c->v->remote, &error);
    if (status == EBPO_OK) {
        m->stored = (ebpo_stored_sizes)EBPO_STORED_SIZES_INIT;
        status = ebpo_file_locate(file, &m->stored, &error);
    }
    if (status == EBPO_OK)
        m->info = *ebpo_file_info(file);
    ebpo_close(file);
    m->levels = m->info.level_count;
    if (status != EBPO_OK)
        return command_failed("report", &error);
    if (m == c->methods || same_model(&c->methods->info, &m->info))
        return EXIT_OK;
    fprintf(stderr,
            "ebpo report: %s and %s are made from different meshes; a report compares files of one "
            "model\n",
            remote_shown(c->methods->path), remote_shown(m->path));
    return EXIT_FAILED;
}

/* Sets `name` to the name of the file without folder and endings. Replaces characters that names of
 * methods must not have by '_'. */
static void write_method_name(const char *path, char *name, size_t capacity)
{
    report_stem(path, name, capacity);
    for (char *c = name; *c; c++)
        if (strchr("/,\"\n\r", *c))
            *c = '_';
}

static int add_file(comparison *c, const char *path)
{
    char name[64];
    if (c->count == METHODS_MAX)
        return refuse_method("more than 12 files; give fewer files", path);
    if (c->count < c->v->names.count)
        snprintf(name, sizeof name, "%s", c->v->names.item[c->count]);
    else
        write_method_name(path, name, sizeof name);
    if (strlen(path) >= sizeof c->methods->path)
        return refuse_method("the name is too long", path);
    if (strpbrk(name, "/,\"\n"))
        return refuse_method(
            "a method's name must not have a '/', comma, quotation mark or new line; give another "
            "--name",
            name);
    for (int i = 0; i < c->count; i++)
        if (strcmp(c->methods[i].name, name) == 0)
            return refuse_method("two methods would have this name; give a --name for each file",
                                 name);
    method *m = &c->methods[c->count++];
    method_begin(m, name, path);
    return read_facts(c, m);
}

/* --- from a mesh --- */

typedef struct build_result {
    double seconds, unlimited_seconds; /* times of the build and of --unlimited */
    ebpo_thesis_levels *levels;        /* results of --unlimited; NULL: not computed */
} build_result;

static void build_options(const comparison *c, int selection, const plane_setting *setting,
                          ebpo_build_options *o)
{
    const report_values *v = c->v;
    *o = (ebpo_build_options)EBPO_BUILD_OPTIONS_INIT;
    o->max_level = (int)v->max_level;
    o->leaf_faces = (uint32_t)v->leaf_faces;
    o->epsilon = v->epsilon;
    o->parts |= EBPO_PART_LEAF_PLANES; /* so that all planes are known without the mesh */
    o->select = (ebpo_selection)selection;
    o->percent = setting->percent;
    o->normals = (ebpo_normal_distance)v->normals;
    o->seed = (uint64_t)v->seed;
    o->threads = (unsigned)v->threads;
    o->progress = c->progress;
}

/* Computes the levels of --unlimited. For these levels, limits of the file format, such as the
 * limit on the number of planes of a node, do not apply. Empties the mesh. */
static ebpo_status compute_unlimited(const comparison *c, mesh_input *p,
                                     const ebpo_build_options *build, build_result *out,
                                     ebpo_error *error)
{
    ebpo_coalescing coalesce =
        c->v->coalesce >= 0 ? (ebpo_coalescing)c->v->coalesce : EBPO_COALESCE_DISTINCT;
    out->levels = calloc(1, sizeof *out->levels);
    if (!out->levels) {
        ebpo_mesh_free(&p->mesh);
        snprintf(error->message, sizeof error->message, "not enough memory for the levels");
        return error->status = EBPO_E_MEMORY;
    }
    *out->levels = (ebpo_thesis_levels)EBPO_THESIS_LEVELS_INIT;
    double begin = progress_now();
    ebpo_status status =
        ebpo_build_as_theses(&p->mesh, &p->prepared.report, build, coalesce, out->levels, error);
    out->unlimited_seconds = progress_now() - begin;
    return status;
}

/* Builds one file, or, if `unlimited`, computes the levels of --unlimited. Reads the mesh again for
 * each method, because the builder consumes the mesh. */
static ebpo_status build_one(comparison *c, const char *mesh, int selection,
                             const plane_setting *setting, const char *path, bool unlimited,
                             build_result *out, ebpo_error *error)
{
    ebpo_build_options build;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    ebpo_tree tree;
    mesh_input p;
    ebpo_status status = mesh_input_read(&p, mesh, (repair_request){ 0 }, READ_MESH, NULL,
                                         (unsigned)c->v->threads, c->progress, error);
    if (status != EBPO_OK)
        return status;
    if (c->count == 0) {
        if (c->progress.user)
            progress_wipe(c->progress.user);
        advice_warn(stderr, "report", mesh, &p);
    }
    build_options(c, selection, setting, &build);
    status = selection_k_root(setting->k_root[0] ? setting->k_root : NULL, p.mesh.face_count,
                              &build.k_root, error);
    if (status != EBPO_OK) {
        ebpo_mesh_free(&p.mesh);
        return status;
    }
    if (unlimited)
        return compute_unlimited(c, &p, &build, out, error);
    double begin = progress_now();
    status = ebpo_build(&p.mesh, &p.prepared.report, &p.prepared.record, &build, &tree, error);
    out->seconds = progress_now() - begin;
    if (status != EBPO_OK)
        return status;
    write.threads = build.threads;
    write.progress = c->progress;
    status = ebpo_tree_write(&tree, path, &write, error);
    ebpo_tree_free(&tree);
    return status;
}

static int build_method(comparison *c, const char *mesh, int selection,
                        const plane_setting *setting)
{
    char path[sizeof c->folder + OUTPUT_NAME_MAX], stem[64];
    ebpo_error error = EBPO_ERROR_INIT;
    build_result out = { 0 };
    bool unlimited =
        c->v->unlimited && ebpo_selection_describe((ebpo_selection)selection)->from_leaves;
    snprintf(stem, sizeof stem, "%s%s", selection_words[selection], setting->word);
    output_add_model(c->folder, stem, path, sizeof path);
    if (build_one(c, mesh, selection, setting, path, false, &out, &error) != EBPO_OK)
        return command_failed("report", &error);
    int code = add_file(c, path);
    if (code != EXIT_OK)
        return code;
    method *m = &c->methods[c->count - 1];
    m->whole[METRIC_BUILD_SECONDS] = out.seconds;
    ebpo_status status =
        unlimited ? build_one(c, mesh, selection, setting, path, true, &out, &error) : EBPO_OK;
    m->unlimited = out.levels;
    m->unlimited_seconds = out.unlimited_seconds;
    return status == EBPO_OK ? EXIT_OK : command_failed("report", &error);
}

/* Returns the number of methods of a selection. Only selections of the theses, which select planes
 * from the leaves, have settings. */
static int settings_of(const comparison *c, int selection)
{
    return ebpo_selection_describe((ebpo_selection)selection)->from_leaves ? c->settings : 1;
}

static int build_all(comparison *c, const char *mesh)
{
    static const plane_setting none = { .percent = 40 };
    int code = EXIT_OK, count = 0;
    for (int i = 0; selection_words[i]; i++)
        count += c->v->select >> i & 1 ? settings_of(c, i) : 0;
    if (count > METHODS_MAX)
        return refuse_method(
            "more than 12 methods; give fewer selections, or fewer numbers of planes", mesh);
    for (int i = 0; selection_words[i]; i++)
        for (int k = 0; c->v->select >> i & 1 && k < settings_of(c, i) && code == EXIT_OK; k++)
            code = build_method(c, mesh, i,
                                ebpo_selection_describe((ebpo_selection)i)->from_leaves
                                    ? &c->setting[k]
                                    : &none);
    return code;
}

/* --- files or a mesh --- */

static int find_files(comparison *c, const char *const *operand)
{
    report_stem(operand[0], c->model, sizeof c->model);
    for (int i = 0; operand[i]; i++) {
        int is_hdf5 = command_is_hdf5("report", operand[i]);
        if (is_hdf5 < 0)
            return EXIT_FAILED;
        if (!is_hdf5 && operand[1])
            return refuse_method("a mesh must be the only operand; its methods are named by "
                                 "--select",
                                 operand[i]);
        if (!is_hdf5 && c->v->names.count)
            return refuse_method(
                "the methods of a mesh have the names of the selections; omit --name", operand[i]);
        if (!is_hdf5)
            return build_all(c, operand[i]);
        int code = add_file(c, operand[i]);
        if (code != EXIT_OK)
            return code;
    }
    return EXIT_OK;
}

int report_find_methods(comparison *c, const char *const *operand)
{
    int code = find_files(c, operand);
    const ebpo_mesh_report *r = &c->methods->info.report;
    if (code != EXIT_OK)
        return code;
    if (c->count > 1 && c->methods->info.source_name[0])
        report_stem(c->methods->info.source_name, c->model, sizeof c->model);
    c->diagonal = hypot(hypot(r->max[0] - r->min[0], r->max[1] - r->min[1]), r->max[2] - r->min[2]);
    if (c->first > comparison_last(c)) {
        if (c->progress.user)
            progress_wipe(c->progress.user);
        fprintf(stderr, "ebpo report: --levels: there is no level %d; the deepest level is %d\n",
                c->first, comparison_last(c));
        return EXIT_USAGE;
    }
    return EXIT_OK;
}
