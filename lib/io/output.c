/* The public face of publish.h: whole files, and giving up. */
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/unnamed_file.h"
#include "io/publish.h"
#include "io/unfinished.h"

ebpo_status ebpo_write_file(const char *path, const void *data, size_t size, ebpo_error *error)
{
    ebpo_publish out = EBPO_PUBLISH_INIT;
    ebpo_status status = ebpo_publish_begin(&out, path, error);
    if (status != EBPO_OK)
        return status;
    FILE *stream = ebpo_publish_stream(&out);
    if (!stream)
        status = ebpo_fail_memory(error, BUFSIZ);
    else if (fwrite(data, 1, size, stream) != size)
        status = ebpo_fail_errno(error, path, "could not be written");
    if (status == EBPO_OK)
        status = ebpo_publish_commit(&out, error);
    ebpo_publish_abort(&out);
    return status;
}

struct ebpo_output {
    ebpo_publish publish;
};

ebpo_status ebpo_output_begin(const char *path, ebpo_output **out, int *descriptor,
                              ebpo_error *error)
{
    *descriptor = -1;
    *out = ebpo_alloc(1, sizeof **out);
    if (!*out)
        return ebpo_fail_memory(error, sizeof **out);
    ebpo_status status = ebpo_publish_begin(&(*out)->publish, path, error);
    if (status != EBPO_OK) {
        free(*out);
        *out = NULL;
        return status;
    }
    *descriptor = (*out)->publish.fd;
    return EBPO_OK;
}

ebpo_status ebpo_output_end(ebpo_output *out, ebpo_error *error)
{
    ebpo_status status = ebpo_publish_commit(&out->publish, error);
    free(out);
    return status;
}

void ebpo_output_abandon(ebpo_output *out)
{
    if (out)
        ebpo_publish_abort(&out->publish);
    free(out);
}

ebpo_status ebpo_check_output(const char *path, ebpo_error *error)
{
    ebpo_publish out;
    ebpo_status status = ebpo_publish_begin(&out, path, error);
    ebpo_publish_abort(&out);
    return status;
}

void ebpo_abandon_outputs(void)
{
    ebpo_unfinished_remove();
    ebpo_workspace_abandon();
}
