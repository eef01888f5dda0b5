#include "cli/subtree_args.h"

#include <string.h>

#include <ebpo/file.h>

#include "cli/command.h"
#include "cli/words.h"

const char *const face_coding_words[] = { "default", "gates", "high-water", NULL };

bool subtree_faces_read(const char *command, const char *text, uint64_t *out)
{
    *out = 0;
    if (!text)
        return true;
    if (strcmp(text, "none") == 0)
        *out = EBPO_NO_SUBTREES;
    else if (!words_read_size(text, out) || *out == 0 || *out == EBPO_NO_SUBTREES) {
        command_usage(command, "--subtree-faces: '%s' is neither a number of faces nor 'none'",
                      text);
        return false;
    }
    return true;
}
