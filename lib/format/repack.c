/* A file written anew, which holds what it held. */
#include <string.h>

#include <ebpo/file.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "format/container_write.h"
#include "format/reader.h"
#include "io/publish.h"

/* What is on the disk, against the content of the file that was read. */
static ebpo_status check_written(const ebpo_file *from, const ebpo_publish *out,
                                 const ebpo_read_options *read, ebpo_error *error)
{
    ebpo_file *file;
    ebpo_status status = ebpo_open_own(ebpo_publish_path(out), &file, error);
    if (status != EBPO_OK)
        return status;
    bool same = memcmp(file->info.content_sha256, from->info.content_sha256,
                       sizeof file->info.content_sha256) == 0 &&
                memcmp(file->attributes.sha256, from->attributes.sha256,
                       sizeof file->attributes.sha256) == 0;
    if (same)
        status = ebpo_file_check_content(file, read, error);
    ebpo_close(file);
    if (status != EBPO_OK || same)
        return status;
    status = ebpo_file_check_content(from, read, error);
    return status != EBPO_OK
               ? status
               : ebpo_fail_file(error, EBPO_E_UNSUPPORTED, from->in.shown,
                                "written anew it would have another content checksum, although "
                                "its own is right; another program has stored its arrays in ways "
                                "that this one does not write. Nothing was written");
}

ebpo_status ebpo_file_repack(const ebpo_file *file, const char *path, const ebpo_read_options *read,
                             const ebpo_write_options *write, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_write_options wanted = EBPO_WRITE_OPTIONS_INIT;
    ebpo_publish out = EBPO_PUBLISH_INIT;
    ebpo_tree tree = { 0 };
    ebpo_status status = EBPO_TAKE(ebpo_write_options, &wanted, write, error);
    wanted.parts = ~0u;
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&out, path, error); /* before what may take long */
    if (status == EBPO_OK) {
        ebpo_publish_expect_input(&out, &file->in);
        status = ebpo_file_read_tree(file, read, &tree, error);
    }
    if (status == EBPO_OK)
        status = ebpo_tree_write_into(&tree, ebpo_publish_path(&out), path, &wanted, error);
    ebpo_tree_free(&tree);
    if (status == EBPO_OK)
        status = check_written(file, &out, read, error);
    if (status == EBPO_OK)
        status = ebpo_publish_commit(&out, error);
    ebpo_publish_abort(&out);
    return status;
}
