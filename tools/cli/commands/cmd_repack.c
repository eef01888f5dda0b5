/* ebpo repack: writes the content of a file in the current layout, or with other options of
 * storage. */
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "cli/command.h"
#include "cli/file_facts.h"
#include "cli/memory_args.h"
#include "cli/progress.h"
#include "cli/remote_args.h"
#include "cli/subtree_args.h"
#include "cli/words.h"
#include "cli/commands/commands.h"

typedef struct values {
    const char *subtree_faces, *parts;
    int codec; /* -1: not given */
    int face_coding;
    int64_t zstd_level, threads;
    memory_values memory;
    bool json, quiet;
    remote_values remote;
} values;

#include "cli/options/repack.inc"

static int check_values(const values *v, ebpo_write_options *write)
{
    if (!memory_check("repack", &v->memory) ||
        !subtree_faces_read("repack", v->subtree_faces, &write->subtree_faces))
        return EXIT_USAGE;
    if (v->parts && strcmp(v->parts, "+surface") != 0)
        return command_usage("repack", "--parts: '%s' is not +surface", v->parts);
    if (v->zstd_level && v->codec > EBPO_CODEC_ZSTD)
        return command_usage("repack", "--zstd-level does not apply to --codec deflate or none");
    write->threads = (unsigned)v->threads;
    write->face_coding = (ebpo_face_coding)v->face_coding;
    write->codec_level = (int)v->zstd_level;
    return EXIT_OK;
}

/* Sets the codec: that of --codec, otherwise that of the file. Fails if --zstd-level does not
 * apply. */
static ebpo_status choose_codec(const values *v, const ebpo_info *info, ebpo_write_options *write,
                                ebpo_error *error)
{
    write->codec = v->codec >= 0 ? (ebpo_codec)v->codec : info->codec;
    if (!v->zstd_level || write->codec == EBPO_CODEC_ZSTD)
        return EBPO_OK;
    snprintf(error->message, sizeof error->message,
             "--zstd-level does not apply to the codec of this file; add --codec zstd");
    return error->status = EBPO_E_ARGUMENT;
}

static void print_words(const values *v, const ebpo_info *info, const char *out,
                        const ebpo_info *from, double seconds)
{
    char before[32], after[32], hex[65], subtrees[40];
    words_hex(info->content_sha256, hex);
    printf("%s: the same content, SHA-256 %s; %s before, %s now", out, hex,
           words_bytes(before, sizeof before, from->file_bytes),
           words_bytes(after, sizeof after, info->file_bytes));
    if (info->parts & ~from->parts & EBPO_PART_BORDER)
        fputs(", with the border of the surface", stdout);
    if (info->parts & ~from->parts & EBPO_PART_SURFACE)
        fputs(", with the simplified surface", stdout);
    if (v->parts && !(info->parts & EBPO_PART_SURFACE))
        printf(", without a simplified surface: %s", facts_no_surface(info));
    if (info->subtree_level)
        printf(", %s below level %d",
               words_plural(subtrees, sizeof subtrees, info->level[info->subtree_level].gray_count,
                            "subtree", "subtrees"),
               info->subtree_level);
    printf(", in %.1f s\n", seconds);
}

static void print_json(const values *v, const ebpo_info *info, const ebpo_stored_sizes *stored,
                       const char *out, const ebpo_info *from, const traffic *t, double seconds)
{
    json j;
    json_begin(&j, stdout);
    json_object(&j, NULL);
    facts_json(&j, out, info, stored, NULL);
    json_uint(&j, "source_bytes", from->file_bytes);
    json_bool(&j, "same_content", true);
    json_real(&j, "seconds", seconds);
    remote_json(&j, t, &v->remote);
    json_finish(&j);
}

static ebpo_status report_sizes(const values *v, const char *out, const ebpo_file *from,
                                double seconds, ebpo_error *error)
{
    ebpo_file *file = NULL;
    ebpo_stored_sizes stored = EBPO_STORED_SIZES_INIT;
    if (v->quiet && !v->json)
        return EBPO_OK;
    ebpo_status status = remote_open_own(out, &file, error);
    if (status == EBPO_OK)
        status = ebpo_file_locate(file, &stored, error);
    traffic t = traffic_of(from);
    if (status == EBPO_OK && v->json)
        print_json(v, ebpo_file_info(file), &stored, out, ebpo_file_info(from), &t, seconds);
    else if (status == EBPO_OK)
        print_words(v, ebpo_file_info(file), out, ebpo_file_info(from), seconds);
    if (status == EBPO_OK && !v->json)
        remote_report(&t, &v->remote, false);
    ebpo_close(file);
    return status;
}

static const values standard = { .codec = -1, .remote = REMOTE_VALUES_INIT };

static int run_repack(void *given, const char **operand)
{
    const values *v = given;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    int code = check_values(v, &write);
    if (code != EXIT_OK)
        return code;
    if (!command_requires_hdf5("repack", operand[0]))
        return EXIT_FAILED;
    progress_line line;
    double begun = progress_now();
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    write.progress = progress_start(&line, "repack", v->quiet);
    read.threads = write.threads;
    ebpo_status status = memory_new(&read.workspace, &v->memory, &error), written = EBPO_OK;
    if (status == EBPO_OK)
        status = remote_open(&file, operand[0], &v->remote, &error);
    if (status == EBPO_OK)
        status = choose_codec(v, ebpo_file_info(file), &write, &error);
    if (status == EBPO_OK)
        status = written =
            (v->parts ? ebpo_file_add_surface : ebpo_file_add_border)(file, operand[1], &read,
                                                                      &write, &error);
    progress_wipe(&line);
    if (status == EBPO_OK)
        status = report_sizes(v, operand[1], file, progress_now() - begun, &error);
    ebpo_close(file);
    ebpo_workspace_free(read.workspace);
    code = status == EBPO_OK ? EXIT_OK : command_failed("repack", &error);
    /* EBPO_E_UNSUPPORTED has two reasons. If the error names the output file, this build cannot
     * write the file. Otherwise the content would differ. */
    bool differs = written == EBPO_E_UNSUPPORTED && strcmp(error.file, operand[1]) != 0;
    return differs ? EXIT_DIFFERS : code;
}

const command command_repack = { &spec, sizeof standard, &standard, run_repack };
