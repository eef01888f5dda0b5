/* Any bytes as a file: opening and reading everything ends in a status, nothing else. */
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include <ebpo/file.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* libhdf5 1.10 itself leaks when it gives up on a damaged object header; that is not what we look for here. */
__attribute__((visibility("default"))) const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void)
{
    return "leak:libhdf5";
}

static char path[64];

static void remove_file(void)
{
    unlink(path);
}

static int open_scratch(void)
{
    if (path[0])
        return open(path, O_WRONLY | O_TRUNC);
    snprintf(path, sizeof path, "%s/ebpo-fuzz-XXXXXX", access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp");
    atexit(remove_file);
    return mkstemp(path);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    ebpo_file *file;
    ebpo_tree tree;
    ebpo_mesh mesh;
    int fd = open_scratch();
    if (fd < 0 || write(fd, data, size) != (ssize_t)size)
        abort();
    close(fd);
    if (ebpo_open(&file, path, NULL) != EBPO_OK)
        return 0;
    if (ebpo_file_read_tree(file, &tree, 1, NULL) == EBPO_OK)
        ebpo_tree_free(&tree);
    if (ebpo_file_read_source_mesh(file, &mesh, NULL, 1, NULL) == EBPO_OK)
        ebpo_mesh_free(&mesh);
    (void)!ebpo_file_check_content(file, 1, NULL);
    ebpo_close(file);
    return 0;
}
