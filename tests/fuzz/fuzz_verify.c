/* SPDX-License-Identifier: MIT
 * Any bytes as a file that is verified. */
#include "fuzz_support.h"

#include <ebpo/verify.h>

#include "known_leaks.h"

/* Any result is allowed; the work must be limited by the size of the file. */
static void verify(ebpo_file *file)
{
    ebpo_workspace_options limited = EBPO_WORKSPACE_OPTIONS_INIT;
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    limited.memory = 512 << 20;
    fuzz_must(ebpo_workspace_new(&limited, &options.workspace, NULL) == EBPO_OK);
    options.threads = 1;
    options.label_samples = 64;
    (void)!ebpo_verify(file, &options, &report, NULL);
    ebpo_workspace_free(options.workspace);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    ebpo_file *file;
    if (ebpo_open_memory(data, size, "fuzzed", &file, NULL) != EBPO_OK)
        return 0;
    verify(file);
    ebpo_close(file);
    return 0;
}
